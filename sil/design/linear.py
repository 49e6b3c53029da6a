"""Linear systems: state space, transfer functions, how they are connected, what they answer to a sine.

Continuous x' = A x + B u, y = C x + D u, or discrete x(k+1) = A x(k) + B u(k) with a period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class StateSpace(NamedTuple):
    """A (n, n), B (n, inputs), C (outputs, n), D (outputs, inputs); period_s None: continuous."""

    A: Array
    B: Array
    C: Array
    D: Array
    period_s: float | None = None

    @property
    def order(self) -> int:
        return len(self.A)

    @property
    def poles(self) -> Complex:
        return np.linalg.eigvals(self.A).astype(complex) if self.order else np.zeros(0, complex)

    @property
    def is_stable(self) -> bool:
        """Left half plane, or unit circle, without its edge."""
        if self.period_s is None:
            return bool(np.all(self.poles.real < 0.0))
        return bool(np.all(np.abs(self.poles) < 1.0))

    def response(self, omega_radps: ArrayLike) -> Complex:
        """C (zI - A)^-1 B + D at z = j omega, or e^(j omega T): (len(omega), outputs, inputs)."""
        omega = np.atleast_1d(np.asarray(omega_radps, float))
        z = 1j * omega if self.period_s is None else np.exp(1j * omega * self.period_s)
        resolvent = z[:, None, None] * np.eye(self.order) - self.A
        B = np.broadcast_to(self.B.astype(complex), (len(omega), *self.B.shape))
        return np.asarray(self.C @ np.linalg.solve(resolvent, B) + self.D)

    def at(self, s: float) -> float:
        """C (sI - A)^-1 B + D of one input and output at a real s."""
        return float((self.C @ np.linalg.solve(s * np.eye(self.order) - self.A, self.B) + self.D)[0, 0])

    def scaled(self, gain: float) -> StateSpace:
        """The same times a gain at its output."""
        return self._replace(C=self.C * gain, D=self.D * gain)

    def faster(self, rate: float) -> StateSpace:
        """H(s / rate): the same answer in so much less time; continuous."""
        return self._replace(A=self.A * rate, B=self.B * rate)


class TransferFunction(NamedTuple):
    """numerator(s) / denominator(s), highest power first."""

    numerator: Array
    denominator: Array

    def __call__(self, s: Any) -> Any:
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    @property
    def is_proper(self) -> bool:
        return len(self.numerator) <= len(self.denominator)


def transfer_function(numerator: ArrayLike, denominator: ArrayLike) -> TransferFunction:
    """With the zeros in front cut off and a leading denominator coefficient of 1."""
    num, den = (np.trim_zeros(np.atleast_1d(np.asarray(c, float)), "f") for c in (numerator, denominator))
    if not len(den):
        raise ZeroDivisionError("denominator: expected a polynomial, got 0")
    return TransferFunction((num if len(num) else np.zeros(1)) / den[0], den / den[0])


def state_space(tf: TransferFunction, period_s: float | None = None) -> StateSpace:
    """Controllable canonical form of a proper transfer function."""
    if not tf.is_proper:
        raise ValueError(f"expected no more zeros than poles, got {len(tf.numerator) - 1}, {len(tf.denominator) - 1}")
    n = len(tf.denominator) - 1
    num = np.concatenate([np.zeros(n + 1 - len(tf.numerator)), tf.numerator])
    A, B = np.eye(n, k=-1), np.zeros((n, 1))
    if n:
        A[0], B[0, 0] = -tf.denominator[1:], 1.0
    C = (num[1:] - num[0] * tf.denominator[1:]).reshape(1, n)
    return StateSpace(A, B, C, num[:1].reshape(1, 1), period_s)


def series(first: StateSpace, then: StateSpace) -> StateSpace:
    """u -> first -> then -> y; the states of `first` come first."""
    A = np.block([[first.A, np.zeros((first.order, then.order))], [then.B @ first.C, then.A]])
    B = np.vstack([first.B, then.B @ first.D])
    return StateSpace(A, B, np.hstack([then.D @ first.C, then.C]), then.D @ first.D, first.period_s)


def closed_loop(plant: StateSpace, compensator: StateSpace) -> Array:
    """The matrix of x' = A x of u = compensator (0 - y), y = plant u; the plant has D = 0."""
    BD, BC = plant.B @ compensator.D, plant.B @ compensator.C
    return np.block([[plant.A - BD @ plant.C, BC], [-compensator.B @ plant.C, compensator.A]])
