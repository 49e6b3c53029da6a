"""A run as a notebook shows it: its name and verdict, errors and torques by axis, and which names it knows."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from sil.runs import Array, Run

_AXES = ("roll, x", "pitch, y", "yaw, z")
_DIGITS = 4


def table_of(run: Run) -> str:
    """HTML of a few lines. The figures are those of all ticks; summary.json has what `metrics.from_tick` leaves."""
    law: dict[str, Any] = run.scenario.get("law") or {}
    facts = [
        str(run.summary.get("verdict", "")),
        f"{len(run)} ticks of {run.period_s:g} s",
        f"{law.get('name', '')} {law.get('form', '')}".strip(),
        str(run.directory),
    ]
    head = f"<b>{escape(run.name)}</b> · " + " · ".join(escape(fact) for fact in facts if fact)
    rows = {
        "rms error, deg": _rms(run.error_deg),
        "peak error, deg": _peak(run.error_deg),
        "rms torque, mN m": _rms(1e3 * run.applied_Nm),
        "peak torque, mN m": _peak(1e3 * run.applied_Nm),
    }
    cells = "".join(_row(name, values) for name, values in rows.items() if np.isfinite(values).any())
    axes = "".join(f"<th>{axis}</th>" for axis in _AXES)
    names = escape(", ".join(run.names))
    return (
        f"<div>{head}<table><tr><th></th>{axes}</tr>{cells}</table>"
        f"<details><summary>{len(run.names)} names</summary>{names}</details></div>"
    )


def _row(name: str, values: Array) -> str:
    figures = "".join(f"<td>{value:.{_DIGITS}g}</td>" for value in values)
    return f"<tr><th style='text-align:left'>{name}</th>{figures}</tr>"


def _rms(values: Array) -> Array:
    """(3,) over the rows that are numbers; NaN where there are none."""
    known = values[np.isfinite(values).all(axis=1)]
    return np.sqrt((known**2).mean(axis=0)) if len(known) else np.full(3, np.nan)


def _peak(values: Array) -> Array:
    known = values[np.isfinite(values).all(axis=1)]
    return np.asarray(np.abs(known).max(axis=0)) if len(known) else np.full(3, np.nan)
