"""Metrics from truth and an independent reference; a verdict never passes on a number that is not there."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from synthetic import synthetic_journal

from sil.metrics import MISMATCH_LIMIT_deg, judge, measure, value_of
from sil.runs import Run, open_run
from sil.sinks.seal import seal


def made(folder: Path, **options: object) -> Run:
    seal(synthetic_journal(folder, **options))  # type: ignore[arg-type]
    return open_run(folder)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return made(tmp_path_factory.mktemp("metrics") / "a", lose=(30,), late=(50,))


def test_figures_count_from_their_tick(run: Run) -> None:
    metrics = measure(run)
    error = run.error_deg[20:]
    assert metrics["from_tick"] == 20
    assert metrics["rms_error_deg"] == pytest.approx(np.sqrt((error**2).mean(axis=0)).tolist())
    assert metrics["peak_error_deg"] == np.abs(error).max(axis=0).tolist()
    assert metrics["peak_torque_Nm"] == np.abs(run.applied_Nm[20:]).max(axis=0).tolist()
    assert metrics["rms_setpoint_error_deg"][0] > metrics["rms_error_deg"][0]
    assert metrics["diverged_at_s"] is None
    assert (metrics["late"], metrics["missed"], metrics["overruns"]) == (1, 0, 0)


def test_mismatch_is_the_wires_rounding(run: Run) -> None:
    assert 0 < measure(run)["reference_mismatch_deg"] <= 360 / 2**32


@pytest.mark.parametrize("every", [2, 7, 64])
def test_sparse_telemetry_is_enough(tmp_path: Path, every: int) -> None:
    run = made(tmp_path / "a", telemetry_every=every)
    assert np.isfinite(run["reference_x"]).sum() == -(-200 // every)
    assert measure(run)["reference_mismatch_deg"] < MISMATCH_LIMIT_deg
    assert np.isfinite(run.reference_deg).all()


def test_a_board_that_computes_another_reference_fails(run: Run) -> None:
    """The mismatch is a requirement whether the scenario asks for it or not."""
    telemetry = dict(run.telemetry)
    run.telemetry["reference_y"] = telemetry["reference_y"] + 3e-5 * (run.tick > 100)
    metrics = measure(run)
    run.telemetry["reference_y"] = telemetry["reference_y"]
    assert metrics["reference_mismatch_deg"] == pytest.approx(3e-5, rel=0.01)
    judgement = judge([], metrics)[0]
    assert (judgement.metric, judgement.passed) == ("reference_mismatch_deg", False)
    assert judgement.margin == pytest.approx(-2e-5, rel=0.01)


def test_divergence_is_the_first_bad_tick(tmp_path: Path) -> None:
    run = made(tmp_path / "a", ticks=50)
    run["attitude_deg"]  # columns are read-only views: replace the column
    angles = run.attitude_deg.copy()
    angles[17, 1] = -80.1
    angles[30, 2] = math.nan
    run._columns["attitude_deg"] = angles
    assert measure(run)["diverged_at_s"] == 8.5
    angles[17, 1] = -79.9
    assert measure(run)["diverged_at_s"] == 15.0
    assert math.isnan(measure(run)["rms_error_deg"][2])


METRICS = {"rms_error_deg": [0.1, 0.2, math.nan], "diverged_at_s": None, "missed": 3, "peak_torque_Nm": [0.1, 0.3, 0.2]}


@pytest.mark.parametrize(
    ("line", "passed", "margin"),
    [
        ({"metric": "rms_error_deg.roll", "below": 0.5}, True, 0.4),
        ({"metric": "rms_error_deg.x", "below": 0.1}, False, 0.0),
        ({"metric": "rms_error_deg.yaw", "below": 0.5}, False, None),
        ({"metric": "rms_error_deg.max", "below": 0.5}, False, None),
        ({"metric": "peak_torque_Nm.max", "above": 0.29}, True, 0.01),
        ({"metric": "diverged_at_s", "between": [24, 36]}, False, None),
        ({"metric": "missed", "between": [3, 4]}, True, 0.0),
        ({"metric": "missed", "above": 3}, False, 0.0),
    ],
)
def test_judgement(line: dict[str, object], passed: bool, margin: float | None) -> None:
    for form in (line, SimpleNamespace(**line)):
        judgement = judge([form], METRICS)[0]
        assert judgement.passed is passed
        assert judgement.margin == (None if margin is None else pytest.approx(margin))


def test_unknown_metrics_are_errors() -> None:
    with pytest.raises(ValueError, match="expected one of rms_error_deg, "):
        value_of(METRICS, "rms_eror_deg.roll")
    with pytest.raises(ValueError, match=r"rms_error_deg\.roll, \.pitch"):
        value_of(METRICS, "rms_error_deg")
    with pytest.raises(ValueError, match="expected below, above or between"):
        judge([{"metric": "missed"}], METRICS)
