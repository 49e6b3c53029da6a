"""One-input fuzzy inference of three sets: |f(e)| / L of a = min(|e| / E, 1), in closed form or from a table.

    closed   f = a^2 (3 - a) / (3 (2 - a^2))
    table    t[i] at a = i / 64, i = 0 .. 64, straight lines between

The closed form is the centroid on [-L, L] of the min-max Mamdani inference with triangles that overlap by half: inputs
N Z P with peaks -E, 0, E, outputs H N L with peaks L, 0, -L, rules N -> H, Z -> N, P -> L, so f has the sign of -e.
Its slope at zero is 0, its largest value 2/3. Fixed: a and f Q15; the numerator reaches 2^31, so 64 bits; error 6.9e-5.
Source: study of paper 000, section 3.1.
"""

from __future__ import annotations

import numpy as np

from firmware_sim.fixed import div_trunc, mul_q
from firmware_sim.jit import callee


@callee
def closed_float(a: float) -> float:
    """|f| / L for 0 <= a <= 1."""
    return a * a * (3.0 - a) / (3.0 * (2.0 - a * a))


@callee
def closed_fixed(a: int) -> int:
    """|f| / L, Q15, for 0 <= a <= 1 in Q15."""
    square = div_trunc(mul_q(a, a, 0), 32768)
    return div_trunc(mul_q(square, 98304 - a, 0), mul_q(3, 65536 - square, 0))


@callee
def table_float(par: np.ndarray, first: int, a: float) -> float:
    """The table par[first : first + 65] at 0 <= a <= 1."""
    i = min(int(64.0 * a), 63)
    low: float = par[first + i]
    high: float = par[first + i + 1]
    return low + (high - low) * (64.0 * a - i)


@callee
def table_fixed(par: np.ndarray, first: int, a: int) -> int:
    """The table par[first : first + 65], Q15, at 0 <= a <= 1 in Q15."""
    i = min(div_trunc(a, 512), 63)
    low: int = par[first + i]
    return low + mul_q(par[first + i + 1] - low, a - mul_q(i, 512, 0), 9)
