"""`stale: reuse` in whole runs: the firmware in C gives the bytes of the Python board, and the log replays."""

from __future__ import annotations

from pathlib import Path

import pytest

from protocol import frames
from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_scenario

LAWS = {"pd": "pd-root-locus", "mrac": "mrac-rs232", "appc": "appc-rs232"}
SETS = ("sensors.attitude.noise_deg=0.02", "require=[]", "clock=lockstep", "duration_s=60")
BUSY = ("answer_delay_s=0.6", "expect_missed=true")  # every second SAMPLE finds the board busy


def fly(folder: Path, law: str, board: str, stale: str) -> str:
    summary = run_scenario(load_scenario(LAWS[law], [*SETS, *BUSY, f"board={board}", f"stale={stale}"]), folder)
    return str(summary["sha256"])


@pytest.mark.parametrize("law", LAWS)
def test_stale_readings_are_reused_alike_and_replayed(tmp_path: Path, law: str) -> None:
    """And it is another run than with `propagate`."""
    python = fly(tmp_path / "python", law, "inproc", "reuse")
    assert fly(tmp_path / "native", law, "native", "reuse") == python
    assert fly(tmp_path / "other", law, "native", "propagate") != python
    report = replay(open_run(tmp_path / "python"), (), "native")
    assert (report.identical, report.ticks, report.config) == (True, 120, [])
    assert (open_run(tmp_path / "python").commands["used"] == frames.REUSED).sum() > 50
