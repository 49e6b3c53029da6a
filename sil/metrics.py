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
    torque on the body), peak_momentum_Nms. One number: diverged_at_s (first tick with an angle beyond
    metrics.diverged_deg, default 80 deg, or not a number; None: never), reference_mismatch_deg (largest difference
    between the board's reference and ours; None: the board reported none), and the counts missed, late, overruns.
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
    """One number: `rms_error_deg.roll`, `.max` for the largest of three, `diverged_at_s`; None where there is none."""
    key, _, part = name.partition(".")
    if key not in metrics:
        raise ValueError(f"metric: expected one of {', '.join(metrics)}, got {name!r}")
    value = metrics[key]
    if not isinstance(value, Sequence | np.ndarray):
        return None if value is None else float(value)
    if part == "max":
        return float(np.max(np.asarray(value, float)))
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


def _peak(values: Array) -> list[float]:
    return [math.nan] * 3 if not len(values) else [float(v) for v in np.max(np.abs(values), axis=0)]
