"""Three reaction wheels along the body axes: torque and momentum limits.

    applied = clip(command, -torque_max, +torque_max), then such that h - applied * T_s stays within +-momentum_max.
    A wheel at (or beyond) its limit gives nothing that would drive |h| further up; it gives everything that lowers it.

`applied` acts on the body, is held over the whole tick, and the wheel momentum h (absolute) changes by -applied * T_s.
The motors have no lag and no friction.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sil import jit
from sil.signals import Vector

if TYPE_CHECKING:
    from sil.scenario import Scenario


class Wheels:
    """The actuator `wheels`; limits are per axis, math.inf for none."""

    def __init__(self, torque_max_Nm: tuple[float, ...], momentum_max_Nms: tuple[float, ...]) -> None:
        self._torque_max, self._momentum_max = np.array(torque_max_Nm), np.array(momentum_max_Nms)
        self.limit(np.zeros(3), np.zeros(3), 1.0)  # compile, or load, now

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Wheels:
        """The wheels a scenario describes; null means no limit."""
        wheels = scenario.actuators.wheels
        return cls(
            tuple(math.inf if limit is None else limit for limit in wheels.torque_max_Nm),
            tuple(math.inf if limit is None else limit for limit in wheels.momentum_max_Nms),
        )

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float, tick: int = 0) -> Vector:
        """Torque (3,) N m on the body for the coming `period_s`, given the wheel momentum (3,) N m s now.

        The same in every tick.
        """
        applied = np.empty(3)
        _limit(command_Nm, momentum_B, self._torque_max, self._momentum_max, period_s, applied)
        return applied


@jit.compile
def _limit(
    command: Vector, h: Vector, torque_max: Vector, momentum_max: Vector, period_s: float, applied: Vector
) -> None:
    for i in range(3):
        lowest = max(-torque_max[i], min(0.0, (h[i] - momentum_max[i]) / period_s))  # brings h up to +momentum_max
        highest = min(torque_max[i], max(0.0, (h[i] + momentum_max[i]) / period_s))  # brings h down to -momentum_max
        applied[i] = min(max(command[i], lowest), highest)
