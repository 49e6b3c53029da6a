"""Star tracker: the quaternion q_BN of the body relative to the inertial frame, whatever `attitude.frame` says.

    q_read = q_BN (x) (1, d/2) / |.|,  d = noise rotation vector in body axes, Gaussian, noise_deg on each axis
    component = round(q_i / LSB) * LSB,  LSB = 2 / 2^bits; bits 0 = 31, the wire's own

Wire: int32 Q30, scalar first, continuous in sign. The reading is instantaneous: age 0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from protocol.frames import Reading
from sil.noise import Gaussian
from sil.signals import Motion

if TYPE_CHECKING:
    from sil.scenario import Scenario

WIRE_BITS = 31  # Q30 over -1..1


class Quaternion:
    """The sensor `quaternion`."""

    bit = 1
    valid = True

    def __init__(self, noise_deg: float, bits: int, seed: int) -> None:
        self._steps = 2.0 ** ((bits or WIRE_BITS) - 1)
        self._shift = WIRE_BITS - (bits or WIRE_BITS)
        self._noise = Gaussian(seed, "sensors.quaternion", math.radians(noise_deg), 3) if noise_deg else None

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Quaternion:
        """The sensor a scenario describes."""
        section = scenario.sensors.quaternion
        return cls(section.noise_deg, section.bits, scenario.seed)

    def read(self, motion: Motion, tick: int) -> Reading:
        """Reading at `tick`: four int32 in Q30, scalar first."""
        q = motion.q_BN.tolist() if self._noise is None else self._turned(motion.q_BN.tolist(), tick)
        return Reading(0, tuple([round(component * self._steps) << self._shift for component in q]))

    def _turned(self, q: list[float], tick: int) -> list[float]:
        assert self._noise is not None
        x, y, z = (0.5 * self._noise.at(tick)).tolist()
        s, a, b, c = q
        turned = [
            s - a * x - b * y - c * z,
            a + s * x + b * z - c * y,
            b + s * y + c * x - a * z,
            c + s * z + a * y - b * x,
        ]
        length = math.hypot(*turned)
        return [component / length for component in turned]
