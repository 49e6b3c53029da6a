"""H-infinity loop shaping after Glover and McFarlane: shape the loop first, then make it as robust as it can be.

1. Shaped plant Gs = W Pade(delay) / s^2 (J = 1), W = k (s + wc/alpha) / (s + rolloff wc) [(s + wi) / s], k so that
   |W(j wc)| / wc^2 = 1: alpha says how far below the crossover the slope becomes -1, rolloff where W ends.
2. Gs = M^-1 N, normalised coprime factors. The least gamma for which one K stabilises (M + dM)^-1 (N + dN) for every
   ||dM dN|| < 1/gamma is gamma_min = sqrt(1 + rho(X Z)), X and Z the solutions of the two Riccati equations.
3. K for gamma = factor * gamma_min in closed form, C = W K: u = C(s) (ref - y).

Source: Glover and McFarlane 1989; the formulas as in Skogestad and Postlethwaite, Multivariable Feedback Control, 9.4
(D = 0 here, since the plant has two poles more than zeros). For 1/s^2 alone gamma_min = sqrt(4 + 2 sqrt 2) = 2.613.
Solved in the time 1 / wc, where all numbers are near 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_continuous_are

from sil.design.linear import StateSpace, TransferFunction, series, state_space, transfer_function
from sil.design.plants import double_integrator, late
from sil.trouble import UsageError

LEAST_FACTOR, MOST_FACTOR = 1.0001, 100.0  # K has a pole that goes to infinity as the factor goes to 1


class Shape(NamedTuple):
    """The weight W. Rates in rad/s."""

    crossover: float
    alpha: float = 4.0
    rolloff: float = 8.0
    integral: float = 0.0


class Design(NamedTuple):
    """The compensator for J = 1; 1/gamma is the stability margin against coprime factor uncertainty."""

    compensator: StateSpace
    weight: TransferFunction
    gamma_min: float
    gamma: float


def glover(shape: Shape, delay_s: float = 0.0, pade_order: int = 2, factor: float = 1.1) -> Design:
    """The compensator of order 4 + Pade, + 2 with integral action."""
    if not LEAST_FACTOR <= factor <= MOST_FACTOR:
        expected = f"{LEAST_FACTOR:g} to {MOST_FACTOR:g} times the least, for which there is no compensator"
        raise UsageError(f"gamma: expected {expected}, got {factor}")
    rate = shape.crossover
    W = weight(shape._replace(crossover=1.0, integral=shape.integral / rate))
    shaped = series(series(state_space(W), late(delay_s, pade_order, rate)), double_integrator())
    K, least = robust(shaped, factor)
    C = series(K, state_space(W)).faster(rate).scaled(rate**2)
    return Design(C, weight(shape), least, factor * least)


def weight(shape: Shape) -> TransferFunction:
    """W(s)."""
    wc = shape.crossover
    num, den = np.array([1.0, wc / shape.alpha]), np.array([1.0, shape.rolloff * wc])
    if shape.integral:
        num, den = np.polymul(num, [1.0, shape.integral]), np.polymul(den, [1.0, 0.0])
    gain = wc**2 / abs(transfer_function(num, den)(1j * wc))
    return transfer_function(gain * num, den)


def robust(plant: StateSpace, factor: float) -> tuple[StateSpace, float]:
    """(K, gamma_min) of a strictly proper plant; K for negative feedback, u = K (ref - y)."""
    A, B, C = plant.A, plant.B, plant.C
    X = solve_continuous_are(A, B, C.T @ C, np.eye(B.shape[1]))
    Z = solve_continuous_are(A.T, C.T, B @ B.T, np.eye(C.shape[0]))
    least = float(np.sqrt(1.0 + np.max(np.abs(np.linalg.eigvals(X @ Z)))))
    gamma2 = (factor * least) ** 2
    H = gamma2 * np.linalg.solve(((1.0 - gamma2) * np.eye(len(A)) + X @ Z).T, Z @ C.T)
    # For positive feedback K = (A - BB'X + HC, H, B'X); here the sign stands in the output.
    return StateSpace(A - B @ B.T @ X + H @ C, H, -B.T @ X, np.zeros((B.shape[1], C.shape[0]))), least
