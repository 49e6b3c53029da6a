"""States of a discrete compensator that fit fixed point: few, balanced, none larger than 1; and the bits they need.

1. Poles on or outside the unit circle (integrators) are split off, by an ordered Schur form and a Sylvester equation.
2. The rest is balanced: both Gramians the same diagonal matrix of Hankel singular values, which makes the response
   least sensitive to rounded coefficients. States below NOTHING of the largest are dropped, or all beyond an order.
3. Each state is divided by the most it can reach while |ref - y| <= pi: the sum of |impulse response|, times pi. An
   integrator, which has no such limit, is 1 where it gives a 64th of the torque that the rest can give together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, schur, solve_discrete_lyapunov, solve_sylvester

from sil.design.linear import Array, StateSpace
from sil.trouble import UsageError

LARGEST_ERROR_rad = np.pi
EDGE = 1e-8  # a pole nearer to the unit circle than this is an integrator
NOTHING = 1e-6  # of the largest Hankel singular value
DOUBLINGS = 18  # 2^18 samples of an impulse response at most
INTEGRATORS_SHARE = 1.0 / 64.0
BITS = range(8, 31)


def fitted(system: StateSpace, order: int | None = None) -> StateSpace:
    """The same system in such states; with `order` a reduced one. Raises UsageError if integrators are more."""
    free, rest = _split(system)
    if order is not None and order < free.order:
        raise UsageError(f"order: expected at least {free.order}, the poles on the unit circle, got {order}")
    rest = _unit_states(_balanced(rest, None if order is None else order - free.order))
    most = LARGEST_ERROR_rad * (_reach(rest.A, rest.B, rest.C)[0] + abs(system.D[0, 0]))
    touching = np.abs(free.C[0]) > 0.0
    free = _in_units(
        free, np.where(touching, INTEGRATORS_SHARE * most / np.where(touching, np.abs(free.C[0]), 1.0), 1.0)
    )
    return StateSpace(
        block_diag(free.A, rest.A),
        np.vstack([free.B, rest.B]),
        np.hstack([free.C, rest.C]),
        system.D,
        system.period_s,
    )


def _split(system: StateSpace) -> tuple[StateSpace, StateSpace]:
    """(poles with |z| >= 1, the others), whose sum is the system without its D."""
    A, Z, n = schur(system.A, sort=lambda re, im: np.hypot(re, im) >= 1.0 - EDGE)
    X = solve_sylvester(A[:n, :n], -A[n:, n:], -A[:n, n:]) if 0 < n < len(A) else np.zeros((n, len(A) - n))
    B, C = Z.T @ system.B, system.C @ Z
    zero = np.zeros_like(system.D)
    free = StateSpace(A[:n, :n], B[:n] - X @ B[n:], C[:, :n], zero, system.period_s)
    return free, StateSpace(A[n:, n:], B[n:], C[:, :n] @ X + C[:, n:], zero, system.period_s)


def _balanced(system: StateSpace, order: int | None) -> StateSpace:
    if not system.order:
        return system
    P, Q = (_root(solve_discrete_lyapunov(A, W)) for A, W in _gramians(system))
    U, sigma, Vt = np.linalg.svd(Q.T @ P)
    kept = int(np.count_nonzero(sigma > NOTHING * sigma[0]))
    n = kept if order is None else min(order, kept)
    half = 1.0 / np.sqrt(sigma[:n])
    T, inverse = P @ Vt[:n].T * half, (U[:, :n] * half).T @ Q.T
    return StateSpace(inverse @ system.A @ T, inverse @ system.B, system.C @ T, system.D, system.period_s)


def _gramians(system: StateSpace) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    return (system.A, system.B @ system.B.T), (system.A.T, system.C.T @ system.C)


def _root(W: Array) -> Array:
    """R with R R' = W; a Gramian's eigenvalues are not negative but by rounding."""
    values, vectors = np.linalg.eigh((W + W.T) / 2.0)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _unit_states(system: StateSpace) -> StateSpace:
    return _in_units(system, LARGEST_ERROR_rad * _reach(system.A, system.B, np.eye(system.order)))


def _in_units(system: StateSpace, scale: Array) -> StateSpace:
    """x = scale * z, state by state."""
    A, B = system.A * scale / scale[:, None] if system.order else system.A, system.B / scale[:, None]
    return StateSpace(A, B, system.C * scale, system.D, system.period_s)


def _reach(A: Array, B: Array, C: Array) -> Array:
    """Sum over k of |C A^k B|, for each row of C; the columns A^k B are made by doubling."""
    columns, power = B, A
    for _ in range(DOUBLINGS):
        more = power @ columns
        columns = np.hstack([columns, more])
        if np.sum(np.abs(more)) < 1e-6 * np.sum(np.abs(columns)):
            break
        power = power @ power
    return np.asarray(np.sum(np.abs(C @ columns), axis=1))


class Bits(NamedTuple):
    """largest: |coefficient|; fraction_bits: the fewest with which the response changes by less than `change`."""

    largest: float
    fraction_bits: int | None
    change: float


def bits(system: StateSpace, change: float = 1e-3) -> Bits:
    """How finely A, B, C and D have to be rounded, over three decades below the Nyquist frequency."""
    assert system.period_s is not None, "a discrete compensator"
    omega = np.geomspace(1e-3, 1.0, 60) * np.pi / system.period_s
    exact = system.response(omega)
    largest = max(float(np.max(np.abs(M), initial=0.0)) for M in system[:4])
    for count in BITS:
        A, B, C, D = (np.round(M * 2.0**count) / 2.0**count for M in system[:4])
        rounded = StateSpace(A, B, C, D, system.period_s)
        with np.errstate(all="ignore"):
            try:
                off = np.max(np.abs(rounded.response(omega) / exact - 1.0))
            except np.linalg.LinAlgError:  # a pole rounded onto the grid
                continue
        if off < change:
            return Bits(largest, count, change)
    return Bits(largest, None, change)
