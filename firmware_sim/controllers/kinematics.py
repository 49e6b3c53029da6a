"""Euler angles 3-2-1 (yaw first), triples [x, y, z]: body acceleration from Euler acceleration, and back.

With rates and accelerations per sample, f = phi, t = theta, a = Euler acceleration, v = Euler rate:

    inverse:  p' = a1 - a3 sin t - v3 cos t v2
              q' = a2 cos f + a3 sin f cos t - v2 sin f v1 + v3 (cos f v1 cos t - sin f sin t v2)
              r' = -a2 sin f + a3 cos f cos t - v2 cos f v1 + v3 (-sin f v1 cos t - cos f sin t v2)
    forward:  the solution for a, cos t held at 0.2 or more

(p, q, r) = body rate relative to the frame the angles refer to. Floats in rad; fixed: angles in bam, v and a in turn36,
where one factor of each product of rates is taken to rad (Q30). Source: study of paper 004, section 3.1.
"""

from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable

from firmware_sim.fixed import cos_q, div_trunc, mul_q, sat32, shift_round, sin_q

COS_MIN = 0.2
COS_MIN_Q30 = 214748365
TWO_PI_Q28 = 1686629713


@register_jitable
def inverse_float(eta: np.ndarray, v: np.ndarray, a: np.ndarray, out: np.ndarray) -> None:
    """out (3,) <- body acceleration; eta rad, v rad/sample, a rad/sample^2, all (3,)."""
    sf, cf, st, ct = math.sin(eta[0]), math.cos(eta[0]), math.sin(eta[1]), math.cos(eta[1])
    out[0] = a[0] - a[2] * st - v[2] * ct * v[1]
    out[1] = a[1] * cf + a[2] * sf * ct - v[1] * sf * v[0] + v[2] * (cf * v[0] * ct - sf * st * v[1])
    out[2] = -a[1] * sf + a[2] * cf * ct - v[1] * cf * v[0] + v[2] * (-sf * v[0] * ct - cf * st * v[1])


@register_jitable
def forward_float(eta: np.ndarray, v: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """out (3,) <- Euler acceleration of the body acceleration b (3,)."""
    sf, cf, st, ct = math.sin(eta[0]), math.cos(eta[0]), math.sin(eta[1]), math.cos(eta[1])
    q = b[1] + v[1] * sf * v[0] - v[2] * (cf * v[0] * ct - sf * st * v[1])
    r = b[2] + v[1] * cf * v[0] - v[2] * (-sf * v[0] * ct - cf * st * v[1])
    out[1] = cf * q - sf * r
    out[2] = (sf * q + cf * r) / max(ct, COS_MIN)
    out[0] = b[0] + out[2] * st + v[2] * ct * v[1]


@register_jitable
def rad_q30(x: int) -> int:
    """turn36 to rad Q30."""
    return sat32(mul_q(x, TWO_PI_Q28, 34))


@register_jitable
def inverse_fixed(eta: np.ndarray, v: np.ndarray, a: np.ndarray, out: np.ndarray) -> None:
    """out (3,) <- body acceleration, turn36; eta bam, v and a turn36, all (3,)."""
    sf, cf, st, ct = sin_q(eta[0]), cos_q(eta[0]), sin_q(eta[1]), cos_q(eta[1])
    v1, v2 = rad_q30(v[0]), rad_q30(v[1])
    v3_ct, a3_ct, v3_st = mul_q(v[2], ct, 30), mul_q(a[2], ct, 30), mul_q(v[2], st, 30)
    out[0] = sat32(a[0] - mul_q(a[2], st, 30) - mul_q(v3_ct, v2, 30))
    # in the frame after roll: the y and z parts before they are turned by phi
    y = sat32(a[1] + mul_q(v3_ct, v1, 30))
    z = sat32(a3_ct - mul_q(v[1], v1, 30) - mul_q(v3_st, v2, 30))
    out[1] = sat32(mul_q(y, cf, 30) + mul_q(z, sf, 30))
    out[2] = sat32(mul_q(z, cf, 30) - mul_q(y, sf, 30))


@register_jitable
def forward_fixed(eta: np.ndarray, v: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """out (3,) <- Euler acceleration, turn36, of the body acceleration b (3,), turn36."""
    sf, cf, st, ct = sin_q(eta[0]), cos_q(eta[0]), sin_q(eta[1]), cos_q(eta[1])
    v1, v2 = rad_q30(v[0]), rad_q30(v[1])
    v3_ct, v3_st = mul_q(v[2], ct, 30), mul_q(v[2], st, 30)
    y = sat32(mul_q(b[1], cf, 30) - mul_q(b[2], sf, 30))
    z = sat32(mul_q(b[1], sf, 30) + mul_q(b[2], cf, 30))
    z = sat32(z + mul_q(v[1], v1, 30) + mul_q(v3_st, v2, 30))
    out[1] = sat32(y - mul_q(v3_ct, v1, 30))
    out[2] = sat32(div_trunc(shift_round(z, -30), ct if ct > COS_MIN_Q30 else COS_MIN_Q30))
    out[0] = sat32(b[0] + mul_q(out[2], st, 30) + mul_q(v3_ct, v2, 30))
