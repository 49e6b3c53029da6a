"""Rotations: quaternions, direction-cosine matrices, Euler angles of both sequences; scalar code that numba inlines.

Quaternions are scalar first, Hamilton, and map body to reference components: v_R = q v_B q*. C = C_BR maps reference to
body components, v_B = C v_R, so C is the transpose of the matrix usually written R(q).
Sequences (triples are always [x, y, z] = [phi, theta, psi]):
  321: C_BR = R1(phi) R2(theta) R3(psi), passive, yaw first (papers 004, 001)
  123: q = qx(phi) (x) qy(theta) (x) qz(psi), intrinsic 1-2-3 (paper 000), so C_BR = (Rx Ry Rz)^T with active R.
"""

from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable

from sil.signals import Vector


@register_jitable
def dcm_of_q(q: Vector, C: Vector) -> None:
    """C (3,3) <- C_BR of the unit quaternion q (4,)."""
    s, x, y, z = q[0], q[1], q[2], q[3]
    C[0, 0] = s * s + x * x - y * y - z * z
    C[0, 1] = 2.0 * (x * y + s * z)
    C[0, 2] = 2.0 * (x * z - s * y)
    C[1, 0] = 2.0 * (x * y - s * z)
    C[1, 1] = s * s - x * x + y * y - z * z
    C[1, 2] = 2.0 * (y * z + s * x)
    C[2, 0] = 2.0 * (x * z + s * y)
    C[2, 1] = 2.0 * (y * z - s * x)
    C[2, 2] = s * s - x * x - y * y + z * z


@register_jitable
def euler_of_dcm(C: Vector, sequence: int, euler: Vector) -> None:
    """euler (3,) <- [phi, theta, psi] in rad of C_BR (3,3); phi and psi in (-pi, pi], theta in [-pi/2, pi/2]."""
    if sequence == 321:
        euler[0] = math.atan2(C[1, 2], C[2, 2])
        euler[1] = math.atan2(-C[0, 2], math.hypot(C[0, 0], C[0, 1]))
        euler[2] = math.atan2(C[0, 1], C[0, 0])
    else:
        euler[0] = math.atan2(-C[2, 1], C[2, 2])
        euler[1] = math.atan2(C[2, 0], math.hypot(C[0, 0], C[1, 0]))
        euler[2] = math.atan2(-C[1, 0], C[0, 0])


@register_jitable
def orbit_axes(u_rad: float, cos_i: float, sin_i: float, C_ON: Vector) -> None:
    """C_ON (3,3) <- rows along-track, -orbit normal, nadir in N, at argument of latitude u; ascending node on N x."""
    c, s = math.cos(u_rad), math.sin(u_rad)
    C_ON[0, 0], C_ON[0, 1], C_ON[0, 2] = -s, c * cos_i, c * sin_i
    C_ON[1, 0], C_ON[1, 1], C_ON[1, 2] = 0.0, sin_i, -cos_i
    C_ON[2, 0], C_ON[2, 1], C_ON[2, 2] = -c, -s * cos_i, -s * sin_i


def dcm_of_euler(euler_rad: Vector, sequence: int) -> Vector:
    """C_BR (3,3) of the angles [phi, theta, psi] in rad; sequence 321 or 123."""
    (cf, ct, cp), (sf, st, sp) = np.cos(euler_rad), np.sin(euler_rad)
    if sequence == 321:
        return np.array(
            [
                [ct * cp, ct * sp, -st],
                [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
                [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct],
            ]
        )
    return np.array(
        [
            [ct * cp, cf * sp + sf * st * cp, sf * sp - cf * st * cp],
            [-ct * sp, cf * cp - sf * st * sp, sf * cp + cf * st * sp],
            [st, -sf * ct, cf * ct],
        ]
    )


def q_of_dcm(C: Vector) -> Vector:
    """Unit quaternion (4,) with q[0] >= 0 of C_BR (3,3); the largest component is found first (Shepperd)."""
    trace = float(np.trace(C))
    squares = np.array([trace, C[0, 0], C[1, 1], C[2, 2]]) * 2.0 + (1.0 - trace)
    largest = int(np.argmax(squares))
    sums = np.array(
        [
            [squares[0], C[1, 2] - C[2, 1], C[2, 0] - C[0, 2], C[0, 1] - C[1, 0]],
            [C[1, 2] - C[2, 1], squares[1], C[0, 1] + C[1, 0], C[2, 0] + C[0, 2]],
            [C[2, 0] - C[0, 2], C[0, 1] + C[1, 0], squares[2], C[1, 2] + C[2, 1]],
            [C[0, 1] - C[1, 0], C[2, 0] + C[0, 2], C[1, 2] + C[2, 1], squares[3]],
        ]
    )
    q: Vector = sums[largest] / np.linalg.norm(sums[largest])
    return -q if q[0] < 0 else q


def body_rate_of_euler_rate(euler_rad: Vector, euler_rate: Vector, sequence: int) -> Vector:
    """omega_BR_B (3,) rad/s from [phi', theta', psi'] rad/s at the angles [phi, theta, psi] rad."""
    (cf, ct, cp), (sf, st, sp) = np.cos(euler_rad), np.sin(euler_rad)
    if sequence == 321:
        B = np.array([[1.0, 0.0, -st], [0.0, cf, sf * ct], [0.0, -sf, cf * ct]])
    else:
        B = np.array([[ct * cp, sp, 0.0], [-ct * sp, cp, 0.0], [st, 0.0, 1.0]])
    rate: Vector = B @ euler_rate
    return rate
