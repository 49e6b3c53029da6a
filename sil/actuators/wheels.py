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

from sil.signals import Vector

if TYPE_CHECKING:
    from sil.scenario import Scenario


class Wheels:
    """The actuator `wheels`; limits are per axis, math.inf for none."""

    def __init__(self, torque_max_Nm: tuple[float, ...], momentum_max_Nms: tuple[float, ...]) -> None:
        self._limits = tuple(zip(torque_max_Nm, momentum_max_Nms, strict=True))

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Wheels:
        """The wheels a scenario describes; null means no limit."""
        wheels = scenario.actuators.wheels
        return cls(
            tuple(math.inf if limit is None else limit for limit in wheels.torque_max_Nm),
            tuple(math.inf if limit is None else limit for limit in wheels.momentum_max_Nms),
        )

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float) -> Vector:
        """Torque (3,) N m on the body for the coming `period_s`, given the wheel momentum (3,) N m s now."""
        applied = [
            _limit(command, h, *limits, period_s)
            for command, h, limits in zip(command_Nm.tolist(), momentum_B.tolist(), self._limits, strict=True)
        ]
        return np.array(applied)


def _limit(command: float, h: float, torque_max: float, momentum_max: float, period_s: float) -> float:
    lowest = max(-torque_max, min(0.0, (h - momentum_max) / period_s))  # brings h up to +momentum_max
    highest = min(torque_max, max(0.0, (h + momentum_max) / period_s))  # brings h down to -momentum_max
    return min(max(command, lowest), highest)
