"""The benches that need nothing but this package run, and a machine without Basilisk gets its figures all the same."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from sil.bench import lockstep, loop, plant
from sil.bench.book import Book, Plan
from sil.bench.children import ChildFailed, cpus
from sil.bench.codec import bare, frames_of_a_tick, ours
from sil.bench.lockstep import ping_pong_us
from sil.bench.series import run_series
from sil.bench.tape import Tape
from sil.cli import app
from sil.sinks.nothing import Nothing


def test_a_ping_pong_ends_with_its_child_gone() -> None:
    """A hung-up terminal reads as an error or as the end of the file; the child must take both as its end."""
    before = children()
    for _ in range(3):
        assert ping_pong_us(79, 150, 20, cpus()[1]) > 0.0
    assert children() == before


@pytest.mark.parametrize("last_words", ["", "!"])
def test_a_ping_pong_ends_when_its_child_dies(last_words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before its first byte or after it. The alarm ends a wait that would be for ever."""

    def too_long(*_: object) -> None:
        raise AssertionError("still waiting for a child that is gone")

    monkeypatch.setattr(lockstep, "CHILD", f"import os, sys; os.write(int(sys.argv[1]), b'{last_words}')")
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(20)
    try:
        with pytest.raises(ChildFailed, match="bare ping-pong: its other end is gone"):
            ping_pong_us(79, 150, 20, cpus()[1])
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def children() -> list[str]:
    """Process ids of this process's children."""
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


@pytest.fixture
def no_basilisk(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "Basilisk"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "Basilisk", None)


@pytest.mark.usefixtures("no_basilisk")
def test_without_basilisk_ours_is_measured_and_the_way_to_get_it_is_said() -> None:
    book = Book("plant")
    plant.measured(book, "free", plant.parameters(False), 10)
    assert (len(book.lines[0].ours), book.lines[0].beside) == (1, [])
    assert book.notes == ["Basilisk is not installed: pip install 'attitude-sil[bench]'"]


@pytest.mark.usefixtures("no_basilisk")
def test_without_basilisk_the_loop_has_no_ratio_to_reach() -> None:
    book = Book("loop")
    assert loop.basilisk_speed(book, 10) is None
    assert len(book.notes) == 1


def test_basilisk_moves_the_same_body_the_same_way() -> None:
    """The comparison is fair only while both end at the same attitude."""
    pytest.importorskip("Basilisk")
    book = Book("plant")
    for case, gravity_gradient in plant.CASES.items():
        plant.measured(book, case, plant.parameters(gravity_gradient), 200)
    assert all(line.beside for line in book.lines)
    assert all(angle < 1e-9 for angle in book.details.values())
    assert book.notes == []


def test_basilisk_flies_its_python_law() -> None:
    pytest.importorskip("Basilisk")
    assert (loop.basilisk_speed(Book("loop"), 10) or 0.0) > 0.0


def test_a_codec_bench_measures_the_frames_of_a_real_tick() -> None:
    packets = frames_of_a_tick()
    assert set(packets) == {"SAMPLE", "COMMAND", "TELEMETRY"}
    for step in (ours, bare):
        step(list(packets.values()))()


def test_a_tape_plays_every_row_in_order() -> None:
    """The recorder bench replays a run's rows: another order or number would be another load."""
    tape, again = Tape(), Tape()
    tape.packet(0, 1, 2, b"abc")
    tape.event(0, 7, 1, 2)
    tape.housekeeping(0, b"de")
    tape.commit(0)
    tape.play(again)
    assert again.rows == tape.rows
    assert again.packets == [b"abc"]
    tape.play(Nothing())


def test_recorder_and_law_have_their_lines_beside_something() -> None:
    books, interrupted = run_series(["recorder", "law"], Plan(1, quick=True))
    assert not interrupted
    assert all(book.finished for book in books), [book.skipped for book in books]
    cases = [[line.case for line in book.lines] for book in books]
    assert cases[0] == ["rows into run.journal", "sealing to run.mcap"]
    assert set(cases[1]) >= {"pd, float", "pd, fixed", "mrac, float", "mrac, fixed", "appc, float", "appc, fixed"}
    assert all(len(line.ours) == len(line.beside) == 1 for book in books for line in book.lines)


def test_the_verb_gives_one_json_object() -> None:
    done = CliRunner().invoke(app, ["bench", "codec", "--quick", "--repeats", "1", "--json"])
    found = json.loads(done.stdout)
    assert set(found) == {"machine", "repeats", "quick", "interrupted", "benches"}
    assert found["benches"]["codec"]["finished"] is True
    assert found["benches"]["codec"]["lines"][0]["beside_what"] == "crc32 and COBS alone"
