"""LQG: the H2-optimal compensator of a double integrator behind a delay, from two Riccati equations.

    theta'' = u(t - delay) + d + w1,    d' = w2,    y = theta + v          (J = 1)

Cost: the mean of theta^2 + u^2 / wc^4. Intensities: w1 wo^4, w2 wi^2 wo^4, v 1. Without delay the regulator puts its
poles at wc (-1 +- j)/sqrt(2), the observer, if wi = 0, at wo (-1 +- j)/sqrt(2). Pade of the delay stands before the
torque noise. d cannot be controlled, only cancelled: u = -K (x_hat - x0 u0) + u0, u0 = -d_hat, x0 what stands in the
states of the delay for u = 1. So wi > 0 gives the compensator an integrator, and Kd = 1 + K x0:

    C(s) = [K Kd] (sI - A + B [K Kd] + L C)^-1 L,   u = C(s) (ref - y)

It is solved in the time 1 / sqrt(wc wo), where all numbers are near 1: in seconds, weights of 1e12 against 1e-10 would
leave the Riccati equations of a slow design no digits.

Paper 000, (5.1) and (5.3): both are this with J wc^2 = 1e-3, J wo^2 = 1, wi = 1 (J 0.01 and 400), no delay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_continuous_are

from sil.design.linear import Array, StateSpace, series
from sil.design.plants import double_integrator, late


class Weights(NamedTuple):
    """Bandwidths in rad/s: of the regulator, of the observer, of the integral action (0: none)."""

    control: float
    observer: float
    integral: float = 0.0


def lqg(weights: Weights, delay_s: float = 0.0, pade_order: int = 2) -> StateSpace:
    """The compensator for J = 1: order 2, + Pade, + 1 with integral action."""
    rate = math.sqrt(weights.control * weights.observer)
    unit = Weights(*(each / rate for each in weights))
    return _solved(unit, late(delay_s, pade_order, rate)).faster(rate).scaled(rate**2)


def _solved(weights: Weights, delay: StateSpace) -> StateSpace:
    plant = series(delay, double_integrator())
    n = plant.order
    K = regulator(plant, np.diag([0.0] * (n - 2) + [1.0, 0.0]), weights.control**-4)
    torque_noise = weights.observer**4
    W = np.diag([0.0] * (n - 1) + [torque_noise])
    if weights.integral:
        K = np.hstack([K, [[1.0 + float(K[0] @ _under_way(plant))]]])
        plant, W = _with_disturbance(plant), block_diag(W, weights.integral**2 * torque_noise)
    L = observer(plant, W, 1.0)
    return StateSpace(plant.A - plant.B @ K - L @ plant.C, L, K, np.zeros((1, 1)))


def regulator(plant: StateSpace, Q: Array, r: float) -> Array:
    """K (1, n) that minimises the integral of x'Qx + r u^2 with u = -K x."""
    X = solve_continuous_are(plant.A, plant.B, Q, np.array([[r]]))
    return np.asarray(plant.B.T @ X / r)


def observer(plant: StateSpace, W: Array, v: float) -> Array:
    """L (n, 1), the Kalman gain for state noise of intensity W and noise v of the reading."""
    Z = solve_continuous_are(plant.A.T, plant.C.T, W, np.array([[v]]))
    return np.asarray(Z @ plant.C.T / v)


def _under_way(plant: StateSpace) -> Array:
    """States for a constant torque of 1 that something cancels: those of the delay, -Ap^-1 Bp; angle and rate 0."""
    n = plant.order - 2
    return np.concatenate([-np.linalg.solve(plant.A[:n, :n], plant.B[:n, 0]), [0.0, 0.0]])


def _with_disturbance(plant: StateSpace) -> StateSpace:
    """One more state, a constant acceleration that acts where the torque does, behind the delay."""
    n = plant.order
    entry = np.zeros((n, 1))
    entry[n - 1] = 1.0
    A = np.block([[plant.A, entry], [np.zeros((1, n + 1))]])
    return StateSpace(A, np.vstack([plant.B, [[0.0]]]), np.hstack([plant.C, [[0.0]]]), plant.D)
