"""What is controlled: one axis of a rigid body, and a delay as a rational function.

G(s) = 1 / (J s^2), angle per torque. A compensator is designed for J = 1 (angular acceleration) and multiplied by J
of each axis afterwards, which gives the same loop.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from sil.design.linear import StateSpace, TransferFunction, transfer_function
from sil.trouble import UsageError

PADE_ORDERS = (1, 2, 3, 4)


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
