"""The signals that can be drawn: where each one stands in a run, its unit, and how its lines are to be read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sil import mcap_file
from sil.run_columns import AXES
from sil.runs import Array, Run
from sil.sinks import layouts
from sil.trouble import UsageError

GROUP = "identification"
NO_ANSWER = -1
_OURS = ("attitude", "error", "torque", "momentum", "rate", "lateness", "answer")  # no word of TELEMETRY hides them
_IDENTIFIED = {
    "g": ("gain g", "1", "Identified gain g (inertia = believed inertia / g)"),
    "b0": ("b0", "rad/(N m)", "Identified b0"),
    "b1": ("b1", "rad/(N m)", "Identified b1"),
    "a1": ("a1", "1", "Identified a1"),
    "a2": ("a2", "1", "Identified a2"),
    "d": ("d", "rad", "Identified d"),
    "trace": ("trace F", "1", "Trace of the covariance F"),
    "P": ("variance P", "1", "Variance of g"),
}


class SignalError(UsageError):
    """No such signal, or not in these runs: one line."""


class Signal(NamedTuple):
    """Something to draw. `read` gives (N, 3) for roll, pitch, yaw or (N,) for one line; NaN where there is nothing.

    angle: modulo a turn. zero: the zero line means something. step: the value holds until the next tick.
    """

    name: str
    label: str
    unit: str
    title: str
    read: Callable[[Run], Array]
    angle: bool = False
    zero: bool = False
    step: bool = False


def controlled(run: Run) -> bool:
    """A board answered, or at least was asked."""
    return bool(run.config_words) or len(run.commands) > 0


def error_deg(run: Run) -> Array:
    """attitude - reference, or - set-point where the board has no reference model."""
    return run.error_deg if np.isfinite(run.error_deg).any() else run.setpoint_error_deg


def signals_of(run: Run) -> dict[str, Signal]:
    """All signals of a run by name, in the order of the pages."""
    against = "reference" if np.isfinite(run.error_deg).any() else "set-point"
    tracking = f"Tracking error: attitude − {against}"
    found = [
        Signal("attitude", "attitude", "deg", "Attitude", lambda run: run.attitude_deg, angle=True),
        Signal("error", "error", "deg", tracking, error_deg, angle=True, zero=True),
        Signal("torque", "torque", "N m", "Torque on the body", lambda run: run.applied_Nm, zero=True, step=True),
        Signal("momentum", "momentum", "N m s", "Wheel momentum", lambda run: run.momentum_Nms, zero=True),
        Signal("rate", "rate", "deg/s", "Body rate ω_BN", lambda run: np.degrees(run.omega_radps), zero=True),
    ]
    signals = {signal.name: signal for signal in found}
    if not controlled(run):
        del signals["error"]
    if without_wheels(run):
        del signals["momentum"]
    signals |= {name: _reported(run, name) for name in _reported_names(run)}
    if _timing_file(run).exists():
        signals |= {signal.name: signal for signal in _TIMES[: 2 if controlled(run) else 1]}
    return signals


def without_wheels(run: Run) -> bool:
    """Thrusters turn it, and no wheel has any momentum."""
    kind = (run.scenario.get("actuators") or {}).get("kind", "wheels")
    return bool(kind != "wheels" and not run.momentum_Nms.any())


def identified(run: Run) -> list[str]:
    """Names of what this law's TELEMETRY tells of its identification."""
    return [name for name in _IDENTIFIED if f"{name}_x" in run.telemetry]


def chosen(runs: Sequence[Run], names: Sequence[str], default: Sequence[str]) -> list[Signal]:
    """The signals called `names` (none: those of `default` that are there); `identification` is all of a law's.

    A signal is taken that one of the runs has. Raises SignalError.
    """
    known: dict[str, Signal] = {}
    for run in runs:
        known = {**signals_of(run), **known}
    groups = list(dict.fromkeys(name for run in runs for name in identified(run)))
    if not names:
        return [known[name] for name in default if name in known]
    picked: dict[str, Signal] = {}
    for name in names:
        for each in groups if name == GROUP and groups else [name]:
            if each not in known:
                all_known = [*known, *([GROUP] if groups else [])]
                raise SignalError(
                    f"--signals: expected signals of the run, got {name!r}; known: {', '.join(all_known)}"
                )
            picked[each] = known[each]
    return list(picked.values())


def has(run: Run, signal: Signal) -> bool:
    """Whether the run has this signal."""
    return signal.name in signals_of(run)


def logarithmic(name: str, values: Array) -> bool:
    """Covariances fall by orders of magnitude."""
    finite = values[np.isfinite(values)]
    return name in ("trace", "P") and bool(finite.size) and finite.min() > 0 and finite.max() > 30 * finite.min()


def near_limits(run: Run, axes: Sequence[int], key: str = "torque_max_Nm", name: str = "applied_Nm") -> Array:
    """Limits `key` of the actuators on these axes, where the values `name` come near them."""
    actuators = run.scenario.get("actuators") or {}
    limits = (actuators.get(actuators.get("kind", "wheels")) or {}).get(key)
    values = run[name]
    if limits is None or not np.isfinite(values).any():
        return np.empty(0)
    chosen = np.unique(np.broadcast_to(np.asarray(limits, float), 3)[list(axes)])
    return np.asarray(chosen[chosen < 2.0 * np.nanmax(np.abs(values))])


# -- TELEMETRY ---------------------------------------------------------------------------------------------------------


def _reported_names(run: Run) -> list[str]:
    """Triples in TELEMETRY, the identification first."""
    triples = [name.removesuffix("_x") for name in run.telemetry if name.endswith("_x")]
    whole = [name for name in triples if all(f"{name}_{axis}" in run.telemetry for axis in AXES)]
    return [*identified(run), *(name for name in whole if name not in _IDENTIFIED and name not in _OURS)]


def _reported(run: Run, name: str) -> Signal:
    words = name.replace("_", " ")
    known = _IDENTIFIED.get(name, (words, run.units.get(f"{name}_x", "1"), f"{words.capitalize()} (TELEMETRY)"))
    return Signal(name, *known, lambda run: run.reported(name), zero=name not in _IDENTIFIED)


# -- timing.mcap -------------------------------------------------------------------------------------------------------


def _timing_file(run: Run) -> Path:
    return run.directory / "timing.mcap"


def _timing(field: str) -> Callable[[Run], Array]:
    return lambda run: _timing_us(run, field)


def _timing_us(run: Run, field: str) -> Array:
    """(N,) of timing.mcap by tick, us. Raises SignalError where it is damaged or another version wrote it."""
    file = _timing_file(run)
    try:
        messages = mcap_file.read(file, ("/timing",)).messages["/timing"]
        if any(len(message.data) != layouts.TIMING.size for message in messages):
            raise ValueError("its rows are of another size")
        start = len(layouts.CDR_HEADER)
        rows = np.frombuffer(b"".join(message.data[start:] for message in messages), layouts.TIMING.dtype)
    except (OSError, ValueError, mcap_file.McapError) as error:
        raise SignalError(f"{file}: cannot be read by this version: {error}") from error
    values = np.full(len(run), np.nan)
    at = np.searchsorted(run.tick, rows["tick"])
    known = (at < len(values)) & (rows[field] != NO_ANSWER)
    values[at[known]] = rows[field][known] / 1000.0
    return values


_TIMES = (
    Signal("lateness", "lateness", "µs", "Lateness: wake-up after the deadline", _timing("lateness_ns"), zero=True),
    Signal("answer", "answer time", "µs", "Answer time: SAMPLE sent to COMMAND received", _timing("answer_ns")),
)
