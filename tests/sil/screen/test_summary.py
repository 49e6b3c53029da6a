"""The summary on stdout: what it says at each verbosity, and of paced runs only."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from sil.screen import QUIET, VERBOSE, show_summary

LOCKSTEP: dict[str, Any] = {
    "verdict": "passed", "exit_code": 0, "failure": "", "scenario": "name", "board": "process", "reason": "finished",
    "ticks": 1200, "duration_s": 600.0, "metrics": {"rms_error_deg": [0.1, 0.2, 0.3]}, "not_a_number": 0,
    "require": [{"requirement": "missed < 1", "passed": True, "value": 0}],
    "link": {"missed": 0, "late": 0, "strays": 0, "sequence_gaps": 2},
    "timing": {"wall_s": 0.25, "start_s": 1.0, "seal_s": 0.5, "times_real_time": 2400.0,
               "wakeup_us": dict.fromkeys(("p50", "p99", "p99_9", "max")), "late_ticks": 0,
               "answer_us": {"p50": 100.0, "p99": 200.0, "p99_9": 300.0, "max": 400.0}},
    "reproducible": True, "sha256": "0123456789abcdef0123", "law_file": "", "run_dir": "runs/[name]-001",
}  # fmt: skip


def paced(**changes: Any) -> dict[str, Any]:
    made = copy.deepcopy(LOCKSTEP)
    made["timing"] |= {
        "wakeup_us": {"p50": 60.0, "p99": 120.0, "p99_9": 300.0, "max": 31_000.0},
        "late_beyond_ms": 25.0,
        "causes": {"late_ticks": {"machine": 3, "own_work": 1, "log_write": 0}, "latest_percent": {"machine": 12}},
        "wakeup_histogram": {"edges_us": [50, 100, 1000, 20000], "counts": [0, 1000, 198, 0, 2]},
        "granted": {"priority": 50, "refused": ["clock.lock_memory: [refused]"]},
    }
    made["timing"] |= changes
    return made


def shown(capsys: pytest.CaptureFixture[str], summary: dict[str, Any], verbosity: int = 0) -> str:
    show_summary(summary, verbosity)
    return capsys.readouterr().out


def test_quiet_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    """Protects: -q says the verdict and where the run lies, and no more."""
    assert shown(capsys, LOCKSTEP, QUIET) == "passed  name: runs/[name]-001\n"


def test_lockstep_has_no_lateness(capsys: pytest.CaptureFixture[str]) -> None:
    """Protects: the summary of a run without a clock has no line about one, and the run's path is as it is."""
    text = shown(capsys, LOCKSTEP)
    assert "late by" not in text and "run: runs/[name]-001   sha256 0123456789abcdef\n" in text
    assert "link: missed 0, late 0, sequence gaps 2\n" in text


def test_paced_says_how_late_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    """Protects: percentiles of the lateness, and the causes of late ticks, most frequent first."""
    text = shown(capsys, paced(late_ticks=4))
    assert "wake-ups late by: p50 60 us, p99 120 us, p99.9 300 us, at most 31 ms\n" in text
    assert "late ticks: 4 of 1200 ticks woke more than 25 ms late: machine 3, own work 1\n" in text
    assert "━" not in text


def test_verbose_has_the_histogram_and_what_was_granted(capsys: pytest.CaptureFixture[str]) -> None:
    """Protects: -v shows every class that was filled and those between, and what the machine refused, as it said it."""
    text = shown(capsys, paced(), VERBOSE)
    lines = [line.split() for line in text.splitlines()]
    assert ["up", "to", "100", "us", "1000", "━" * 40] in lines
    assert ["up", "to", "20", "ms", "0"] in lines and ["beyond", "20", "ms", "2", "━"] in lines
    assert "priority: SCHED_FIFO 50" in text and "refused: clock.lock_memory: [refused]" in text
    assert "up to 50 us" not in text


@pytest.mark.parametrize(
    ("us", "text"), [(0.34, "0.34 us"), (999.4, "999 us"), (999.6, "1 ms"), (999_600, "1 s"), (5.03e6, "5.03 s")]
)
def test_a_time_in_the_unit_that_suits_it(us: float, text: str) -> None:
    from sil.screen.summary import _duration

    assert _duration(us) == text
