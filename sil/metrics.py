"""Figures of merit of a run, and the verdict on its requirements. All of it from the log, none of it from a clock.

Errors are attitude - reference (recomputed in float64 apart from the board, sil.reference) and attitude - set-point,
both from truth, modulo a turn, from tick `metrics.from_tick` on. A three-number metric is [roll, pitch, yaw]; NaN
anywhere in its rows makes it NaN, and NaN meets no requirement.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from protocol import events
from sil.runs import Array, Run, wrapped_deg
from sil.sinks.journal import Fate

DIVERGED_deg = 80.0  # the scenario's metrics.diverged_deg says otherwise
MISMATCH_LIMIT_deg = 1e-5  # board's reference against ours: 100 times the LSB of an angle on the wire
SETTLED_FRACTION, SETTLED_FLOOR_deg = 0.02, 0.1  # settled: within 2 % of the step; never asked closer than this
PARTS = {"roll": 0, "x": 0, "pitch": 1, "y": 1, "yaw": 2, "z": 2}
MISMATCH = "reference_mismatch_deg"


class Judgement(NamedTuple):
    """One requirement and what became of it; margin is the distance to the nearest bound, negative when it failed."""

    metric: str
    requirement: str  # such as "rms_error_deg.roll < 0.5"
    value: float | None
    passed: bool
    margin: float | None


def measure(run: Run) -> dict[str, Any]:
    """All metrics of a run by name.

    Three numbers each: rms_error_deg, rms_setpoint_error_deg, peak_error_deg, peak_torque_Nm, rms_torque_Nm (applied
    torque on the body), peak_momentum_Nms, effort_Nms (integral of |applied torque| dt), settling_s (see settling_s).
    One number: diverged_at_s (first tick with an angle beyond metrics.diverged_deg, default 80 deg, or not a number;
    None: never), reference_mismatch_deg (largest difference between the board's reference and ours; None: the board
    reported none), and the counts missed, late, overruns.
    """
    settings = run.scenario.get("metrics") or {}
    first = int(settings.get("from_tick") or 0)
    rows = run.tick >= first
    error = run.error_deg[rows]
    if not np.isfinite(run.reference_deg).any():
        error = run.setpoint_error_deg[rows]  # no reference model in this run: the set-point is the reference
    torque = run.applied_Nm[rows]
    return {
        "from_tick": first,
        "rms_error_deg": _rms(error),
        "rms_setpoint_error_deg": _rms(run.setpoint_error_deg[rows]),
        "peak_error_deg": _peak(error),
        "peak_torque_Nm": _peak(torque),
        "rms_torque_Nm": _rms(torque),
        "peak_momentum_Nms": _peak(run.momentum_Nms[rows]),
        "effort_Nms": _effort(torque, run.period_s),
        "settling_s": [settling_s(run, axis, first) for axis in range(3)],
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


def settling_s(run: Run, axis: int, from_tick: int = 0) -> float | None:
    """How long one axis (0 roll, 1 pitch, 2 yaw) takes to settle after its set-point changed, s; the longest of all.

    A change at tick k >= from_tick is a step of size s = |new - old|. The axis has settled at the first tick from which
    on |attitude - set-point| stays within max(2 % of s, 0.1 deg) up to the next change of any axis' set-point, or to
    the end of the run: that the turn of another axis pushes it out again later is coupling, not settling. It has until
    its own next change. The time counts from tick k, in whole periods. With from_tick 0 the start of the run is a step
    from the attitude it starts at.

    None: the axis has no step. Infinite (null in JSON): it did not settle after one of them; no limit from above is
    met then. A last step that the end of the run cut off sooner than the slowest of the others settled says nothing,
    and is left out.
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
    ticks = [_ticks_to_settle(error[k:end], ends[(ends > k) & (ends <= end)] - k, band) for k, end, band in spans]
    *others, last = ticks
    if math.isinf(last) and others and len(error) - changes[-1] < max(others) < math.inf:
        ticks = others
    return float(max(ticks) * run.period_s)


def _ticks_to_settle(error: Array, ends: Array, band: float) -> float:
    """First index from which on error is within the band up to one of `ends` (in rising order); infinite: never."""
    outside = np.flatnonzero(~(error <= band))  # what is not a number is outside
    for end in ends:
        so_far = outside[outside < end]
        settled = int(so_far[-1]) + 1 if so_far.size else 0
        if settled < end:
            return settled
    return math.inf


def reference_mismatch_deg(run: Run) -> float | None:
    """Largest |board's reference - ours| over the ticks with TELEMETRY from the reference's start on.

    None: the board reported no reference. NaN: it reported one, and ours could not be made (no CONFIG in the log).
    """
    reported = run.reported("reference")
    if not np.isfinite(reported).any():
        return None
    difference = np.abs(wrapped_deg(reported - run.reference_deg))
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
    """One number: `rms_error_deg.roll`, `.max` for the largest of three, `diverged_at_s`; None: there is none."""
    key, _, part = name.partition(".")
    if key not in metrics:
        raise ValueError(f"metric: expected one of {', '.join(metrics)}, got {name!r}")
    value = metrics[key]
    if not isinstance(value, Sequence | np.ndarray):
        return None if value is None else float(value)
    if part == "max":
        numbers = [number for number in value if number is not None]  # None: this axis has nothing to measure
        return float(np.max(numbers)) if numbers else None
    if part not in PARTS:
        raise ValueError(f"metric: expected {key}.roll, .pitch, .yaw or .max, got {name!r}")
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
    if value is None or math.isnan(value):
        return Judgement(line["metric"], _sentence(line["metric"], low, high, inclusive), value, False, None)
    margins = [high - value] if high is not None else []
    margins += [value - low] if low is not None else []
    margin = min(margins)
    passed = margin >= 0 if inclusive else margin > 0
    return Judgement(line["metric"], _sentence(line["metric"], low, high, inclusive), value, passed, margin)


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
    }


def _rms(values: Array) -> list[float]:
    return [math.nan] * 3 if not len(values) else [float(v) for v in np.sqrt(np.mean(np.square(values), axis=0))]


def _effort(torque_Nm: Array, period_s: float) -> list[float]:
    """The torque holds for a period, so the sum is the integral."""
    return [float(v) for v in np.abs(torque_Nm).sum(axis=0) * period_s]


def _peak(values: Array) -> list[float]:
    return [math.nan] * 3 if not len(values) else [float(v) for v in np.max(np.abs(values), axis=0)]
