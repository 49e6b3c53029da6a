"""The documents' pictures are those of tools.pictures, all of them used; and it draws what it says it draws."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from PIL import Image

from tools import browser
from tools.pictures import FOLDER, NEEDS_BROWSER, __main__, loop, terminal
from tools.pictures.studio import PICTURES, small

REPO = Path(__file__).resolve().parents[2]
DOCUMENTS = [REPO / "README.md", *(REPO / "docs").rglob("*.md")]
SHOWN = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
MOST_BYTES = 2_500_000  # of a clone


def shown() -> dict[Path, str]:
    """Every picture of the documents, and the words for those who cannot see it."""
    return {
        (document.parent / target).resolve(): words
        for document in DOCUMENTS
        for words, target in SHOWN.findall(document.read_text())
    }


def test_every_picture_is_made_by_the_script_and_used() -> None:
    """Protects: no picture that nobody can make again, none that is made for nothing."""
    made = {FOLDER / name for name in PICTURES}
    assert set(FOLDER.iterdir()) == made
    dark = {file for file in made if file.stem.endswith("-dark") and file.with_stem(file.stem[:-5]) in made}
    assert set(shown()) | dark == made  # docs/conf.py shows a picture's dark sibling on dark paper
    assert set(NEEDS_BROWSER) < set(PICTURES)


def test_pictures_are_small_and_have_words() -> None:
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < MOST_BYTES
    assert [file.name for file, words in shown().items() if len(words) < 10] == []


def test_the_loop_is_the_one_that_is_shown() -> None:
    """Protects: an edit of the drawing that was not made anew."""
    assert (FOLDER / "loop.svg").read_text() == loop.drawn(), "python -m tools.pictures loop.svg"


def test_a_terminals_colours_columns_and_signs_are_drawn() -> None:
    text = "\x1b[1;38;5;29mpassed\x1b[0m  a <b> & c\r\n\x1b[2K" + "x" * 30 + "   ▂█  12\n"
    root = ET.fromstring(terminal.drawn("sil run x", text))
    drawn = [each for each in root.iter() if each.tag.endswith("text")]
    words = [(each.text, each.get("fill"), each.get("font-weight")) for each in drawn]
    assert words[0][0] == "$ sil run x"
    assert words[1] == ("passed", "#00875f", "bold")
    assert [word for word, _, _ in words[2:]] == ["a <b> & c", "x" * 30, "▂█", "12"]
    last = next(each for each in drawn if each.text == "12")
    assert float(last.get("x", 0)) == 16 + 8.4 * 37  # its column, after 30 + 3 + 2 + 2


def test_what_a_terminal_is_shown_is_caught(tmp_path: Path) -> None:
    """Protects: the views of a run, and what follows them, by the marks that the painter writes."""
    frames = "".join(f"\x1b[?2026hwake-up late {number}\x1b[?2026l" for number in (1, 2))
    script = f"import sys; print({'a' + frames + 'end'!r}, sys.stdout.isatty())"
    seen = terminal.seen(["python3", "-c", script], tmp_path)
    assert terminal.frames(seen) == ["wake-up late 1", "wake-up late 2"]
    assert terminal.plain("\x1b[2K\x1b[1;31mreal misses\x1b[0m 0") == "real misses 0"
    assert terminal.after_the_view(seen).split() == ["end", "True"]


def test_a_picture_is_made_smaller_not_another() -> None:
    pixels = np.full((40, 60, 3), 255, np.uint8)
    pixels[10:20] = (213, 94, 0)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    again = np.asarray(Image.open(io.BytesIO(small(out.getvalue()))).convert("RGB"))
    assert np.abs(again.astype(int) - pixels).max() <= 8
    assert Image.open(io.BytesIO(small(out.getvalue(), 30))).size == (30, 20)


def test_without_a_chromium_it_says_so_in_a_line(monkeypatch, capsys) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(__main__, "program", lambda: None)
    assert __main__.main(["report.png"]) == 1
    assert capsys.readouterr().err.splitlines() == ["no Chromium, so not made: report.png; apt-get install chromium"]
    assert __main__.main(["nothing.png"]) == 2
    assert capsys.readouterr().err.startswith("no such picture: nothing.png; known: loop.svg")
    assert browser.PROGRAMS
