"""Findings as lines for a person: a word, a name, what was found; below it what to do, and the command to type."""

from __future__ import annotations

import sys
import textwrap
import time
from collections.abc import Iterable
from typing import Any

from sil.doctor.findings import NOTE, OK, PROBLEM, Finding

COLOURS = {OK: "green", NOTE: "yellow", PROBLEM: "bold red", "pass": "green", "fail": "bold red", "skipped": "yellow"}
STATUS_COLUMN, NAME_COLUMN = 9, 14
STEP = 3  # by which the second piece of a folded line is indented
WIDE, NARROW_INDENT = 98, " " * 4
PLAIN = str.maketrans("→▁▂▃▄▅▆▇█", ">.:-=+*%#")  # for an output that takes no more
WIDEST = 160  # longer lines are hard to read
QUIET_S = 2.0  # nothing is said of what takes less
PLAIN_EVERY_S = 5.0


class Page:
    """Writes findings on stdout as they come. Commands and raw bytes are never folded, so that they can be copied.

    name_column: how wide the names of the checks are.
    """

    def __init__(self, name_column: int = NAME_COLUMN) -> None:
        from rich.console import Console

        self._name_column = name_column
        self._console = Console(highlight=False, soft_wrap=True)
        self._encoding = self._console.encoding
        self._arrow = self._writable("→ ")
        self._width = min(self._console.width, WIDEST) if self._console.is_terminal else 0

    def show(self, finding: Finding) -> None:
        """One finding: what was found, what to do, more of what was found, what to type."""
        from rich.text import Text

        finding = Finding(*(self._writable(value) for value in finding))
        colour = COLOURS[finding.status]
        indent = " " * (STATUS_COLUMN + self._name_column)
        first, *more = self._folded(finding.found, 0) or [""]
        head = Text.assemble(
            (f"{finding.status:<{STATUS_COLUMN}}", colour), (f"{finding.check:<{self._name_column}}", "bold")
        )
        self._print(head.append(first))
        for piece in more:
            self._print(Text(indent + piece))
        for number, piece in enumerate(self._folded(finding.advice, len(self._arrow))):
            self._print(Text(f"{indent}{' ' * len(self._arrow) if number else self._arrow}{piece}"))
        for line in finding.lines:
            for number, piece in enumerate(self._folded(line, STEP)):
                self._print(Text(f"{indent}{' ' * STEP if number else ''}{piece}", style="dim"))
        for row in finding.raw:  # 73 columns wide
            self._print(Text((NARROW_INDENT if 0 < self._width < WIDE else indent) + row, style="dim"))
        for command in finding.commands:
            fits = not self._width or len(indent) + len(command) + 2 <= self._width
            self._print(Text.assemble(indent if fits else NARROW_INDENT, ("$ ", "dim"), (command, "cyan")))

    def heading(self, text: str, style: str = "bold", rest: str = "") -> None:
        """A line that sets apart what follows."""
        from rich.text import Text

        self._print(Text.assemble("\n", (self._writable(text), style), self._writable(rest)))

    def summary(self, findings: Iterable[Finding], subject: str) -> None:
        """The last line: how many of each."""
        from rich.text import Text

        statuses = [finding.status for finding in findings]
        problems, notes = statuses.count(PROBLEM), statuses.count(NOTE)
        word = (f"{problems} problem{'s' * (problems != 1)}", "bold red") if problems else ("no problem", "bold green")
        said = f", {notes} note{'s' * (notes != 1)}, {statuses.count(OK)} ok" if statuses else ""
        self._print(Text.assemble("\n", (f"{subject}: ", "bold"), word, said))

    def _writable(self, value: Any) -> Any:
        """A text (or a tuple of them) in the characters that the output takes; anything else as it is."""
        if isinstance(value, tuple):
            return tuple(self._writable(piece) for piece in value)
        if not isinstance(value, str) or "utf" in self._encoding.lower():
            return value
        return value.translate(PLAIN).encode(self._encoding, "replace").decode(self._encoding)

    def _folded(self, text: str, step: int) -> list[str]:
        """`text` in pieces that fit, indented by `step` more; whole where the output is no terminal."""
        room = self._width - STATUS_COLUMN - self._name_column - step
        if room < 20:
            return [text] if text else []
        return textwrap.wrap(text, room, break_on_hyphens=False)

    def _print(self, text: Any) -> None:
        self._console.print(text, soft_wrap=True)


class Progress:
    """What is going on, on stderr: a line that is replaced on a terminal, a line every five seconds elsewhere.

    quiet_s: nothing is said of what takes less.
    """

    def __init__(self, quiet_s: float = QUIET_S) -> None:
        self._quiet_s = quiet_s
        self._began = self._said = time.monotonic()
        self._status: Any = None

    def tell(self, text: str) -> None:
        """Say it, if this is taking a while. Cheap: called after every round trip."""
        now = time.monotonic()
        if now - self._began < self._quiet_s:
            return
        if not sys.stderr.isatty():
            if now - self._said >= PLAIN_EVERY_S:
                self._said = now
                print(text, file=sys.stderr, flush=True)
            return
        if now - self._said < 0.1 and self._status is not None:
            return
        self._said = now
        if self._status is None:
            from rich.console import Console

            self._status = Console(stderr=True, highlight=False).status(text)
            self._status.start()
        self._status.update(text)

    def clear(self) -> None:
        """Take it off the terminal, and begin anew: what comes next has a while of its own."""
        if self._status is not None:
            self._status.stop()
            self._status = None
        self._began = self._said = time.monotonic()
