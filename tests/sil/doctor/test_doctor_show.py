"""How findings look: folded to the terminal, commands and bytes never broken, plain lines for a pipe."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from sil.doctor import NOTE, PROBLEM, Finding
from sil.doctor.overheard import rows
from sil.doctor.show import NAME_COLUMN, STATUS_COLUMN, Page

LONG = (
    "a sentence that goes on for quite a while, about what was found and where, until it does not fit any more at all"
)
COMMAND = 'echo \'ACTION=="add", SUBSYSTEM=="usb-serial"\' | sudo tee -a /etc/udev/rules.d/99-attitude-sil.rules'
FINDING = Finding(PROBLEM, LONG, LONG, (COMMAND,), (LONG,), check="latency timer", raw=rows(bytes(range(0x30, 0x70))))


def shown(width: int, terminal: bool) -> list[str]:
    page = Page()
    page._console = Console(
        file=io.StringIO(), width=width, force_terminal=terminal, color_system=None, highlight=False, soft_wrap=True
    )
    page._width = width if terminal else 0
    page.show(FINDING)
    assert isinstance(page._console.file, io.StringIO)
    return page._console.file.getvalue().splitlines()


@pytest.mark.parametrize("width", [80, 160])
def test_prose_is_folded_and_commands_and_bytes_are_not(width: int) -> None:
    lines = shown(width, terminal=True)
    assert [line for line in lines if COMMAND in line]
    assert all(len(line) <= width for line in lines if COMMAND not in line)
    assert sum(row in line for row in FINDING.raw for line in lines) == len(FINDING.raw)
    assert lines[0].startswith("problem  latency timer a sentence")
    assert all(
        line[: STATUS_COLUMN + NAME_COLUMN].isspace() for line in lines[1:] if "|" not in line and COMMAND not in line
    )


def test_a_pipe_gets_whole_lines() -> None:
    lines = shown(80, terminal=False)
    assert lines[0] == f"problem  latency timer {LONG}"
    assert lines[1].strip(" →>") == LONG
    assert len(lines) == 2 + 1 + len(FINDING.raw) + 1


def test_the_last_line_counts(capsys: pytest.CaptureFixture[str]) -> None:
    Page().summary([FINDING, FINDING._replace(status=NOTE)], "/dev/ttyUSB0")
    assert capsys.readouterr().out == "\n/dev/ttyUSB0: 1 problem, 1 note, 0 ok\n"


def test_json_holds_everything() -> None:
    assert list(FINDING.as_dict()) == ["check", "status", "found", "advice", "commands", "lines", "raw", "data"]


def test_an_output_that_takes_ascii_only_gets_ascii() -> None:
    page = Page()
    page._encoding = "ascii"
    assert page._writable(("▁█ → µs", "x")) == (".# > ?s", "x")
    assert page._writable({"any": "thing"}) == {"any": "thing"}
