"""What wakes up beside us: cyclictest's report is read right, and a machine without cyclictest or compiler says so."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.bench import wakers
from sil.bench.book import Book, Plan
from sil.bench.series import Unavailable
from sil.bench.wakers import Cyclictest, Sleeper, find_waker, of_histogram, percentiles
from sil.bench.wakeup import Wakeup, clock_keys, enter, pool, scenario_file
from sil.scenario import load_scenario


def report(counts: dict[int, int], cycles: int, latest: int) -> str:
    """As `cyclictest --json` writes it."""
    histogram = {str(us): count for us, count in counts.items()}
    return json.dumps({"num_threads": 1, "thread": {"0": {"histogram": histogram, "cycles": cycles, "max": latest}}})


@given(st.dictionaries(st.integers(0, 500), st.integers(1, 20), min_size=1))
def test_a_histogram_is_its_wakeups(counts: dict[int, int]) -> None:
    total = sum(counts.values())
    found = of_histogram(report(counts, total, max(counts)))
    assert found == sorted(float(us) for us, count in counts.items() for _ in range(count))


def test_wakeups_beyond_the_histogram_are_as_late_as_the_latest() -> None:
    """They are the ones that matter, and cyclictest leaves them out of the histogram."""
    assert of_histogram(report({10: 2}, 4, 2_000_000)) == [10.0, 10.0, 2_000_000.0, 2_000_000.0]


def test_percentiles_have_their_names() -> None:
    assert percentiles([float(k) for k in range(1001)]) == {"p50": 500.0, "p99": 990.0, "p99.9": 999.0, "max": 1000.0}


def test_cyclictest_comes_first_then_the_compiler_then_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    here = {"cyclictest": "/usr/bin/cyclictest", "cc": "/usr/bin/cc"}
    monkeypatch.setattr(shutil, "which", here.get)
    monkeypatch.setattr(wakers, "Sleeper", lambda compiler: compiler)
    assert isinstance(find_waker(), Cyclictest)
    del here["cyclictest"]
    assert str(find_waker()) == "/usr/bin/cc"
    del here["cc"]
    with pytest.raises(Unavailable, match="apt-get install rt-tests"):
        find_waker()


def test_without_either_the_bench_is_skipped_with_that_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(Unavailable, match=r"neither cyclictest .* nor a C compiler"):
        Wakeup().measure(Plan(1, quick=True), Book("wakeup"))


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_c_loop_wakes_up_as_often_as_asked_and_never_early() -> None:
    found = Sleeper(shutil.which("cc") or "").lateness_us(1000, 25, 0, -1)
    assert len(found) == 25
    assert all(late >= 0 for late in found)


def test_a_round_has_a_line_per_percentile_and_a_goal_for_p99() -> None:
    book = Book("wakeup")
    for _ in range(2):
        enter(book, "100 Hz ordinary", "cyclictest", [1.0, 2.0, 3.0], [2.0, 2.0, 2.0], judged=True)
        pool(book, "100 Hz ordinary, cyclictest", [2.0, 2.0, 2.0])
    assert [line.case for line in book.lines] == [f"100 Hz ordinary, {name}" for name in ("p50", "p99", "p99.9", "max")]
    assert [line.met for line in book.lines] == [None, True, None, None]
    pooled = book.details["all repeats together, us"]
    assert {name: entry["wakeups"] for name, entry in pooled.items()} == {
        "100 Hz ordinary, sil": 6,
        "100 Hz ordinary, cyclictest": 6,
    }


@pytest.mark.parametrize("priority", [0, 50])
def test_the_scenario_that_is_flown_is_valid_and_lasts_as_long_as_it_should(tmp_path: Path, priority: int) -> None:
    file = scenario_file(tmp_path / "here", 0.01, 1234)
    scenario = load_scenario(str(file), clock_keys("scaled:10", priority, 0, 0))
    assert (scenario.ticks, scenario.period_ns, scenario.law.name) == (1234, 10_000_000, "pd")
    assert (scenario.link.url, scenario.link.baud, scenario.telemetry_every) == ("pty", None, 10)
    assert (scenario.clock.mode, scenario.clock.priority) == ("scaled:10", priority or None)
