"""What the 3-D view shows: body and reference as rotations, nadir and velocity, all in the frame of the readings (R).

R is the scenario's attitude.frame: the orbital frame (x along-track, y = -orbit normal, z nadir) or inertial space.
Quaternions are scalar first and map body to R: v_R = q v_B q* (sil.pointing).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sil import pointing
from sil.pointing import q_columns
from sil.report.page.columns import Columns, packed
from sil.report.signals import controlled
from sil.runs import Array, Run


def view(run: Run, columns: Columns) -> dict[str, Any]:
    """Rotations at the view's rows, float32 in base64: body, ghost ("": nothing to follow), directions."""
    rows = columns.rows
    sequence = pointing.sequence_of(run.scenario)
    ghost, what = _followed(run)
    nadir, velocity = directions(run, run.t_s[rows])
    return {
        "frame": pointing.frame_of(run.scenario),
        "body": packed(q_columns(run.attitude_deg[rows], sequence), np.float32),
        "ghost": packed(q_columns(ghost[rows], sequence), np.float32) if what else "",
        "ghost_is": what,
        "nadir": packed(nadir, np.float32),
        "velocity": packed(velocity, np.float32),
        "momentum": packed(run.momentum_Nms[rows], np.float32),
    }


def directions(run: Run, t_s: Array) -> tuple[Array, Array]:
    """Nadir and velocity in R at these times, (M, 3) each, or (1, 3) where they stand still (lvlh)."""
    if pointing.frame_of(run.scenario) == "lvlh":
        return np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    return pointing.directions(pointing.orbit_of(run.scenario), t_s)


def _followed(run: Run) -> tuple[Array, str]:
    """The reference; where the board has none, the set-point; "" where nobody follows anything."""
    if np.isfinite(run.reference_deg).any():
        return run.reference_deg, "reference"
    return run.setpoint_deg, "set-point" if controlled(run) else ""
