"""Where a satellite points: rotations of Euler angles and of the orbital frame, of numbers or of whole columns.

Quaternions are scalar first, Hamilton, and map body to reference components: v_R = q v_B q*. R is the frame that the
scenario's `attitude.frame` names: lvlh (O: x along-track, y = -orbit normal, z nadir) or inertial (N). sil.rotations
has the same rotations as matrices, compiled; here nothing is compiled, so that logs and pages import it at no cost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Number = TypeVar("Number", float, Array)
Quaternion = tuple[float, float, float, float]


def frame_of(scenario: Mapping[str, Any]) -> str:
    """lvlh or inertial, of a resolved scenario."""
    return str((scenario.get("attitude") or {}).get("frame", "lvlh"))


def sequence_of(scenario: Mapping[str, Any]) -> int:
    """321 or 123, of a resolved scenario."""
    return int((scenario.get("attitude") or {}).get("sequence", 321))


class Orbit(NamedTuple):
    """A circular orbit with its ascending node on N x; defaults: that of paper 004."""

    radius_m: float = 6978137.0
    mu: float = 3.986004418e14  # m^3/s^2
    inclination_deg: float = 97.8
    u0_deg: float = 0.0  # argument of latitude at t = 0

    def u_rad(self, t_s: Number) -> Number:
        """Argument of latitude at t_s."""
        return math.radians(self.u0_deg) + math.sqrt(self.mu / self.radius_m**3) * t_s

    @property
    def tilt_rad(self) -> float:
        """Inclination."""
        return math.radians(self.inclination_deg)


def orbit_of(scenario: Mapping[str, Any]) -> Orbit:
    """plant.orbit of a resolved scenario."""
    given = (scenario.get("plant") or {}).get("orbit") or {}
    return Orbit()._replace(**{key: float(value) for key, value in given.items() if key in Orbit._fields})


def q_of_euler(euler_rad: Sequence[float], sequence: int) -> Quaternion:
    """Of the angles [phi, theta, psi]; either sign."""
    x, y, z = euler_rad[0] / 2.0, euler_rad[1] / 2.0, euler_rad[2] / 2.0
    cos, sin = math.cos, math.sin
    return _q_of_halves(cos(x), cos(y), cos(z), sin(x), sin(y), sin(z), 1.0 if sequence == 321 else -1.0)


def q_columns(euler_deg: Array, sequence: int) -> Array:
    """(N, 4) of angles [phi, theta, psi] (N, 3) deg, sign continuous; NaN gives NaN."""
    half = np.radians(euler_deg).T / 2.0
    (cx, cy, cz), (sx, sy, sz) = np.cos(half), np.sin(half)
    q = np.column_stack(_q_of_halves(cx, cy, cz, sx, sy, sz, 1.0 if sequence == 321 else -1.0))
    flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.asarray(q * np.concatenate(([1.0], np.cumprod(flips)))[: len(q), None])


def _q_of_halves(
    cx: Number, cy: Number, cz: Number, sx: Number, sy: Number, sz: Number, sign: float
) -> tuple[Number, Number, Number, Number]:
    """qz qy qx (sign 1: 321) or qx qy qz (sign -1: 123): the other order turns the sign of the mixed products."""
    return (
        cx * cy * cz + sign * sx * sy * sz,
        sx * cy * cz - sign * cx * sy * sz,
        cx * sy * cz + sign * sx * cy * sz,
        cx * cy * sz - sign * sx * sy * cz,
    )


def q_of_orbit(cos_half: Number, sin_half: Number, tilt_rad: float) -> tuple[Number, Number, Number, Number]:
    """q_ON (v_N = q v_O q*) from cosine and sine of half the argument of latitude; sign continuous in it.

    q_ON = qx(tilt) (x) qz(u) (x) 1/2 (1, -1, -1, 1); the last one is O at the ascending node of an equatorial orbit:
    x along N y, y along -N z, z along -N x.
    """
    back, on = (cos_half - sin_half) / 2.0, (cos_half + sin_half) / 2.0
    c, s = math.cos(tilt_rad / 2.0), math.sin(tilt_rad / 2.0)
    return back * (c + s), back * (s - c), on * (-c - s), on * (c - s)


def directions(orbit: Orbit, t_s: Array) -> tuple[Array, Array]:
    """Nadir and velocity in N at these times, (M, 3) each: the z and x axes of O."""
    half = orbit.u_rad(t_s) / 2.0
    w, x, y, z = q_of_orbit(np.cos(half), np.sin(half), orbit.tilt_rad)
    nadir = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z]
    velocity = [w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    return np.column_stack(nadir), np.column_stack(velocity)


def times(p: Sequence[float], q: Sequence[float]) -> Quaternion:
    """The Hamilton product p (x) q: q first, then p."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def inverse(q: Sequence[float]) -> Quaternion:
    """The rotation back, of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


def continued(q: Sequence[float], before: Sequence[float]) -> Quaternion:
    """q or -q, whichever is nearer to the one before; the rotation is the same."""
    w, x, y, z = q
    if w * before[0] + x * before[1] + y * before[2] + z * before[3] < 0.0:
        return -w, -x, -y, -z
    return w, x, y, z
