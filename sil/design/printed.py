"""The compensators of paper 000, as printed and as used.

The format is MATLAB's of time constants: gain times factors (1 + a s + (b s)^2), b in s. Output is a torque in N m per
rad of ref - y; the actuator's gain is not applied to LQG and LS, with it they are unstable. PD has volts and gain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sil.design.linear import Array, TransferFunction, transfer_function

Factor = tuple[float, float]  # (a, b) of 1 + a s + (b s)^2
DRIFTS = "no stiffness: a constant torque makes it drift away, and an impulse leaves an offset for good"


class Factored(NamedTuple):
    """gain s^-integrators times the factors above, divided by those below."""

    gain: float
    above: tuple[Factor, ...]
    below: tuple[Factor, ...] = ()
    integrators: int = 0

    @property
    def expanded(self) -> TransferFunction:
        above, below = _product(self.above) * self.gain, _product(self.below)
        s = np.array([1.0] + [0.0] * abs(self.integrators))
        if self.integrators > 0:
            return transfer_function(above, np.polymul(below, s))
        return transfer_function(np.polymul(above, s), below)


class Printed(NamedTuple):
    """given: what stands in the paper; used: the same without what cancels; inertia of its experiment."""

    source: str
    given: Factored
    used: Factored
    inertia: float
    remark: str
    warning: str = ""


def _product(factors: tuple[Factor, ...]) -> Array:
    whole: Array = np.ones(1)
    for a, b in factors:
        whole = np.asarray(np.polymul(whole, [b * b, a, 1.0]), float)
    return whole


def _same(source: str, given: Factored, inertia: float, remark: str, warning: str = "") -> Printed:
    return Printed(source, given, given, inertia, remark, warning)


_LS_POLES = (0.13, 0.07)
_SIXTEEN, _LONG = (0.16, 0.08), (9.5e3, 3e6)  # stand above and below
_LS_52 = 3.133e-16 * 2.8e6**2  # s^2 / s is left of (1 + 0.28 s + (2.8e6 s)^2) / s
_LS_54 = 4.8149e-11 * 2.6e6**2
_LQG_53 = Factored(6.6499e-5, ((9.1e2, 6.4e2),), ((7.3, 5.2),), 1)
_LS_54_GIVEN = Factored(4.8149e-11, ((3e6, 0.0), (4.7e6, 2.6e6), _SIXTEEN), ((3e6, 0.0), _LS_POLES, _SIXTEEN), 1)
_REPAIRED_53 = Factored(29.2942, ((9.1, 6.4),), ((0.073, 0.052),), 1)

PRINTED: dict[str, Printed] = {
    "pd-1": _same(
        "experiment 1", Factored(0.1, ((2.0, 0.0),)), 0.001, "Kp 100 V/rad, Kd 200 V s/rad, actuator 0.001 N m/V"
    ),
    "pd-2": _same("experiment 2", Factored(0.01, ((2.0, 0.0),)), 0.01, "Kp 1 V/rad, Kd 2 V s/rad, actuator 0.01 N m/V"),
    "lqg-5.1": _same(
        "(5.1), experiment 2",
        Factored(0.00082667, ((5.6, 3.9),), ((0.13, 0.091),), 1),
        0.01,
        "an LQG with J wc^2 = 1e-3, J wo^2 = 1, wi = 1 rad/s, without delay, gives every printed digit",
    ),
    "ls-5.2": Printed(
        "(5.2), experiment 2",
        Factored(3.133e-16, ((0.28, 2.8e6), _LONG, _SIXTEEN), (_LS_POLES, _LONG, _SIXTEEN), 1),
        Factored(_LS_52, (), (_LS_POLES,), -1),
        0.01,
        "common factors cancelled, and the zeros at 3.6e-7 rad/s with the pole at 0: a pure derivative",
        DRIFTS,
    ),
    "lqg-5.3": _same(
        "(5.3), experiment 3",
        _LQG_53,
        400.0,
        "the same weights as 5.1 give it, gain 0.08 % off: too slow for table 5.9",
    ),
    "lqg-5.3-repaired": Printed(
        "(5.3), time constants x 0.01, gain for a crossover of 3 rad/s",
        _LQG_53,
        _REPAIRED_53,
        400.0,
        "fitted to table 5.9 by our study, not derived",
    ),
    "ls-5.4": Printed(
        "(5.4), experiment 3",
        _LS_54_GIVEN,
        Factored(_LS_54, (), (_LS_POLES,), -1),
        400.0,
        "common factors cancelled, and the zeros at 3.8e-7 rad/s with the pole at 0: a pure derivative",
        DRIFTS,
    ),
    "ls-5.4-repaired": Printed(
        "(5.4) x 2.2",
        _LS_54_GIVEN,
        Factored(2.2 * _LS_54, (), (_LS_POLES,), -1),
        400.0,
        "fitted to table 5.9 by our study, not derived",
        DRIFTS,
    ),
}
