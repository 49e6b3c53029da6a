"""The watch that is chosen, and what its lines say."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import made
import pytest

from protocol import events
from sil.scenario import load_scenario
from sil.screen import NORMAL, QUIET, VERBOSE, messages, new_watch, watch
from sil.watch import Watch


@pytest.fixture
def lines(capsys: pytest.CaptureFixture[str]) -> Any:
    """Plain lines of a run that is plugged in and runs; call it for what came on stderr."""

    def start(verbosity: int) -> Any:
        made_watch = watch.Lines("name", verbosity)
        made_watch.plugged(load_scenario("rigid-open-loop"), made.rig(board=False))
        made_watch.stage("run")
        return made_watch, lambda: capsys.readouterr().err.splitlines()

    return start


def test_what_is_no_terminal_gets_lines() -> None:
    """Protects: no cursor movements in files and pipes; --json and -q are as silent as they say."""
    assert type(new_watch("name")) is watch.Lines
    assert type(new_watch("name", as_json=True)) is watch.Silent
    assert type(new_watch("name", QUIET)) is type(new_watch("name", QUIET, as_json=True)) is Watch


def test_quiet_says_nothing_at_all(capsys: pytest.CaptureFixture[str]) -> None:
    """Protects: -q."""
    quiet = new_watch("name", QUIET)
    quiet.note("a note")
    quiet.event(0, events.PLANT_NAN, 0, 0)
    assert capsys.readouterr() == ("", "")


def test_the_first_warnings_have_lines_and_the_others_a_number(lines: Any) -> None:
    """Protects: a file with the output of a run that misses every tick is still readable, and hides nothing."""
    made_watch, said = lines(NORMAL)
    for k in range(100):
        made_watch.event(k, events.COMMAND_MISSED, k, k, 0)
        made_watch.event(k, events.REFERENCE_RESTART, 7, 1, 1)
    made_watch.stage("seal")
    told = said()
    assert len(told) == watch.TOLD_EACH + 1
    assert told[0].strip().startswith("0.000 s  laboratory: COMMAND_MISSED: no command in time")
    assert told[-1] == f"more events: COMMAND_MISSED {100 - watch.TOLD_EACH}"


def test_verbose_tells_every_event_and_the_facts(lines: Any) -> None:
    """Protects: -v leaves nothing out."""
    made_watch, said = lines(VERBOSE)
    for k in range(20):
        made_watch.event(k, events.REFERENCE_RESTART, 7, 1, 1)
    told = said()
    assert sum("board: REFERENCE_RESTART" in line for line in told) == 20
    assert any(line.startswith("clock: lockstep, period 500 ms") for line in told)


def test_a_line_of_progress(lines: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: a pipe sees where a long run is."""
    monkeypatch.setattr(watch, "PLAIN_EVERY_S", 0.0)
    made_watch, said = lines(NORMAL)
    made_watch.tick(599, 1200, made.motion(10))
    (line,) = said()
    assert line.startswith("name:  50 %  t    299.5 s   attitude   10.00    0.00    0.00 deg")


@contextmanager
def nobody_reads_stderr(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Standard error is a pipe, and it is full; yields the end that could be read."""
    reading, writing = os.pipe()
    while select.select([], [writing], [], 0)[1]:
        os.write(writing, b"x" * 4096)
    with os.fdopen(writing, "w") as file, monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", file)
        yield reading
    os.close(reading)


def test_a_paced_run_does_not_wait_for_who_reads_its_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: `sil run ... 2>&1 | less` in real time. Fails by hanging."""
    with nobody_reads_stderr(monkeypatch) as pipe:
        made_watch = watch.Lines("name", NORMAL)
        made_watch.plugged(load_scenario("rigid-open-loop"), made.rig(board=False, paced=True))
        made_watch.stage("run")
        made_watch.event(1, events.COMMAND_MISSED, 1, 1)
        made_watch.stage("seal")
        made_watch.note("sealing the log")
        os.read(pipe, 1 << 20)
        made_watch.note("read again")
        assert os.read(pipe, 1 << 20) == b"read again\n"


def test_what_no_queue_takes_is_counted_and_not_told_again() -> None:
    """Protects: one message that is too long does not end the view for good, each later one being longer still."""
    painter = watch.Painter(os.sched_getaffinity(0), wait=False)
    try:
        assert painter.tell(messages.Line("x" * messages.BIGGEST))
        assert painter.too_long == 1
        assert painter.tell(made.plan())
        assert painter.tell(messages.Line("x" * 300_000)), "more than a socket takes that asks for nothing"
        assert painter.too_long == 1
    finally:
        painter.kill()


def test_what_was_too_long_is_said_at_the_end(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Protects: a view that lacks something says so."""
    monkeypatch.setattr(watch, "Painter", TooLong)
    view = watch.Live("name", NORMAL)
    view.plugged(load_scenario("rigid-open-loop"), made.rig(board=False, paced=True))
    view.stage("seal")
    assert capsys.readouterr().err == "3 changes of the view were too long to be shown\n"


class TooLong:
    """A painter whose every message is too long."""

    too_long = 3

    def __init__(self, cpus: set[int], wait: bool) -> None:
        pass

    def tell(self, message: messages.Message) -> bool:
        return True

    def close(self) -> None:
        pass


def test_an_unreadable_path_is_no_terminal(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Protects: stderr that is a file, or closed."""
    with open(tmp_path / "log", "w") as file:
        monkeypatch.setattr(sys, "stderr", file)
        assert not watch.can_show_a_view()
    assert not watch.can_show_a_view()
