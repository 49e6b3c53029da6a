"""How far a loop is from instability: crossover, phase, gain, delay and modulus margin, continuous and sampled.

The loop is cut at the torque, so that it has one input and one output whatever is measured: L = C(s) G(s), or
L(z) = C(z) G(z) with G behind a hold, a transport delay of whole ticks and any delay of the sensor:

    G(z) = Cp (zI - F)^-1 (G1 z^-1 + G0) z^-d,   delay = d T + f, 0 <= f < T

G1, G0: what the torque of the tick before, and this tick's, does to the plant in the parts f and T - f of a period.
That is exact for any f. What a sensor's delay does to a linear loop at rest is the same wherever it stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from sil.design.discrete import zoh
from sil.design.linear import Array, Complex, StateSpace, series

POINTS = 1600
BISECTIONS = 45
SPREAD = 300.0  # the grid reaches so far beyond the slowest and the fastest pole, open or closed
INTEGRATOR = 1e-7  # of the fastest pole: anything slower is one
CANCELLED = 1e-7  # of the fastest pole: a closed pole nearer to 0 stands there
ROUNDS = 5
SAME = 1e-6  # of a delay: the fixed point is found
_REAL = 1e-7  # |Im L| / |L| at the Nyquist frequency, where L of a sampled loop is real


class Margins(NamedTuple):
    """Of one loop; None: there is none, or the loop is not stable.

    gain_up, gain_down: the factor by which the gain may grow, to which it may fall; phase_deg: the nearest way to -1
    at a crossover; delay_s: further delay until the loop is lost; modulus: the least |1 + L|;
    drifts: stable but for a pole at 0 that the compensator cancels, so a constant torque makes the angle run away.
    """

    stable: bool
    crossover_radps: float | None = None
    phase_deg: float | None = None
    gain_up: float | None = None
    gain_down: float | None = None
    delay_s: float | None = None
    modulus: float | None = None
    drifts: bool = False


def continuous(loop: StateSpace, delay_s: float = 0.0) -> Margins:
    """Margins of L(s) e^(-s delay), L strictly proper."""
    return _margins(loop, delay_s)


def sampled(compensator: StateSpace, plant: StateSpace, delay_s: float = 0.0) -> Margins:
    """Margins of a discrete compensator, hold and continuous plant with this delay in all: ticks x period + sensor's.

    delay_s of the result is what comes on top of that.
    """
    T = _period(compensator)
    fraction = delay_s % T if delay_s % T < T * (1.0 - 1e-9) else 0.0
    found = _margins(series(held(plant, T, fraction), compensator), delay_s - fraction)
    if not found.stable:
        return found
    return found._replace(delay_s=largest_delay(compensator, plant) - delay_s)


def largest_delay(compensator: StateSpace, plant: StateSpace) -> float:
    """The delay in s at which the sampled loop is lost; 0 if it is not stable without any, infinite if never.

    The part of a period in it changes the plant: a fixed point, which a few rounds find where the period is short, else
    bisection.
    """
    T = _period(compensator)
    total = 0.0
    for round_ in range(ROUNDS):
        fraction = total % T
        left = _left(compensator, plant, fraction)
        if left is None or math.isinf(left):
            break
        if round_ and abs(fraction + left - total) < SAME * total:
            return total
        total = fraction + left
    if left is None and not total:
        return 0.0
    return math.inf if left == math.inf else _bisected(compensator, plant)


def _left(compensator: StateSpace, plant: StateSpace, fraction: float) -> float | None:
    """The delay margin of the loop with this part of a period; None: it is not stable."""
    seen = _seen(series(held(plant, _period(compensator), fraction), compensator))
    if seen is None:
        return None
    margin = seen.delay_margin()
    return math.inf if margin is None else margin


def _bisected(compensator: StateSpace, plant: StateSpace) -> float:
    T = _period(compensator)

    def lost(delay: float) -> bool:
        left = _left(compensator, plant, delay % T)
        return left is None or left <= delay - delay % T

    high = T
    while not lost(high):
        high *= 2.0
    low = high / 2.0 if high > T else 0.0
    for _ in range(BISECTIONS // 2):
        middle = (low + high) / 2.0
        low, high = (low, middle) if lost(middle) else (middle, high)
    return (low + high) / 2.0


def held(plant: StateSpace, period_s: float, fraction_s: float = 0.0) -> StateSpace:
    """The plant behind a hold, its torque late by a part of the period; that part adds a state, the torque before."""
    if fraction_s <= 0.0:
        return zoh(plant, period_s)
    n, m = plant.B.shape
    F, late = expm(plant.A * period_s), zoh(plant, period_s - fraction_s)
    G1 = expm(plant.A * (period_s - fraction_s)) @ zoh(plant, fraction_s).B
    A = np.block([[F, G1], [np.zeros((m, n + m))]])
    B = np.vstack([late.B, np.eye(m)])
    return StateSpace(A, B, np.hstack([plant.C, np.zeros((len(plant.C), m))]), plant.D, period_s)


def _period(compensator: StateSpace) -> float:
    assert compensator.period_s is not None, "a discrete compensator"
    return compensator.period_s


class _Seen(NamedTuple):
    """A stable loop at the frequencies of a grid."""

    loop: StateSpace
    delay_s: float
    grid: Array
    L: Complex
    drifts: bool

    def at(self, omega: Array) -> Complex:
        return np.asarray(self.loop.response(omega)[:, 0, 0] * np.exp(-1j * omega * self.delay_s))

    def crossings(self, of: Callable[[Complex], Array]) -> Array:
        """Frequencies where a real function of L changes its sign, by bisection between points of the grid."""
        signs = np.signbit(of(self.L))
        places = np.flatnonzero(signs[1:] != signs[:-1])
        low, high, start = np.log(self.grid[places]), np.log(self.grid[places + 1]), signs[places]
        for _ in range(BISECTIONS if len(places) else 0):
            middle = (low + high) / 2.0
            same = np.signbit(of(self.at(np.exp(middle)))) == start
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.asarray(np.exp((low + high) / 2.0))

    def crossovers(self) -> Array:
        return self.crossings(lambda L: np.log(np.abs(L)))

    def delay_margin(self) -> float | None:
        at = self.crossovers()
        return float(np.min(np.angle(-self.at(at)) % (2.0 * math.pi) / at)) if len(at) else None

    def gains(self) -> tuple[float | None, float | None]:
        """(up, down) from where L crosses the negative real axis."""
        at = self.crossings(lambda L: L.imag / np.abs(L))
        if self.loop.period_s is not None and abs(self.L[-1].imag) < _REAL * abs(self.L[-1]):
            at = np.append(at, self.grid[-1])
        L = self.at(at) if len(at) else np.zeros(0, complex)
        factors = 1.0 / np.abs(L[L.real < 0.0])
        up, down = factors[factors > 1.0], factors[factors < 1.0]
        return float(np.min(up)) if len(up) else None, float(np.max(down)) if len(down) else None


def _margins(loop: StateSpace, delay_s: float) -> Margins:
    """Stable: without delay by the poles, with delay as long as that is below the delay margin."""
    seen = _seen(loop)
    if seen is None:
        return Margins(False)
    if delay_s:
        bare = seen.delay_margin()
        if bare is not None and bare <= delay_s:
            return Margins(False)
        grid = np.union1d(seen.grid, _turns(delay_s, seen.grid[-1]))
        seen = seen._replace(delay_s=delay_s, grid=grid)
        seen = seen._replace(L=seen.at(grid))
    crossovers = seen.crossovers()
    angles = np.abs(np.angle(-seen.at(crossovers), deg=True)) if len(crossovers) else crossovers
    up, down = seen.gains()
    return Margins(
        True,
        float(crossovers[-1]) if len(crossovers) else None,
        float(np.min(angles)) if len(crossovers) else None,
        up,
        down,
        seen.delay_margin(),
        float(np.min(np.abs(1.0 + seen.L))),
        seen.drifts,
    )


def _seen(loop: StateSpace) -> _Seen | None:
    """The loop without delay, None if it is unstable. A closed pole at 0 is one that the compensator cancels."""
    closed = loop.A - loop.B @ loop.C / (1.0 + loop.D[0, 0])
    rates = _rates(np.linalg.eigvals(closed).astype(complex), loop.period_s)
    at_zero = np.abs(rates) < CANCELLED * np.max(np.abs(rates), initial=0.0)
    if np.any(rates[~at_zero].real >= 0.0) or np.count_nonzero(at_zero) > 1:
        return None
    grid = _grid(np.concatenate([_rates(loop.poles, loop.period_s), rates]), loop.period_s)
    return _Seen(loop, 0.0, grid, loop.response(grid)[:, 0, 0], bool(np.any(at_zero)))


def _rates(poles: Complex, period_s: float | None) -> Complex:
    """Poles in rad/s, of a discrete system too; those at z = 0 are left out."""
    if period_s is None:
        return poles
    return np.asarray(np.log(poles[np.abs(poles) > 1e-9]) / period_s, complex)


def _grid(poles: Complex, period_s: float | None) -> Array:
    """Frequencies around all poles, evenly on a log scale, to the Nyquist frequency at most."""
    rates = np.abs(poles)
    rates = rates[rates > INTEGRATOR * np.max(rates)]
    low, high = np.min(rates) / SPREAD, np.max(rates) * SPREAD
    return np.geomspace(low, high if period_s is None else math.pi / period_s, POINTS)


def _turns(delay_s: float, below: float) -> Array:
    """Frequencies between which the delay turns L by a thirtieth of a turn."""
    return np.asarray(np.arange(1, 2000) * 0.2 / delay_s)[: int(np.clip(below * delay_s / 0.2, 0, 1999))]
