"""Exact discretisation by the matrix exponential: no pole moves to where it does not belong, at any period.

| method | exact where the input is | delay it adds | order |
|---|---|---|---|
| ramp | a straight line from sample to sample | none | same; D becomes C G + D |
| zoh | held from sample to sample | half a period | same |
| tustin | never: s = 2/T (z - 1)/(z + 1) | none | same |

The reading of an angle is a sample of something smooth, so `ramp` is nearer to the continuous compensator. Tustin maps
a pole faster than 2/T to the negative real axis, where it changes sign at every sample: refused there.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from sil.design.linear import StateSpace
from sil.trouble import UsageError

METHODS = ("ramp", "zoh", "tustin")


def discretised(system: StateSpace, period_s: float, method: str = "ramp") -> StateSpace:
    """The discrete system with this period; raises UsageError."""
    if method not in METHODS:
        raise UsageError(f"method: expected one of {', '.join(METHODS)}, got {method}")
    return {"ramp": ramp, "zoh": zoh, "tustin": tustin}[method](system, period_s)


def zoh(system: StateSpace, period_s: float) -> StateSpace:
    """exp of [[A, B], [0, 0]] T holds both matrices: e^(A T), and the integral of e^(A t) B."""
    n, m = system.B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = system.A, system.B
    whole = expm(block * period_s)
    return StateSpace(whole[:n, :n], whole[:n, n:], system.C, system.D, period_s)


def ramp(system: StateSpace, period_s: float) -> StateSpace:
    """x(k+1) = F x(k) + G1 u(k) + G2 (u(k+1) - u(k)); z = x - G2 u needs no u(k+1)."""
    n, m = system.B.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m] = system.A * period_s, system.B * period_s
    block[n : n + m, n + m :] = np.eye(m)
    whole = expm(block)
    F, G1, G2 = whole[:n, :n], whole[:n, n : n + m], whole[:n, n + m :]
    return StateSpace(F, G1 - G2 + F @ G2, system.C, system.D + system.C @ G2, period_s)


def tustin(system: StateSpace, period_s: float) -> StateSpace:
    """The bilinear rule; raises UsageError where a pole is faster than 2/T."""
    fastest = float(np.max(np.abs(system.poles), initial=0.0))
    if fastest * period_s >= 2.0:
        raise UsageError(
            f"method tustin: expected poles slower than 2/period = {2.0 / period_s:g} rad/s, got {fastest:.4g}; "
            "ramp and zoh are exact"
        )
    half = system.A * period_s / 2.0
    M = np.linalg.inv(np.eye(system.order) - half)
    A, B = M @ (np.eye(system.order) + half), M @ system.B * period_s
    return StateSpace(A, B, system.C @ M, system.D + system.C @ M @ system.B * period_s / 2.0, period_s)
