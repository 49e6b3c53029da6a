"""Euler angles 3-2-1 (yaw first): body acceleration from Euler acceleration, and back; torque scales. All [x, y, z].

With f = phi, t = theta, rates v and Euler accelerations a per sample, y and z the parts before the turn by phi:

    y = a2 + v3 cos t v1                      x = a1 - a3 sin t - v3 cos t v2
    z = a3 cos t - v2 v1 - v3 sin t v2        body acceleration = [x, y cos f + z sin f, z cos f - y sin f]

inverse_* gives the body acceleration, forward_* solves for a with cos t held at 0.2 or more. The body's rate is meant
relative to the frame the angles refer to. Float: rad; fixed: angles in bam, v and a in turn36, where one factor of each
product of rates is taken to rad (Q30). Source: study of paper 004, section 3.1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from firmware_sim.fixed import clip, cos_q, div_trunc, mul_q, norm_shift, sat32, shift_round, sin_q
from firmware_sim.jit import callee

Triple = tuple[float, float, float]
IntTriple = tuple[int, int, int]


@callee
def triple(values: np.ndarray, first: int) -> tuple[Any, Any, Any]:
    """values[first], values[first + 1], values[first + 2]."""
    return values[first], values[first + 1], values[first + 2]


@callee
def inverse_float(angles: Triple, v: Triple, a: Triple) -> Triple:
    """Body acceleration, rad/sample^2; v rad/sample, a rad/sample^2."""
    sf, cf, st, ct = math.sin(angles[0]), math.cos(angles[0]), math.sin(angles[1]), math.cos(angles[1])
    y = a[1] + v[2] * ct * v[0]
    z = a[2] * ct - v[1] * v[0] - v[2] * st * v[1]
    return a[0] - a[2] * st - v[2] * ct * v[1], y * cf + z * sf, z * cf - y * sf


@callee
def forward_float(angles: Triple, v: Triple, b: Triple) -> Triple:
    """Euler acceleration, rad/sample^2, of the body acceleration b."""
    sf, cf, st, ct = math.sin(angles[0]), math.cos(angles[0]), math.sin(angles[1]), math.cos(angles[1])
    y = b[1] * cf - b[2] * sf
    z = b[1] * sf + b[2] * cf + v[1] * v[0] + v[2] * st * v[1]
    a3 = z / max(ct, 0.2)
    return b[0] + a3 * st + v[2] * ct * v[1], y - v[2] * ct * v[0], a3


@callee
def rad_fixed(x: int) -> int:
    """turn36 to rad Q30."""
    return sat32(mul_q(x, 1686629713, 34))


@callee
def inverse_fixed(angles: IntTriple, v: IntTriple, a: IntTriple) -> IntTriple:
    """Body acceleration, turn36; angles bam, v and a turn36."""
    sf, cf, st, ct = sin_q(angles[0]), cos_q(angles[0]), sin_q(angles[1]), cos_q(angles[1])
    r1, r2 = rad_fixed(v[0]), rad_fixed(v[1])
    v3_ct = mul_q(v[2], ct, 30)
    x = a[0] - mul_q(a[2], st, 30) - mul_q(v3_ct, r2, 30)
    y = sat32(a[1] + mul_q(v3_ct, r1, 30))
    z = sat32(mul_q(a[2], ct, 30) - mul_q(v[1], r1, 30) - mul_q(mul_q(v[2], st, 30), r2, 30))
    return sat32(x), sat32(mul_q(y, cf, 30) + mul_q(z, sf, 30)), sat32(mul_q(z, cf, 30) - mul_q(y, sf, 30))


@callee
def forward_fixed(angles: IntTriple, v: IntTriple, b: IntTriple) -> IntTriple:
    """Euler acceleration, turn36, of the body acceleration b, turn36."""
    sf, cf, st, ct = sin_q(angles[0]), cos_q(angles[0]), sin_q(angles[1]), cos_q(angles[1])
    r1, r2 = rad_fixed(v[0]), rad_fixed(v[1])
    v3_ct = mul_q(v[2], ct, 30)
    y = mul_q(b[1], cf, 30) - mul_q(b[2], sf, 30)
    z = mul_q(b[1], sf, 30) + mul_q(b[2], cf, 30) + mul_q(v[1], r1, 30) + mul_q(mul_q(v[2], st, 30), r2, 30)
    a3 = sat32(div_trunc(shift_round(sat32(z), -30), ct if ct > 214748365 else 214748365))
    return sat32(b[0] + mul_q(a3, st, 30) + mul_q(v3_ct, r2, 30)), sat32(y - mul_q(v3_ct, r1, 30)), a3


# -- torque <-> acceleration per sample: a mantissa of 31 bits and a shift each ----------------------------------------

# 1e-12 / (2 pi): turns of acceleration per sample^2 from torque/inertia and a period in us, as mantissa 2^-73.
TURNS_PER_US2_Q73 = 1503175938


def drive_fixed(period_us: int, inertia_q26: int) -> tuple[int, int]:
    """(m, n) with turn36/sample^2 = torque (N m Q28) m 2^-n: T_s^2 2^36 / (2 pi I 2^28)."""
    square = mul_q(period_us, period_us, 0)
    s = norm_shift(square)
    quotient = div_trunc(mul_q(shift_round(square, -s), TURNS_PER_US2_Q73, 0), inertia_q26)
    t = norm_shift(quotient)
    return clip(shift_round(quotient, -t), 0, 2147483647), s + t + 73 - 26 - 8


def demand_fixed(mantissa: int, shift: int) -> tuple[int, int]:
    """The inverse of drive_fixed(): (m, n) with torque (N m Q28) = turn36/sample^2 m 2^-n."""
    return clip(div_trunc(1 << 61, mantissa), 0, 2147483647), 61 - shift


def torque_scales_fixed(period_us: int, inertia_q26: Sequence[int]) -> list[int]:
    """Twelve parameters: mantissas of demand x, y, z, of drive x, y, z, shifts of demand, shifts of drive."""
    drive = [drive_fixed(period_us, inertia) for inertia in inertia_q26]
    demand = [demand_fixed(m, n) for m, n in drive]
    return [*(m for m, _ in demand), *(m for m, _ in drive), *(n for _, n in demand), *(n for _, n in drive)]
