"""Which plots a page has and which columns their lines are; drawn by assets/plots.js.

Of one run roll, pitch and yaw share a plot. Of several runs each axis has a plot of its own, with a line for each run.
A plot is rows (axes or runs, told apart by colour) by roles (told apart by how the line is drawn).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from sil.report.colours import AXIS_NAMES, scaled
from sil.report.page.columns import Columns
from sil.report.signals import Signal, controlled, has, identified, logarithmic, near_limits, signals_of
from sil.runs import Array, Run

USUAL = ("attitude", "error", "torque", "momentum", "rate")
_TIMES = ("lateness", "answer")  # have a place of their own
_SHOWN_ANYWAY = ("reference", "setpoint")  # with the attitude

Read = Callable[[Run], Array]


class Role(NamedTuple):
    """One kind of line: name, drawn `solid`, `dashed`, `dotted` or `faint`, and where it stands in a run."""

    name: str
    style: str
    read: Read
    there: Callable[[Run], bool]


def plots(runs: Sequence[Run], columns: Sequence[Columns], labels: Sequence[str]) -> list[dict[str, Any]]:
    """All plots, in the order of the page; adds what they draw to the columns."""
    known: dict[str, Signal] = {}
    for run in runs:
        known = {**signals_of(run), **known}
    named = list(dict.fromkeys(name for run in runs for name in identified(run)))
    others = [name for name in known if name not in (*USUAL, *named, *_TIMES, *_SHOWN_ANYWAY)]
    groups = (("motion", USUAL), ("identification", named), ("telemetry", others))
    made: list[dict[str, Any]] = []
    for group, names in groups:
        for signal in (known[name] for name in names if name in known):
            made += _plots_of(signal, group, runs, columns, labels)
    return made


def _plots_of(
    signal: Signal, group: str, runs: Sequence[Run], columns: Sequence[Columns], labels: Sequence[str]
) -> list[dict[str, Any]]:
    """One plot, or one for each axis."""
    values = {i: signal.read(run) for i, run in enumerate(runs) if has(run, signal)}
    peaks = np.concatenate([each.ravel() for each in values.values()])
    factor, unit = scaled(peaks, signal.unit)
    roles = [role for role in _roles(signal) if any(role.there(run) for run in runs)]
    lines = [[_columns(signal, role, run, factor, columns[i]) for role in roles] for i, run in enumerate(runs)]
    plot = {
        "group": group,
        "signal": signal.name,
        "title": _title(signal, runs),
        "label": signal.label,
        "unit": "" if unit == "1" else unit,
        "zero": signal.zero,
        "step": signal.step,
        "angle": signal.angle,
        "log": logarithmic(signal.name, peaks),
        "roles": [[role.name, role.style] for role in roles],
    }
    limits = [_limits(signal, run, factor) for run in runs]
    if len(runs) == 1:
        axes = [[[0, triple[axis]] if triple else None for triple in lines[0]] for axis in range(3)]
        both = sorted({abs(value) for value in limits[0]})
        return [{**plot, "id": signal.name, "rows": list(AXIS_NAMES), "of": "axes", "lines": axes, "limits": both}]
    return [
        {
            **plot,
            "id": f"{signal.name}-{name}",
            "title": f"{plot['title']}: {name}",
            "rows": list(labels),
            "of": "runs",
            "lines": [[[i, t[axis]] if t else None for t in triples] for i, triples in enumerate(lines)],
            "limits": [],
        }
        for axis, name in enumerate(AXIS_NAMES)
    ]


def _roles(signal: Signal) -> list[Role]:
    """The lines of a signal, the first what it is about."""
    own = Role(signal.label, "solid", signal.read, lambda run: has(run, signal))
    if signal.name == "attitude":
        reference = Role("reference", "dashed", lambda run: run.reference_deg, _has_reference)
        return [own, reference, Role("set-point", "dotted", lambda run: run.setpoint_deg, controlled)]
    if signal.name == "torque":
        asked = Role("commanded", "faint", lambda run: run.command_Nm, controlled)
        return [own._replace(name="applied"), asked]
    return [own]


def _columns(signal: Signal, role: Role, run: Run, factor: float, columns: Columns) -> list[str] | None:
    """Names of the three columns of a line; None where this run has no such line."""
    if not role.there(run):
        return None
    values = role.read(run) * factor
    return [columns.add(f"{signal.name} {role.name} {axis}", values[:, axis]) for axis in range(3)]


def _has_reference(run: Run) -> bool:
    return bool(np.isfinite(run.reference_deg).any())


def _title(signal: Signal, runs: Sequence[Run]) -> str:
    against = signal.name == "attitude" and any(map(_has_reference, runs))
    return "Attitude against reference" if against else signal.title


def _limits(signal: Signal, run: Run, factor: float) -> list[float]:
    """Limits of the wheels that the values come near."""
    if signal.name == "torque":
        return [float(v) * factor for v in near_limits(run, (0, 1, 2))]
    if signal.name == "momentum":
        return [float(v) * factor for v in near_limits(run, (0, 1, 2), "momentum_max_Nms", "momentum_Nms")]
    return []
