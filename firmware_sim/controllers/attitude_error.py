"""Attitude error of Euler angles y against reference angles r, rad: as their difference, or in body axes.

    euler         e = y - r, each angle in [-pi, pi)
    quaternion    e = -2 vec(q(y)^-1 (x) q(r)), the shorter way round (scalar part not negative), so |e| <= 2

With q in 3-2-1 (phi, theta, psi: q = qz (x) qy (x) qx) or 1-2-3 (q = qx (x) qy (x) qz), Hamilton, scalar first, body to
reference; e is y's turn away from r, in body axes, to first order the angle. error(r, y) = -error(y, r). The Euler
difference turns the loops of x and y into each other by the yaw angle, which takes as much off their phase margin.
Float: rad. Fixed: angles bam, half of them into sin_q and cos_q; q Q30, of which -2 vec in Q29 has the same counts.
Source: study of paper 000, sections 0 and 3.
"""

from __future__ import annotations

import math

from firmware_sim.controllers.kinematics import IntTriple, Triple
from firmware_sim.fixed import cos_q, mul_q, shift_round, sin_q, wrap32
from firmware_sim.guidance.reference import wrap_pi
from firmware_sim.jit import callee

Quaternion = tuple[float, float, float, float]
IntQuaternion = tuple[int, int, int, int]


@callee
def error_float(kind: float, sequence: float, y: Triple, r: Triple) -> Triple:
    """e, rad; kind 0 euler, 1 quaternion; sequence 0 for 3-2-1, 1 for 1-2-3."""
    if kind == 0.0:
        return wrap_pi(y[0] - r[0]), wrap_pi(y[1] - r[1]), wrap_pi(y[2] - r[2])
    p, q = quaternion_float(sequence, y), quaternion_float(sequence, r)
    sign = -2.0 if p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] >= 0.0 else 2.0
    ex = sign * (p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2])
    ey = sign * (p[0] * q[2] - p[2] * q[0] - p[3] * q[1] + p[1] * q[3])
    ez = sign * (p[0] * q[3] - p[3] * q[0] - p[1] * q[2] + p[2] * q[1])
    return ex, ey, ez


@callee
def quaternion_float(sequence: float, angles: Triple) -> Quaternion:
    """q of the angles [x, y, z]."""
    sx, cx, sy = math.sin(0.5 * angles[0]), math.cos(0.5 * angles[0]), math.sin(0.5 * angles[1])
    cy, sz, cz = math.cos(0.5 * angles[1]), math.sin(0.5 * angles[2]), math.cos(0.5 * angles[2])
    if sequence != 0.0:
        return (
            cx * cy * cz - sx * sy * sz,
            sx * cy * cz + cx * sy * sz,
            cx * sy * cz - sx * cy * sz,
            cx * cy * sz + sx * sy * cz,
        )
    return (
        cx * cy * cz + sx * sy * sz,
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
    )


@callee
def error_fixed(kind: int, sequence: int, y: IntTriple, r: IntTriple) -> IntTriple:
    """e, rad Q29, of angles in bam."""
    if kind == 0:
        return _rad_fixed(y[0] - r[0]), _rad_fixed(y[1] - r[1]), _rad_fixed(y[2] - r[2])
    p, q = quaternion_fixed(sequence, y), quaternion_fixed(sequence, r)
    w = mul_q(p[0], q[0], 30) + mul_q(p[1], q[1], 30) + mul_q(p[2], q[2], 30) + mul_q(p[3], q[3], 30)
    ex = mul_q(p[1], q[0], 30) - mul_q(p[0], q[1], 30) + mul_q(p[2], q[3], 30) - mul_q(p[3], q[2], 30)
    ey = mul_q(p[2], q[0], 30) - mul_q(p[0], q[2], 30) + mul_q(p[3], q[1], 30) - mul_q(p[1], q[3], 30)
    ez = mul_q(p[3], q[0], 30) - mul_q(p[0], q[3], 30) + mul_q(p[1], q[2], 30) - mul_q(p[2], q[1], 30)
    return (ex, ey, ez) if w >= 0 else (-ex, -ey, -ez)


@callee
def _rad_fixed(difference: int) -> int:
    """rad Q29 of a difference of angles in bam."""
    return mul_q(wrap32(difference), 1686629713, 31)


@callee
def quaternion_fixed(sequence: int, angles: IntTriple) -> IntQuaternion:
    """q, Q30, of the angles [x, y, z] in bam."""
    x, y, z = shift_round(angles[0], 1), shift_round(angles[1], 1), shift_round(angles[2], 1)
    sx, cx, sy, cy, sz, cz = sin_q(x), cos_q(x), sin_q(y), cos_q(y), sin_q(z), cos_q(z)
    cc, ss, sc, cs = mul_q(cy, cz, 30), mul_q(sy, sz, 30), mul_q(sy, cz, 30), mul_q(cy, sz, 30)
    w2, x2, y2, z2 = mul_q(sx, ss, 30), -mul_q(cx, ss, 30), mul_q(sx, cs, 30), -mul_q(sx, sc, 30)
    if sequence != 0:
        w2, x2, y2, z2 = -w2, -x2, -y2, -z2
    return mul_q(cx, cc, 30) + w2, mul_q(sx, cc, 30) + x2, mul_q(cx, sc, 30) + y2, mul_q(cx, cs, 30) + z2
