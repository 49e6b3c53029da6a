"""Recursive least squares of five parameters with forgetting and a bounded trace.

    G = F phi / (l + phi' F phi);  theta += G e;  F = (F - G phi' F) / l;  l = forgetting, but 1 while trace F >= bound

`s` holds theta (5 numbers from `theta`), F (25 from `f`, row by row) and, from `work`, phi (5), F phi (5) and G (5).
Fixed: theta, phi, e, G Q28, F Q20 (int32, symmetric: the upper triangle is computed and copied), F phi Q40.
Plain int32 covariance survives only with the bounded trace. Source: study of paper 004, sections 3.2 and 4.
"""

from __future__ import annotations

import numpy as np

from firmware_sim.fixed import div_trunc, keep32, mul_q, mul_wide, shift_round
from firmware_sim.jit import callee


@callee
def identify_float(s: np.ndarray, theta: int, f: int, work: int, forgetting: float, trace_max: float, e: float) -> None:
    """One measurement with error e = y - phi theta."""
    trace = s[f] + s[f + 6] + s[f + 12] + s[f + 18] + s[f + 24]
    if trace >= trace_max:
        forgetting = 1.0
    denominator = forgetting
    for m in range(5):
        s[work + 5 + m] = 0.0
        for n in range(5):
            s[work + 5 + m] += s[f + 5 * m + n] * s[work + n]
        denominator += s[work + 5 + m] * s[work + m]
    for m in range(5):
        s[work + 10 + m] = s[work + 5 + m] / denominator
        s[theta + m] += s[work + 10 + m] * e
        for n in range(5):
            s[f + 5 * m + n] = (s[f + 5 * m + n] - s[work + 10 + m] * s[work + 5 + n]) / forgetting


@callee
def identify_fixed(
    s: np.ndarray,
    theta: int,
    f: int,
    work: int,
    forgetting: int,
    forgetting_inv: int,
    trace_max: int,
    e: int,
    flag: int,
) -> None:
    """As identify_float(); forgetting and its inverse Q30, bound Q20; s[flag] becomes 1 if a number had to be limited.

    If rounding brought the denominator below its least value, F and theta stay as they are.
    """
    trace = s[f] + s[f + 6] + s[f + 12] + s[f + 18] + s[f + 24]
    least, scale = shift_round(forgetting, 2), forgetting_inv
    if trace >= trace_max:
        least, scale = 268435456, 1073741824
    denominator = least
    for m in range(5):
        s[work + 5 + m] = 0
        for n in range(5):
            s[work + 5 + m] += mul_q(s[f + 5 * m + n], s[work + n], 8)
        denominator += mul_wide(s[work + 5 + m], s[work + m], 40)
    if denominator < least:
        s[flag] = 1
        return
    inverse = div_trunc(1 << 58, denominator)  # Q30
    for m in range(5):
        s[work + 10 + m] = keep32(mul_wide(s[work + 5 + m], inverse, 42), s, flag)
        s[theta + m] = keep32(s[theta + m] + mul_q(s[work + 10 + m], e, 28), s, flag)
        for n in range(m, 5):
            rest = shift_round(s[f + 5 * m + n], -10) - mul_wide(s[work + 5 + n], s[work + 10 + m], 38)
            s[f + 5 * m + n] = keep32(mul_wide(rest, scale, 40), s, flag)
            s[f + 5 * n + m] = s[f + 5 * m + n]
