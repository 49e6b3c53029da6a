"""What a design comes to: the compensator in both forms, the margins of its loops, what has to be said about it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.linalg import eigvals

from sil.design import margins
from sil.design.discrete import discretised
from sil.design.glover import Shape, glover
from sil.design.linear import Complex, StateSpace, TransferFunction, series, state_space, transfer_function
from sil.design.lqg import Weights, lqg
from sil.design.margins import Margins
from sil.design.plants import double_integrator
from sil.design.printed import PRINTED
from sil.design.realisation import Bits, bits, fitted
from sil.trouble import UsageError

MOST_STATES = 8  # of law state_space
Inertia = tuple[float, float, float]
Found = TypeVar("Found")


class Sampling(NamedTuple):
    """How the compensator is stepped: its period, delays, discretisation and order (None: as it comes out)."""

    period_s: float
    ticks: int = 1  # transport_delay_ticks
    sensor_delay_s: float = 0.0
    method: str = "ramp"
    order: int | None = None


class Sheet(NamedTuple):
    """C is for J = 1: torque = inertia of the axis x C (ref - y), N m per rad. PD, being improper, has no states."""

    title: str
    C: StateSpace | TransferFunction
    inertia: Inertia
    delay_s: float
    margins: dict[str, Margins]
    facts: dict[str, float]
    warnings: tuple[str, ...]
    discrete: StateSpace | None = None
    sampling: Sampling | None = None

    @property
    def stable(self) -> bool:
        return all(found.stable for found in self.margins.values())

    @property
    def bits(self) -> Bits | None:
        return None if self.discrete is None or not self.discrete.order else bits(self.discrete)

    def plain(self) -> dict[str, Any]:
        """For --json."""
        content: dict[str, Any] = {"title": self.title, "inertia_kgm2": self.inertia, "delay_s": self.delay_s}
        content |= {"stable": self.stable, "facts": self.facts, "warnings": self.warnings}
        content["compensator"] = {"text": written(self.C), **self.C._asdict()}
        content["margins"] = {name: found._asdict() for name, found in self.margins.items()}
        if self.discrete is not None and self.sampling is not None:
            found = self.bits
            content["discrete"] = {**self.sampling._asdict(), **self.discrete._asdict(), "order": self.discrete.order}
            content["bits"] = found._asdict() if found else None
        return content


def of_lqg(weights: Weights, inertia: Inertia, delay_s: float, pade: int, sampling: Sampling | None) -> Sheet:
    C = _solved(lambda: lqg(weights, delay_s, pade))
    title = f"LQG, regulator {weights.control:g} rad/s, observer {weights.observer:g} rad/s"
    title += f", integral {weights.integral:g} rad/s" if weights.integral else ""
    return _sheet(title, C, inertia, delay_s, sampling)


def of_glover(
    shape: Shape, inertia: Inertia, delay_s: float, pade: int, factor: float, sampling: Sampling | None
) -> Sheet:
    found = _solved(lambda: glover(shape, delay_s, pade, factor))
    title = f"Glover-McFarlane, crossover {shape.crossover:g} rad/s, alpha {shape.alpha:g}"
    title += f", integral {shape.integral:g} rad/s" if shape.integral else ""
    facts = {"gamma_min": found.gamma_min, "gamma": found.gamma, "coprime_margin": 1.0 / found.gamma}
    return _sheet(title, found.compensator, inertia, delay_s, sampling, facts)


def of_printed(name: str, inertia: float | None, actuator_gain: float, sampling: Sampling | None) -> Sheet:
    """A compensator of paper 000 on its experiment's inertia, or on another one."""
    if name not in PRINTED:
        raise UsageError(f"NAME: expected one of {', '.join(PRINTED)}, got {name}")
    printed = PRINTED[name]
    J = printed.inertia if inertia is None else inertia
    given = printed.used.expanded
    tf = transfer_function(given.numerator * actuator_gain / J, given.denominator)
    title = f"{name}, paper 000 {printed.source}"
    said = (printed.warning,) if printed.warning else ()
    return _sheet(title, state_space(tf) if tf.is_proper else tf, (J, J, J), 0.0, sampling, warnings=said)


def _solved(design: Callable[[], Found]) -> Found:
    """What a design gives; a Riccati equation without a solution becomes a UsageError."""
    try:
        return design()
    except (np.linalg.LinAlgError, ValueError) as error:
        raise UsageError(
            f"design: expected rates and a delay that the Riccati equations can solve, got: {error}"
        ) from None


def _sheet(
    title: str,
    C: StateSpace | TransferFunction,
    inertia: Inertia,
    delay_s: float,
    sampling: Sampling | None,
    facts: dict[str, float] | None = None,
    warnings: tuple[str, ...] = (),
) -> Sheet:
    loop = loop_of(C)
    found = {"continuous": margins.continuous(loop)}
    if delay_s:
        found[f"continuous, delay {delay_s:g} s"] = margins.continuous(loop, delay_s)
    discrete = None
    if sampling is not None:
        discrete, plant = stepped(C, sampling)
        late = sampling.ticks * sampling.period_s + sampling.sensor_delay_s
        found[_sampled_name(sampling)] = margins.sampled(discrete, plant, late)
    if isinstance(C, StateSpace) and np.any(C.poles.real > 1e-9 * np.max(np.abs(C.poles), initial=0.0)):
        warnings = (*warnings, "the compensator itself is unstable: where the torque is clipped it runs away")
    if discrete is not None and discrete.order > MOST_STATES:
        warnings = (*warnings, f"order {discrete.order}: law state_space takes at most {MOST_STATES}, see --order")
    return Sheet(title, C, inertia, delay_s, found, facts or {}, warnings, discrete, sampling)


def _sampled_name(sampling: Sampling) -> str:
    name = f"every {sampling.period_s:g} s, {sampling.ticks} tick{'s' if sampling.ticks != 1 else ''} late"
    return name + (f", sensor {sampling.sensor_delay_s:g} s" if sampling.sensor_delay_s else "")


def loop_of(C: StateSpace | TransferFunction) -> StateSpace:
    """L(s) = C(s) / s^2."""
    if isinstance(C, StateSpace):
        return series(C, double_integrator())
    return state_space(transfer_function(C.numerator, np.polymul(C.denominator, [1.0, 0.0, 0.0])))


def stepped(C: StateSpace | TransferFunction, sampling: Sampling) -> tuple[StateSpace, StateSpace]:
    """(discrete compensator, plant); PD takes the sensed rate beside the angle, so the plant gives both."""
    T = sampling.period_s
    if isinstance(C, StateSpace):
        return fitted(discretised(C, T, sampling.method), sampling.order), double_integrator()
    D = np.array([C.numerator[::-1]])
    return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), D, T), double_integrator(rate_too=True)


# -- a transfer function in the paper's words ------------------------------------------------------------------------


def written(C: StateSpace | TransferFunction) -> str:
    """gain (1 + a s + (b s)^2) / (s (1 + ...)), time constants in s."""
    if isinstance(C, TransferFunction):
        zeros, poles = np.roots(C.numerator).astype(complex), np.roots(C.denominator).astype(complex)
        at: Any = C
    else:
        zeros, poles = zeros_of(C), C.poles
        at = C.at
    fastest = float(np.max(np.abs(np.concatenate([zeros, poles])), initial=0.0)) or 1.0
    above, below = (_factors(roots, 1e-9 * fastest) for roots in (zeros, poles))
    s = 1.37 * fastest
    gain = at(s) * np.prod([value(s) for _, value in below]) / np.prod([value(s) for _, value in above])
    top = " ".join([f"{gain:.6g}", *(text for text, _ in above)])
    bottom = " ".join(text for text, _ in below)
    return top if not below else f"{top} / {bottom}" if len(below) == 1 else f"{top} / ({bottom})"


def zeros_of(C: StateSpace) -> Complex:
    """Finite zeros: generalised eigenvalues of the system matrix."""
    n = C.order
    pencil = np.block([[C.A, C.B], [C.C, C.D]])
    unit = np.zeros((n + 1, n + 1))
    unit[:n, :n] = np.eye(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = eigvals(pencil, unit)
    found = found[np.isfinite(found) & (np.abs(found) < 1e6 * np.max(np.abs(C.poles), initial=1.0))]
    return np.asarray(found)


def _factors(roots: Complex, zero: float) -> list[tuple[str, Any]]:
    """(text, its value at s) of each real root and each pair."""
    found: list[tuple[str, Any]] = []
    for root in sorted(roots, key=abs):
        if abs(root) < zero:
            found.append(("s", lambda s: s))
        elif abs(root.imag) < 1e-9 * abs(root):
            a = -1.0 / root.real
            found.append((f"(1 {_signed(a)} s)", lambda s, a=a: 1.0 + a * s))
        elif root.imag > 0.0:
            a, b = -2.0 * root.real / abs(root) ** 2, 1.0 / abs(root)
            found.append((f"(1 {_signed(a)} s + ({b:.4g} s)^2)", lambda s, a=a, b=b: 1.0 + a * s + (b * s) ** 2))
    return found


def _signed(value: float) -> str:
    return f"{'-' if value < 0 else '+'} {abs(value):.4g}"
