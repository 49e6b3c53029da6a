"""What the 3-D view shows: body and reference as rotations, nadir and velocity, all in the frame of the readings (R).

R is the scenario's attitude.frame: the orbital frame (x along-track, y = -orbit normal, z nadir) or inertial space.
Quaternions are scalar first and map body to R: v_R = q v_B q*.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sil.report.page.columns import Columns, packed
from sil.report.signals import controlled
from sil.runs import Array, Run

_SATELLITE = {"radius_m": 6978137.0, "mu": 3.986004418e14, "inclination_deg": 97.8, "u0_deg": 0.0}  # of paper 004


def view(run: Run, columns: Columns) -> dict[str, Any]:
    """Rotations at the view's rows, float32 in base64: body, ghost ("": nothing to follow), directions."""
    rows = columns.rows
    sequence = sequence_of(run)
    ghost, what = _followed(run)
    nadir, velocity = directions(run, run.t_s[rows])
    return {
        "frame": frame_of(run),
        "body": packed(q_of_euler(run.attitude_deg[rows], sequence), np.float32),
        "ghost": packed(q_of_euler(ghost[rows], sequence), np.float32) if what else "",
        "ghost_is": what,
        "nadir": packed(nadir, np.float32),
        "velocity": packed(velocity, np.float32),
        "momentum": packed(run.momentum_Nms[rows], np.float32),
    }


def frame_of(run: Run) -> str:
    """lvlh or inertial."""
    return str((run.scenario.get("attitude") or {}).get("frame", "lvlh"))


def sequence_of(run: Run) -> int:
    """321 or 123."""
    return int((run.scenario.get("attitude") or {}).get("sequence", 321))


def q_of_euler(euler_deg: Array, sequence: int) -> Array:
    """(N, 4) of angles [phi, theta, psi] (N, 3) deg, sign continuous: qz qy qx for 321, qx qy qz for 123.

    NaN gives NaN.
    """
    half = np.radians(euler_deg) / 2.0
    (cx, cy, cz), (sx, sy, sz) = np.cos(half).T, np.sin(half).T
    sign = 1.0 if sequence == 321 else -1.0  # the other order turns the sign of the mixed products
    q = np.column_stack(
        [
            cx * cy * cz + sign * sx * sy * sz,
            sx * cy * cz - sign * cx * sy * sz,
            cx * sy * cz + sign * sx * cy * sz,
            cx * cy * sz - sign * sx * sy * cz,
        ]
    )
    flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.asarray(q * np.concatenate(([1.0], np.cumprod(flips)))[: len(q), None])


def directions(run: Run, t_s: Array) -> tuple[Array, Array]:
    """Nadir and velocity in R at these times, (M, 3) each, or (1, 3) where they stand still (lvlh)."""
    if frame_of(run) == "lvlh":
        return np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    orbit = {**_SATELLITE, **((run.scenario.get("plant") or {}).get("orbit") or {})}
    u = math.radians(orbit["u0_deg"]) + math.sqrt(orbit["mu"] / orbit["radius_m"] ** 3) * t_s
    tilt = math.radians(orbit["inclination_deg"])
    c, s, cos_i, sin_i = np.cos(u), np.sin(u), math.cos(tilt), math.sin(tilt)
    return np.column_stack([-c, -s * cos_i, -s * sin_i]), np.column_stack([-s, c * cos_i, c * sin_i])


def _followed(run: Run) -> tuple[Array, str]:
    """The reference; where the board has none, the set-point; "" where nobody follows anything."""
    if np.isfinite(run.reference_deg).any():
        return run.reference_deg, "reference"
    return run.setpoint_deg, "set-point" if controlled(run) else ""
