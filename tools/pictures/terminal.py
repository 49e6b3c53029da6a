"""What a command shows on a terminal, as an SVG: run in a pseudo-terminal, its text and colours drawn on a dark card.

Every run of characters of one style is a <text> of fixed length, so that columns and bars meet whatever monospace font
the reader has. Nothing of it is fetched from anywhere.
"""

from __future__ import annotations

import fcntl
import os
import re
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Sequence
from html import escape
from pathlib import Path

from rich.cells import cell_len
from rich.console import Console
from rich.style import Style
from rich.terminal_theme import TerminalTheme
from rich.text import Text

from sil.screen.messages import BEGIN_FRAME, END_FRAME

SIL = (sys.executable, "-P", "-m", "sil")
SIZE = (96, 60)  # columns, rows of the terminal
_CELL, _LINE, _FONT = 8.4, 18, 14  # px
_PAD, _BAR = 16, 34
_PAPER, _INK, _FAINT, _EDGE = "#1b1f27", "#d8dee9", "#8b93a3", "#2c323d"
_FACES = "ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace"
_THEME = TerminalTheme(
    (27, 31, 39),
    (216, 222, 233),
    [(59, 66, 82), (224, 108, 117), (152, 195, 121), (229, 192, 123), (97, 175, 239), (198, 120, 221), (86, 182, 194),
     (216, 222, 233)],
)  # fmt: skip
_PIECE = re.compile(r"\S+(?: \S+)*")
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-HJKSTfhlsu]|\r|\x1b\][^\x07]*\x07")


def seen(command: Sequence[str], folder: Path, size: tuple[int, int] = SIZE) -> str:
    """All that the command writes to a terminal of this size. Raises OSError for a usage error."""
    master, slave = os.openpty()
    fcntl.ioctl(master, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(size[0]), "LINES": str(size[1])}
    environment.pop("NO_COLOR", None)
    process = subprocess.Popen(command, cwd=folder, stdin=slave, stdout=slave, stderr=slave, env=environment)
    os.close(slave)
    data = b""
    while True:
        select.select([master], [], [])
        try:
            data += (more := os.read(master, 65536))
        except OSError:  # the last one that held the terminal is gone
            break
        if not more:
            break
    os.close(master)
    if process.wait() not in (0, 1, 3):  # 1: a requirement failed, a difference was found; 3: this machine is busy
        raise OSError(f"{' '.join(command)}: exit code {process.returncode}\n{data.decode()}")
    return data.decode()


def frames(text: str) -> list[str]:
    """Every whole view that was drawn, in order."""
    drawn = re.findall(re.escape(BEGIN_FRAME) + "(.*?)" + re.escape(END_FRAME), text, re.DOTALL)
    return [each for each in drawn if "wake-up late" in each]


def plain(text: str) -> str:
    """Without colours and other control sequences."""
    return Text.from_ansi(_CONTROL.sub("", text)).plain


def after_the_view(text: str) -> str:
    """What was printed when the live view, or a line of progress, was over."""
    return text.rpartition(END_FRAME)[2].rpartition("\x1b[2K")[2]


def drawn(command: str, text: str) -> str:
    """The SVG: the command in the title bar, below it the text in its ANSI colours; as wide as the text needs."""
    lines = [Text.from_ansi(_CONTROL.sub("", line)) for line in text.strip("\n").split("\n")]
    columns = max(*(cell_len(line.plain.rstrip()) for line in lines), len(command) + 12)
    width, height = 2 * _PAD + columns * _CELL, _BAR + 2 * _PAD + len(lines) * _LINE - 4
    body = "".join(_row(line, _PAD, _BAR + _PAD + 12 + i * _LINE) for i, line in enumerate(lines))
    dots = "".join(f'<circle cx="{20 + 17 * i}" cy="{_BAR / 2:g}" r="5" fill="{_EDGE}"/>' for i in range(3))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}" font-family="{_FACES}" font-size="{_FONT}">\n<title>{escape(command)}</title>\n'
        f'<rect width="100%" height="100%" rx="8" fill="{_PAPER}"/><path d="M0 {_BAR}H{width:g}" stroke="{_EDGE}"/>'
        f'{dots}\n<text x="76" y="{_BAR / 2 + 5:g}" fill="{_FAINT}">$ {escape(command)}</text>\n{body}</svg>\n'
    )


def _row(line: Text, x: float, y: float) -> str:
    """One line: each piece between wide gaps at its column, stretched to its number of cells."""
    made, column = "", 0
    for segment in line.render(Console(color_system="truecolor", force_terminal=True)):
        text = segment.text.rstrip("\n")
        look = _look(segment.style or Style())
        for found in _PIECE.finditer(text):
            at, length = x + (column + cell_len(text[: found.start()])) * _CELL, cell_len(found[0]) * _CELL
            size = f'x="{at:.1f}" y="{y:g}" textLength="{length:.1f}" lengthAdjust="spacingAndGlyphs"'
            made += f"<text {size}{look}>{escape(found[0], quote=False)}</text>"
        column += cell_len(text)
    return f"{made}\n" if made else ""


def _look(style: Style) -> str:
    """Colour, weight and dimness as attributes."""
    colour = style.color.get_truecolor(_THEME).hex if style.color and not style.color.is_default else _INK
    weight = ' font-weight="bold"' if style.bold else ""
    return f' fill="{_FAINT if style.dim and colour == _INK else colour}"{weight}'
