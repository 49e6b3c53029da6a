"""Rate gyros: omega_BN_B, the body rate relative to the inertial frame, in body axes.

    reading = round((omega + noise) / LSB) * LSB,  LSB = lsb_degps, 0 = the wire's own
    noise: white, Gaussian, standard deviation noise_degps on each axis

Wire: int32, LSB 2^-rate_bits rad/s, limited to the int32 range. The reading is instantaneous: age 0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from protocol.frames import Reading
from sil.noise import Gaussian
from sil.signals import Motion

if TYPE_CHECKING:
    from sil.scenario import Scenario

INT32_MAX = 0x7FFFFFFF


class Rate:
    """The sensor `rate`."""

    bit = 2
    valid = True

    def __init__(self, noise_degps: float, lsb_degps: float, rate_bits: int, seed: int) -> None:
        self._lsb = math.radians(lsb_degps)
        self._scale = 2.0**rate_bits
        self._noise = Gaussian(seed, "sensors.rate", math.radians(noise_degps), 3) if noise_degps else None

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Rate:
        """The sensor a scenario describes."""
        section = scenario.sensors.rate
        return cls(section.noise_degps, section.lsb_degps, scenario.wire.rate_bits, scenario.seed)

    def read(self, motion: Motion, tick: int) -> Reading:
        """Reading at `tick`: three int32 in units of 2^-rate_bits rad/s."""
        rates = motion.omega_BN_B if self._noise is None else motion.omega_BN_B + self._noise.at(tick)
        return Reading(0, tuple([self._wire(rate) for rate in rates.tolist()]))

    def _wire(self, rate: float) -> int:
        stepped = round(rate / self._lsb) * self._lsb if self._lsb else rate
        return max(-INT32_MAX, min(INT32_MAX, round(stepped * self._scale)))
