"""Attitude sensor: the three Euler angles of the body relative to `attitude.frame`, in `attitude.sequence`.

    reading = round((angle + noise) / LSB) * LSB,  LSB = 360 deg / 2^bits,  modulo one turn; bits 0 = 32, the wire's own
    noise: white, Gaussian, standard deviation noise_deg on each angle

Wire: int32 binary angle, 2^-32 turn, order [x, y, z]. The reading is instantaneous: age 0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from protocol.frames import Reading
from sil.noise import Gaussian
from sil.signals import Motion

if TYPE_CHECKING:
    from sil.scenario import Scenario

WIRE_BITS = 32


class Attitude:
    """The sensor `attitude`."""

    bit = 0
    valid = True

    def __init__(self, noise_deg: float, bits: int, seed: int) -> None:
        self._steps_per_rad = 2 ** (bits or WIRE_BITS) / (2 * math.pi)
        self._shift = WIRE_BITS - (bits or WIRE_BITS)
        self._noise = Gaussian(seed, "sensors.attitude", math.radians(noise_deg), 3) if noise_deg else None

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Attitude:
        """The sensor a scenario describes."""
        section = scenario.sensors.attitude
        return cls(section.noise_deg, section.bits, scenario.seed)

    def read(self, motion: Motion, tick: int) -> Reading:
        """Reading at `tick`: three int32 binary angles."""
        angles = motion.euler_rad if self._noise is None else motion.euler_rad + self._noise.at(tick)
        return Reading(0, tuple([self._wire(angle) for angle in angles.tolist()]))

    def _wire(self, angle_rad: float) -> int:
        bam: int = round(angle_rad * self._steps_per_rad) << self._shift
        return (bam + 0x80000000 & 0xFFFFFFFF) - 0x80000000
