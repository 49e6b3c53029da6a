"""One gain g from x = c g: both signals filtered alike, then scalar recursive least squares without forgetting.

    filter      two lowpasses with pole 0.8, minus a slow lowpass with pole 0.97: noise and constant torques drop out
    learn       if |c| > 1e-4:  P = min(P + 1e-6, 0.1);  G = P c / (1e-7 + c^2 P);  g += G (x - c g);  P -= G c P
                0.6 <= g <= 1.7

x and c in rad/sample^2 (fixed: filters in turn36, then rad Q35; g Q28, P Q34). Source: study of paper 004, section 3.1.
"""

from __future__ import annotations

import numpy as np

from firmware_sim.controllers.kinematics import IntTriple, Triple
from firmware_sim.fixed import clip, div_trunc, mul_q, sat32, shift_round, sub_sat, wrap32
from firmware_sim.guidance.reference import wrap_pi
from firmware_sim.jit import callee


@callee
def second_differences_float(y: Triple, y1: Triple, y2: Triple) -> Triple:
    """y - 2 y1 + y2, rad."""
    z0 = wrap_pi(y[0] - y1[0]) - wrap_pi(y1[0] - y2[0])
    z1 = wrap_pi(y[1] - y1[1]) - wrap_pi(y1[1] - y2[1])
    return z0, z1, wrap_pi(y[2] - y1[2]) - wrap_pi(y1[2] - y2[2])


@callee
def second_differences_fixed(y: IntTriple, y1: IntTriple, y2: IntTriple) -> IntTriple:
    """y - 2 y1 + y2: bam to turn36."""
    z0 = wrap32(y[0] - y1[0]) - wrap32(y1[0] - y2[0])
    z1 = wrap32(y[1] - y1[1]) - wrap32(y1[1] - y2[1])
    z2 = wrap32(y[2] - y1[2]) - wrap32(y1[2] - y2[2])
    return sat32(shift_round(z0, -4)), sat32(shift_round(z1, -4)), sat32(shift_round(z2, -4))


@callee
def washed_float(s: np.ndarray, base: int, i: int, x: float) -> float:
    """The filtered x; its three states are s[base + 3 i : base + 3 i + 3]."""
    s[base + 3 * i] += 0.2 * (x - s[base + 3 * i])
    s[base + 3 * i + 1] += 0.2 * (s[base + 3 * i] - s[base + 3 * i + 1])
    s[base + 3 * i + 2] += 0.03 * (s[base + 3 * i + 1] - s[base + 3 * i + 2])
    washed: float = s[base + 3 * i + 1] - s[base + 3 * i + 2]
    return washed


@callee
def learn_float(g: float, p: float, x: float, c: float) -> tuple[float, float]:
    """(g, P) after one measurement."""
    if abs(c) <= 1e-4:
        return g, p
    p = min(p + 1e-6, 0.1)
    gain = p * c / (1e-7 + c * c * p)
    return min(max(g + gain * (x - c * g), 0.6), 1.7), p - gain * c * p


@callee
def washed_fixed(s: np.ndarray, base: int, i: int, x: int) -> int:
    """turn36 in, rad Q35 out (limited to 1/16 rad); 0.2 and 0.03 in Q30."""
    s[base + 3 * i] = sat32(s[base + 3 * i] + mul_q(x - s[base + 3 * i], 214748365, 30))
    s[base + 3 * i + 1] = sat32(s[base + 3 * i + 1] + mul_q(s[base + 3 * i] - s[base + 3 * i + 1], 214748365, 30))
    s[base + 3 * i + 2] = sat32(s[base + 3 * i + 2] + mul_q(s[base + 3 * i + 1] - s[base + 3 * i + 2], 32212255, 30))
    return sat32(mul_q(sub_sat(s[base + 3 * i + 1], s[base + 3 * i + 2]), 843314857, 28))


@callee
def learn_fixed(g: int, p: int, x: int, c: int) -> tuple[int, int]:
    """(g, P): x, c rad Q35; P Q34, P c Q44, denominator Q50, G Q20, g Q28."""
    if abs(c) <= 3435974:
        return g, p
    p = min(p + 17180, 1717986918)
    pc = mul_q(p, c, 25)
    denominator = 112589991 + mul_q(shift_round(pc, 7), c, 22)
    gain = sat32(div_trunc(shift_round(pc, -26), denominator))
    error = sat32(x - mul_q(c, g, 28))
    g = clip(g + mul_q(gain, error, 27), 161061274, 456340275)
    return g, clip(p - mul_q(sat32(mul_q(gain, c, 25)), p, 30), 0, 1717986918)
