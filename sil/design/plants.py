"""What is controlled: one axis of a rigid body, and a delay as a rational function.

G(s) = 1 / (J s^2), angle per torque. A compensator is designed for J = 1 (angular acceleration) and multiplied by J
of each axis afterwards, which gives the same loop.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from sil.design.linear import StateSpace, TransferFunction, state_space, transfer_function
from sil.trouble import UsageError

PADE_ORDERS = (1, 2, 3, 4)
SHORTEST = 1e-3


def double_integrator(inertia: float = 1.0, rate_too: bool = False) -> StateSpace:
    """States angle and rate; output angle, or both."""
    C = np.eye(2) if rate_too else np.array([[1.0, 0.0]])
    return StateSpace(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / inertia]]), C, np.zeros((len(C), 1)))


def pade(delay_s: float, order: int) -> TransferFunction:
    """e^(-s T) as p(-s) / p(s), p(s) = sum of c_k (s T)^k, c_k = (2n-k)! n! / ((2n)! k! (n-k)!): all-pass, gain 1."""
    if order not in PADE_ORDERS:
        raise UsageError(f"Pade order: expected one of {', '.join(map(str, PADE_ORDERS))}, got {order}")
    if delay_s == 0.0:
        return transfer_function([1.0], [1.0])
    n = order
    c = [
        factorial(2 * n - k) * factorial(n) / (factorial(2 * n) * factorial(k) * factorial(n - k)) for k in range(n + 1)
    ]
    powers = range(n, -1, -1)
    return transfer_function([c[k] * (-delay_s) ** k for k in powers], [c[k] * delay_s**k for k in powers])


def late(delay_s: float, order: int, rate_radps: float) -> StateSpace:
    """pade() in the time 1 / rate, with states made for a delay of 1: powers of a short one would swamp all others.

    A delay below SHORTEST of that time changes nothing, but its poles are so fast that no margin is found: refused.
    """
    delay = delay_s * rate_radps
    if 0.0 < delay < SHORTEST:
        least = SHORTEST / rate_radps
        raise UsageError(f"delay: expected 0, or at least {least:.3g} s beside these rates, got {delay_s:g}")
    return state_space(pade(1.0, order)).faster(1.0 / delay) if delay else state_space(pade(0.0, order))
