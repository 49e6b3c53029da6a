"""Figures of merit of a run, and the verdict on its requirements. All of it from the log, none of it from a clock.

Errors are attitude - reference (recomputed in float64 apart from the board, sil.reference) and attitude - set-point,
both from truth, modulo a turn, from tick `metrics.from_tick` on. Ticks whose reference nobody knows are left out: those
from the start of the run, or of a session, to the first TELEMETRY that comes of it. A three-number metric is
[roll, pitch, yaw]; NaN anywhere in its rows makes it NaN, and NaN meets no requirement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from protocol import events
from sil.plain import plain
from sil.runs import Array, Run, wrapped_deg
from sil.scenario_metrics import ALL, METRICS, TOTAL
from sil.sinks.journal import Fate

DIVERGED_deg = 80.0  # the scenario's metrics.diverged_deg says otherwise
LAST_s = 20.0  # the scenario's metrics.last_s says otherwise
MISMATCH_LIMIT_deg = 1e-5  # board's reference against ours: 100 times the LSB of an angle on the wire
SETTLED_FRACTION, SETTLED_FLOOR_deg = 0.02, 0.1  # settled: within 2 % of the step; never asked closer than this
AXIS_NAMES = ("roll", "pitch", "yaw")
OF_THREE: dict[str, Callable[[Array], float]] = {
    "max": np.max,
    ALL: lambda values: float(np.sqrt(np.mean(np.square(values)))),
    TOTAL: np.sum,
}
PARTS = {"roll": 0, "x": 0, "pitch": 1, "y": 1, "yaw": 2, "z": 2}
MISMATCH = "reference_mismatch_deg"
SETTLING, NEVER_SETTLED = "settling_s", "never_settled"
DWELL_ticks = 10  # settled: inside the band for that long at least, and for a time constant of the reference


class Judgement(NamedTuple):
    """One requirement and what became of it; margin is the distance to the nearest bound, negative when it failed."""

    metric: str
    requirement: str  # such as "rms_error_deg.roll < 0.5"
    value: float | None  # None: there is none, see reason
    passed: bool
    margin: float | None
    reason: str = ""  # why there is no finite value: never, no step, none, not a number


def measure(run: Run) -> dict[str, Any]:
    """All metrics of a run by name.

    Three numbers each: rms_error_deg, rms_setpoint_error_deg, peak_error_deg, peak_torque_Nm, rms_torque_Nm (applied
    torque on the body), peak_momentum_Nms, effort_Nms (integral of |applied torque| dt), settling_s (see settling_s),
    and residual_error_deg, residual_torque_Nm: rms over the last metrics.last_s (default 20 s) of the run.
    One number: diverged_at_s (first tick with an angle beyond metrics.diverged_deg, default 80 deg, or not a number;
    None: never), reference_mismatch_deg (largest difference between the board's reference and ours; None: the board
    reported none), and the counts missed, late, overruns, restarts.
    """
    settings = run.scenario.get("metrics") or {}
    first = int(settings.get("from_tick") or 0)
    rows = run.tick >= first
    error = run.error_deg[rows & np.isfinite(run.reference_deg).all(axis=1)]
    if not np.isfinite(run.reference_deg).any():
        error = run.setpoint_error_deg[rows]  # no reference model in this run: the set-point is the reference
    torque, dwell = run.applied_Nm[rows], dwell_ticks(run)
    last = max(1, round(float(settings.get("last_s") or LAST_s) / run.period_s))  # rows
    return {
        "from_tick": first,
        "rms_error_deg": _rms(error),
        "rms_setpoint_error_deg": _rms(run.setpoint_error_deg[rows]),
        "residual_error_deg": _rms(error[-last:]),
        "peak_error_deg": _peak(error),
        "peak_torque_Nm": _peak(torque),
        "rms_torque_Nm": _rms(torque),
        "residual_torque_Nm": _rms(torque[-last:]),
        "peak_momentum_Nms": _peak(run.momentum_Nms[rows]),
        "effort_Nms": _effort(torque, run.period_s),
        SETTLING: [settling_s(run, axis, first, dwell) for axis in range(3)],
        "diverged_at_s": diverged_at_s(run, settings.get("diverged_deg", DIVERGED_deg)),
        MISMATCH: reference_mismatch_deg(run),
        **_counts(run),
    }


def diverged_at_s(run: Run, beyond_deg: float | None = DIVERGED_deg) -> float | None:
    """Time of the first tick with an angle beyond `beyond_deg` (None: no limit) or not a number; None: never."""
    angles = run.attitude_deg
    bad = ~np.isfinite(angles).all(axis=1)
    if beyond_deg is not None:
        bad |= (np.abs(angles) > beyond_deg).any(axis=1)
    return float(run.t_s[np.argmax(bad)]) if bad.any() else None


def dwell_ticks(run: Run) -> int:
    """How long an axis has to stay in its band to have settled: DWELL_ticks, or 1/wn of the reference if longer.

    wn is guidance.wn_radps. A law without a reference model has to follow the same set-points, so it counts there too.
    """
    wn_radps = float((run.scenario.get("guidance") or {}).get("wn_radps") or math.inf)
    return max(DWELL_ticks, math.ceil(1.0 / (wn_radps * run.period_s)))


def settling_s(run: Run, axis: int, from_tick: int = 0, dwell: int = DWELL_ticks) -> float | None:
    """How long one axis (0 roll, 1 pitch, 2 yaw) takes to settle after its set-point changed, s; the longest of all.

    A change at tick k >= from_tick is a step of size s = |new - old|. What follows, up to the axis' own next change or
    the end of the run, is cut into stretches by the changes of the other axes. The axis settles at tick j, if

    - |attitude - set-point| is within max(2 % of s, 0.1 deg) at every tick from j to the end of j's stretch, and
    - that is at least `dwell` ticks long, so that passing through the band is not taken for staying in it,

    and the first such j counts, from k, in whole periods. A step of another axis may so push this one out of its band
    again: that is coupling, not settling. And if it was not settled before that, it may settle in a later stretch.
    With from_tick 0 the start of the run is a step from the attitude it starts at.

    None: the axis has no step. Infinite (null in JSON, the axis in never_settled): it did not settle after one of them;
    no limit from above is met then. A last step that the end of the run left fewer ticks than the slowest of the others
    took, with its dwell, says nothing, and is left out if it did not settle.
    """
    start = int(np.searchsorted(run.tick, from_tick))
    attitude, setpoints = run.attitude_deg[start:], run.setpoint_deg[start:]
    if not len(setpoints):
        return None
    before = run.setpoint_deg[start - 1] if start else attitude[0]
    steps = np.abs(wrapped_deg(np.diff(setpoints, axis=0, prepend=before[None])))
    changes = np.flatnonzero(steps[:, axis])
    if not changes.size:
        return None
    error = np.abs(wrapped_deg(attitude[:, axis] - setpoints[:, axis]))
    ends = np.append(np.flatnonzero(steps.any(axis=1)), len(error))
    bands = np.maximum(SETTLED_FRACTION * steps[changes, axis], SETTLED_FLOOR_deg)
    spans = zip(changes, [*changes[1:], len(error)], bands, strict=True)
    ticks = [
        _ticks_to_settle(error[k:end], ends[(ends > k) & (ends <= end)] - k, band, dwell) for k, end, band in spans
    ]
    *others, last = ticks
    if math.isinf(last) and others and len(error) - changes[-1] < max(others) + dwell < math.inf:
        ticks = others
    return float(max(ticks) * run.period_s)


def _ticks_to_settle(error: Array, ends: Array, band: float, dwell: int) -> float:
    """First index from which on error is within the band to the next of `ends` (in rising order), for `dwell` or more.

    Infinite: there is none.
    """
    outside = np.flatnonzero(~(error <= band))  # what is not a number is outside
    for start, end in zip([0, *ends[:-1]], ends, strict=True):
        before = outside[(start <= outside) & (outside < end)]
        settled = int(before[-1]) + 1 if before.size else int(start)
        if end - settled >= dwell:
            return settled
    return math.inf


def never_settled(metrics: Mapping[str, Any]) -> list[str]:
    """Axes whose settling_s is infinite, by name: JSON has null for that and for an axis without a step."""
    if NEVER_SETTLED in metrics:
        return list(metrics[NEVER_SETTLED])
    values = metrics.get(SETTLING) or ()
    return [name for name, value in zip(AXIS_NAMES, values, strict=False) if value == math.inf]


def as_json(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """The metrics as plain JSON values, and never_settled, the names of the axes that did not settle."""
    return {**plain(metrics), NEVER_SETTLED: never_settled(metrics)}


def reference_mismatch_deg(run: Run) -> float | None:
    """Largest |board's reference - ours| over the ticks with TELEMETRY in which the board's reference runs.

    None: the board reported no reference. NaN: it reported one, and ours could not be made (no CONFIG in the log).
    """
    reported = run.reported("reference")
    if not np.isfinite(reported).any():
        return None
    difference = np.abs(wrapped_deg(reported - run.reference_deg))[run.reference_runs]
    return float(np.nanmax(difference)) if np.isfinite(difference).any() else math.nan


def judge(require: Iterable[Any], metrics: Mapping[str, Any]) -> list[Judgement]:
    """Hold the metrics against the scenario's `require` lines (mappings or objects with metric, below, above, between).

    The board's reference has to agree with ours too, within MISMATCH_LIMIT_deg, asked for or not. A missing or NaN
    value fails. Raises ValueError for a metric that does not exist.
    """
    lines = [_line(item) for item in require]
    if metrics.get(MISMATCH) is not None and not any(line["metric"] == MISMATCH for line in lines):
        lines.append({"metric": MISMATCH, "below": MISMATCH_LIMIT_deg})
    return [_judged(line, value_of(metrics, line["metric"])) for line in lines]


def value_of(metrics: Mapping[str, Any], name: str) -> float | None:
    """One number: `rms_error_deg.roll`, `.max` for the largest of three, `.all` for the rms over the axes too, `.total`
    for their sum, `diverged_at_s`; None: there is none.

    `settling_s.max` is None only if no axis had a step, and infinite if one never settled. metrics: from measure() or
    as they stand in summary.json, where never_settled tells what null means.
    """
    key, _, part = name.partition(".")
    known = [each for each in metrics if each != NEVER_SETTLED]
    if key not in known:
        raise ValueError(f"metric: expected one of {', '.join(known)}, got {name!r}")
    value = metrics[key]
    if key == SETTLING and value is not None:
        never = [PARTS[axis] for axis in never_settled(metrics)]
        value = [math.inf if axis in never else number for axis, number in enumerate(value)]
    if not isinstance(value, Sequence | np.ndarray):
        return None if value is None else float(value)
    if part in OF_THREE and part in (*METRICS.get(key, ()), "max"):
        numbers = [number for number in value if number is not None]  # None: this axis has nothing to measure
        return float(OF_THREE[part](np.array(numbers))) if numbers else None
    if part not in PARTS:
        known = [f".{each}" for each in METRICS.get(key, ("roll", "pitch", "yaw", "max"))]
        raise ValueError(f"metric: expected {key}{', '.join(known[:-1])} or {known[-1]}, got {name!r}")
    number = value[PARTS[part]]
    return None if number is None else float(number)


def _line(item: Any) -> dict[str, Any]:
    names = ("metric", "below", "above", "between")
    if isinstance(item, Mapping):
        return {name: item.get(name) for name in names}
    return {name: getattr(item, name, None) for name in names}


def _judged(line: Mapping[str, Any], value: float | None) -> Judgement:
    low, high = line.get("between") or (line.get("above"), line.get("below"))
    inclusive = line.get("between") is not None
    if low is None and high is None:
        raise ValueError(f"require: expected below, above or between for {line['metric']}")
    sentence, reason = _sentence(line["metric"], low, high, inclusive), _reason(line["metric"], value)
    if value is None or math.isnan(value):
        return Judgement(line["metric"], sentence, value, False, None, reason)
    margins = [high - value] if high is not None else []
    margins += [value - low] if low is not None else []
    margin = min(margins)
    passed = margin >= 0 if inclusive else margin > 0
    return Judgement(line["metric"], sentence, value, passed, margin, reason)


def _reason(metric: str, value: float | None) -> str:
    """What to say instead of a number; "" where there is one."""
    if value is None:
        return {SETTLING: "no step", "diverged_at_s": "never"}.get(metric.partition(".")[0], "none")
    if math.isnan(value):
        return "not a number"
    return "" if math.isfinite(value) else "never" if metric.startswith(SETTLING) else "infinite"


def _sentence(metric: str, low: float | None, high: float | None, inclusive: bool) -> str:
    if inclusive:
        return f"{low:g} <= {metric} <= {high:g}"
    return f"{metric} < {high:g}" if low is None else f"{metric} > {low:g}"


def _counts(run: Run) -> dict[str, int]:
    codes = [event.code for event in run.events]
    return {
        "missed": codes.count(events.COMMAND_MISSED),
        "late": int((run.commands["fate"] == Fate.LATE).sum()),
        "overruns": codes.count(events.OVERRUN),
        "restarts": codes.count(events.BOARD_RESTARTED),
    }


def _rms(values: Array) -> list[float]:
    return [math.nan] * 3 if not len(values) else [float(v) for v in np.sqrt(np.mean(np.square(values), axis=0))]


def _effort(torque_Nm: Array, period_s: float) -> list[float]:
    """The torque holds for a period, so the sum is the integral."""
    return [float(v) for v in np.abs(torque_Nm).sum(axis=0) * period_s]


def _peak(values: Array) -> list[float]:
    return [math.nan] * 3 if not len(values) else [float(v) for v in np.max(np.abs(values), axis=0)]
