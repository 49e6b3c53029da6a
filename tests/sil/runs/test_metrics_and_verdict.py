"""Metrics from truth and an independent reference; a verdict never passes on a number that is not there."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from synthetic import synthetic_journal

from sil.campaign.records import flat_metrics
from sil.metrics import MISMATCH_LIMIT_deg, as_json, dwell_ticks, judge, measure, settling_s, value_of
from sil.runner import next_run_dir
from sil.runs import Run, open_run
from sil.scenario_metrics import METRICS as METRIC_NAMES
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


# -- effort and settling -----------------------------------------------------------------------------------------------


def responding(attitude_deg: np.ndarray, setpoint_deg: np.ndarray, period_s: float = 0.01) -> Run:
    """What settling_s reads of a run; (N, 3) each."""
    ticks = np.arange(len(attitude_deg))
    fields = {"tick": ticks, "period_s": period_s, "attitude_deg": attitude_deg, "setpoint_deg": setpoint_deg}
    return SimpleNamespace(**fields)  # type: ignore[return-value]


def second_order(t_s: np.ndarray, damping: float, wn: float = 1.0) -> np.ndarray:
    """The unit step response of wn^2 / (s^2 + 2 damping wn s + wn^2), from its closed form."""
    t_s = np.maximum(t_s, 0.0)
    if damping == 1.0:
        return 1 - (1 + wn * t_s) * np.exp(-wn * t_s)
    wd = wn * math.sqrt(1 - damping**2)
    swing = np.cos(wd * t_s) + damping / math.sqrt(1 - damping**2) * np.sin(wd * t_s)
    return 1 - np.exp(-damping * wn * t_s) * swing


def one_step(damping: float, size_deg: float, seconds: float, at_s: float = 1.0) -> Run:
    t_s = np.arange(round((at_s + seconds) / 0.01)) * 0.01
    attitude, setpoint = np.zeros((len(t_s), 3)), np.zeros((len(t_s), 3))
    attitude[:, 1] = size_deg * second_order(t_s - at_s, damping)
    setpoint[t_s >= at_s - 1e-9, 1] = size_deg
    return responding(attitude, setpoint)


@pytest.mark.parametrize("size_deg", [25.0, -60.0])
@pytest.mark.parametrize("damping", [0.2, 0.5, 0.7, 1.0])
def test_settling_is_that_of_the_closed_form(damping: float, size_deg: float) -> None:
    """Within a period of the instant at which |1 - y| is 2 % for the last time, found on a grid 1,000 times finer."""
    run = one_step(damping, size_deg, 60.0)
    fine = np.arange(0.0, 60.0, 1e-5)
    exact = fine[np.flatnonzero(np.abs(1 - second_order(fine, damping)) > 0.02)[-1]]
    assert exact <= settling_s(run, 1) <= exact + 0.011
    assert settling_s(run, 0) is None
    assert settling_s(run, 1, from_tick=101) is None


def test_critical_damping_settles_at_the_textbook_time() -> None:
    """(1 + x) e^-x = 0.02 at x = 5.834."""
    assert settling_s(one_step(1.0, 10.0, 20.0), 1) == pytest.approx(5.84, abs=0.006)


def test_a_small_step_is_not_asked_closer_than_the_floor() -> None:
    """0.5 deg: 2 % would be 0.01 deg; 0.1 deg is 20 %: (1 + x) e^-x = 0.2 at x = 2.994."""
    assert settling_s(one_step(1.0, 0.5, 20.0), 1) == pytest.approx(3.0, abs=0.006)


def test_never_settled_is_infinite_and_meets_no_limit() -> None:
    run = one_step(1.0, 10.0, 5.0)
    assert settling_s(run, 1) == math.inf
    judgement = judge([{"metric": "settling_s.max", "below": 1e9}], {"settling_s": [None, math.inf, None]})[0]
    assert not judgement.passed
    assert judge([{"metric": "settling_s.roll", "below": 1e9}], {"settling_s": [None, 1.0, None]})[0].passed is False


def stepping(changes: dict[int, tuple[float, float, float]], ticks: int) -> Run:
    """A plant that follows each set-point 20 ticks late, at once; period 1 s."""
    setpoint = np.zeros((ticks, 3))
    for tick, value in changes.items():
        setpoint[tick:] = value
    attitude = np.vstack([np.zeros((20, 3)), setpoint[:-20]])
    return responding(attitude, setpoint, 1.0)


def test_the_longest_of_several_steps_counts() -> None:
    run = stepping({100: (10, 0, 0), 200: (-10, 0, 0)}, 300)
    assert settling_s(run, 0) == 20.0
    run.attitude_deg[220:237, 0] = 5.0
    assert settling_s(run, 0) == 37.0
    run.attitude_deg[220:, 0] = math.nan
    assert settling_s(run, 0) == math.inf


def test_another_axis_turn_is_not_settling() -> None:
    """Roll settles after 20 s; the pitch step at 150 s throws it out again for 30 s."""
    run = stepping({100: (10, 0, 0), 150: (10, 30, 0)}, 300)
    run.attitude_deg[150:180, 0] = 12.0
    assert settling_s(run, 0) == 20.0
    assert settling_s(run, 1) == 20.0
    run.attitude_deg[120:180, 0] = 12.0
    assert settling_s(run, 0) == 80.0


def test_passing_through_the_band_is_not_settling() -> None:
    """An oscillation that happens to cross the set-point just before another axis turns has not settled there."""
    run = stepping({100: (10, 0, 0), 150: (10, 30, 0), 200: (10, 0, 0)}, 300)
    run.attitude_deg[100:, 0] = 14.0
    run.attitude_deg[149, 0] = run.attitude_deg[191:200, 0] = 10.0
    assert settling_s(run, 0) == math.inf
    run.attitude_deg[190, 0] = 10.0  # ten ticks: it stayed
    assert settling_s(run, 0) == 90.0
    assert settling_s(run, 0, dwell=11) == math.inf


def test_the_dwell_is_ten_ticks_or_a_time_constant_of_the_reference() -> None:
    of = [SimpleNamespace(period_s=0.5, scenario={"guidance": {"wn_radps": wn}}) for wn in (0.15, 1.0)]
    assert [dwell_ticks(each) for each in of] == [14, 10]  # type: ignore[arg-type]
    assert dwell_ticks(SimpleNamespace(period_s=0.5, scenario={})) == 10  # type: ignore[arg-type]


def test_a_last_step_without_time_to_stay_says_nothing_either() -> None:
    """It came into its band as fast as the others; the run ended before it could show that it stays."""
    assert settling_s(stepping({100: (10, 0, 0), 200: (-10, 0, 0)}, 225), 0) == 20.0


def test_a_step_cut_off_by_the_end_says_nothing_if_it_had_less_time_than_the_others_took() -> None:
    assert settling_s(stepping({100: (10, 0, 0), 200: (-10, 0, 0)}, 215), 0) == 20.0
    assert settling_s(stepping({200: (-10, 0, 0)}, 215), 0) == math.inf


def test_the_start_is_a_step_where_it_counts() -> None:
    run = stepping({}, 100)
    run.attitude_deg[:20] = (10.0, 0.0, 0.05)
    assert [settling_s(run, axis) for axis in range(3)] == [20.0, None, 0.0]
    assert [settling_s(run, axis, from_tick=1) for axis in range(3)] == [None] * 3
    assert settling_s(run, 0, from_tick=1000) is None


def test_the_largest_leaves_out_axes_without_a_step() -> None:
    assert value_of({"settling_s": [None, 3.0, 2.0]}, "settling_s.max") == 3.0
    assert value_of({"settling_s": [None, None, None]}, "settling_s.max") is None
    assert math.isnan(value_of({"rms_error_deg": [0.1, math.nan, 0.2]}, "rms_error_deg.max") or 0.0)


def test_one_axis_that_never_settled_makes_the_largest_infinite_in_json_too() -> None:
    """JSON has null for an axis without a step and for one that never settled; the names tell them apart."""
    metrics = {"settling_s": [None, math.inf, 2.0], "missed": 0}
    read = json.loads(json.dumps(as_json(metrics), allow_nan=False))
    assert read == {"settling_s": [None, None, 2.0], "missed": 0, "never_settled": ["pitch"]}
    for each in (metrics, read):
        values = [value_of(each, f"settling_s.{part}") for part in ("roll", "pitch", "yaw", "max")]
        assert values == [None, math.inf, 2.0, math.inf]
    with pytest.raises(ValueError, match="expected one of settling_s, missed, got 'never_settled'"):
        value_of(read, "never_settled")


def test_a_judgement_says_why_there_is_no_number() -> None:
    metrics = {"settling_s": [None, math.inf, 2.0], "rms_error_deg": [math.nan] * 3, "diverged_at_s": None}
    names = ("settling_s.roll", "settling_s.max", "settling_s.yaw", "rms_error_deg.max", "diverged_at_s")
    found = judge([{"metric": name, "below": 9.0} for name in names], metrics)
    assert [each.reason for each in found] == ["no step", "never", "", "not a number", "never"]


def test_effort_is_the_integral_of_the_torque_that_acted(run: Run) -> None:
    metrics = measure(run)
    assert metrics["effort_Nms"] == pytest.approx((np.abs(run.applied_Nm[20:]).sum(axis=0) * 0.5).tolist())
    assert run.applied_Nm[20:].min() < 0  # else a plain sum would do


def test_residual_looks_at_the_end_of_the_run_only(run: Run) -> None:
    """rms over the last metrics.last_s, by default 20 s: what is left when all transients are over."""
    metrics = measure(run)
    assert metrics["residual_error_deg"] == pytest.approx(np.sqrt((run.error_deg[-40:] ** 2).mean(axis=0)).tolist())
    assert metrics["residual_torque_Nm"] == pytest.approx(np.sqrt((run.applied_Nm[-40:] ** 2).mean(axis=0)).tolist())
    assert metrics["residual_error_deg"] != metrics["rms_error_deg"]


def test_three_axes_in_one_number() -> None:
    metrics = {"rms_error_deg": [1.0, 2.0, 2.0], "effort_Nms": [0.5, 0.25, 0.125]}
    assert value_of(metrics, "rms_error_deg.all") == math.sqrt(3.0)  # sqrt of the mean of 1, 4, 4
    assert value_of(metrics, "effort_Nms.total") == 0.875
    assert math.isnan(value_of({"rms_error_deg": [1.0, math.nan, 2.0]}, "rms_error_deg.all") or 0.0)
    with pytest.raises(ValueError, match=r"expected effort_Nms\.x, \.y, \.z, \.max or \.total, got 'effort_Nms\.all'"):
        value_of(metrics, "effort_Nms.all")


def test_a_requirement_may_name_every_metric(run: Run) -> None:
    """A metric that measure() knows and the scenario refuses could never be required."""
    assert set(measure(run)) - {"from_tick"} <= set(METRIC_NAMES)


def test_a_sweep_leaves_the_names_of_axes_out_of_its_columns() -> None:
    columns = flat_metrics(as_json({"settling_s": [1.0, math.inf, 2.0], "missed": 0}))
    assert set(columns) == {"settling_s.roll", "settling_s.pitch", "settling_s.yaw", "settling_s.max", "missed"}


def test_the_next_run_directory_counts_numbers_only(tmp_path: Path) -> None:
    """A superscript is a digit to str.isdigit, and none to int; it must not end in a traceback."""
    for name in ("x-007", "x-\u00b2", "x-old", "x-\u0664\u0662"):
        (tmp_path / name).mkdir()
    assert next_run_dir(tmp_path, "x") == tmp_path / "x-008"
