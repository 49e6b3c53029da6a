"""Paper 000, experiment 3, closed over a pty with the fixed-point law in a process of its own; replayed identically."""

from __future__ import annotations

from pathlib import Path

from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_scenario


def test_experiment_3_over_a_pty_in_fixed_point(tmp_path: Path) -> None:
    """FVSC at 0.1 s, angle and rate half a second late: it holds the satellite, and the log replays bit for bit."""
    scenario = load_scenario("delay-large", ["variant=fvsc_wire", "sensors.sampling.delay_s=0.5"])
    assert (scenario.law.form, scenario.board, scenario.link.url, scenario.period_s) == ("fixed", "process", "pty", 0.1)
    summary = run_scenario(scenario, tmp_path / "run")
    assert summary["exit_code"] == 0 and summary["metrics"]["missed"] == 0
    assert max(summary["metrics"]["rms_error_deg"]) < 2.0
    outcome = replay(open_run(tmp_path / "run"))
    assert outcome.identical
