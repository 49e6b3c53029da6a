"""Only whole runs are measured: a repeat whose run was cut short has no figures, is noted, and the next one is made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from sil.bench import fast, flights, loop, wakeup
from sil.bench.book import Book, Goal, Plan
from sil.bench.children import ChildFailed, Said
from sil.bench.shown import goals_text

WHOLE = {"reason": "finished", "failure": "", "ticks": 4, "link": {"missed": 0, "real_misses": 0}}
TIMING = {"answer_us": {"p99": 1.0, "max": 2.0}, "granted": None}
CUT_SHORT = {"reason": "failed", "failure": "board: ended by signal 9", "ticks": 2}


class Still:
    """A waker that is never late."""

    name = "cyclictest"

    def lateness_us(self, interval_us: int, count: int, priority: int, cpu: int) -> list[float]:
        return [1.0] * count


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """How each `sil run` ends, the next one first; the last one stands for all that follow."""
    endings: list[dict[str, Any]] = []

    def run_child(command: list[str], *_: object) -> Said:
        ending = endings.pop(0) if len(endings) > 1 else endings[0]
        folder = Path(command[command.index("--out") + 1])
        folder.mkdir(parents=True)
        (folder / "summary.json").write_text(json.dumps({**WHOLE, "timing": TIMING, **ending}), encoding="utf-8")
        return Said("", "", 0)

    monkeypatch.setattr(flights, "run_child", run_child)
    monkeypatch.setattr(flights, "lateness_us", lambda file: [1.0] * 4)
    for bench in (fast, wakeup):
        monkeypatch.setattr(bench, "find_waker", Still)
        monkeypatch.setattr(bench, "priorities", lambda: (0,))
    return endings


@pytest.mark.parametrize(
    ("ending", "said"),
    [
        (CUT_SHORT, "sil run: expected it to finish, got failed after 2 ticks: board: ended by signal 9"),
        ({"reason": "diverged", "ticks": 3}, "sil run: expected it to finish, got diverged after 3 ticks"),
        ({"failure": "run.journal: disk full"}, "got finished after 4 ticks: run.journal: disk full"),
    ],
)
def test_a_run_cut_short_is_no_measurement(
    ends: list[dict[str, Any]], tmp_path: Path, ending: dict[str, Any], said: str
) -> None:
    ends.append(ending)
    with pytest.raises(ChildFailed, match=f"{said}$"):
        flights.paced(tmp_path / "file", tmp_path / "run", [], 1.0)


def test_a_run_of_this_process_counts_only_when_whole(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    endings = [{**WHOLE}, CUT_SHORT, {**WHOLE, "reason": "interrupted"}]
    monkeypatch.setattr(flights, "run_scenario", lambda of, folder: endings.pop(0))
    of = flights.scenario("pd")
    assert flights.recorded(of, tmp_path) == WHOLE
    with pytest.raises(ChildFailed):
        flights.recorded(of, tmp_path)
    with pytest.raises(KeyboardInterrupt):
        flights.recorded(of, tmp_path)


def test_both_ways_to_a_deadline_are_judged_and_named(ends: list[dict[str, Any]]) -> None:
    """cyclictest sleeps; a goal met only by a run that does not would say nothing about wake-ups."""
    ends.append({})
    book = Book("wakeup")
    wakeup.Wakeup().measure(Plan(1, quick=True), book)
    judged = {line.case: line.goal for line in book.lines if line.met is not None}
    goal = Goal(wakeup.RATIO_P99)
    assert judged == {
        "100 Hz ordinary last 100 us not slept, p99": goal,
        "100 Hz ordinary asleep, p99": goal,
        "1000 Hz ordinary last 100 us not slept, p99": goal,
        "1000 Hz ordinary asleep, p99": goal,
    }
    assert goals_text([book]) == "goals: 4 of 4 met"
    assert "last 100 us not slept" in wakeup.Wakeup.about


@pytest.mark.parametrize("compared", [False, True])
def test_the_loops_goal_of_its_own_stands_with_and_without_basilisk(
    compared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten times Basilisk and not 5000 times real time: both must be seen."""
    monkeypatch.setattr(loop, "basilisk_speed", lambda *_: 400.0 if compared else None)
    monkeypatch.setattr(flights, "recorded", lambda *_: {"timing": {"times_real_time": 500.0}})
    monkeypatch.setattr(flights, "unrecorded", lambda of, _: (4000, of.period_s))
    book = Book("loop")
    loop.WholeLoop().measure(Plan(2, quick=True), book)
    goals = [(line.goal.text(), line.met) for line in book.lines if line.goal and "pd float" in line.case]
    assert goals == [(">= 5", True)] * compared + [("sil >= 5000", False)]
    assert all(len(line.ours) == 2 for line in book.lines)


@pytest.mark.parametrize("bench", [fast.FastLoop(), wakeup.Wakeup()], ids=["fast", "wakeup"])
def test_a_repeat_that_failed_is_noted_and_the_next_one_is_measured(
    ends: list[dict[str, Any]], bench: fast.FastLoop | wakeup.Wakeup
) -> None:
    """Without a figure of its own: a run that dies at once has missed nothing, which would be a goal met."""
    ends += [CUT_SHORT, {}]
    book = Book("bench")
    bench.measure(Plan(2, quick=True), book)
    (note,) = (note for note in book.notes if "sil run" in note)
    assert "repeat 1 of 2, left out: sil run: expected it to finish, got failed after 2 ticks" in note
    assert {len(line.ours) for line in book.lines} == ({1} if isinstance(bench, fast.FastLoop) else {1, 2})
