"""Thruster-like actuator: three torques from outside, each with a gain and a limit, none quite where it should point.

    applied = K_T sat(gain * command),   sat to +-torque_max on each axis of its own

K_T (3,3): column j is where the torque of axis j points in body axes, of norm 1. A misalignment of p percent has p/100
off the diagonal and sqrt(1 - 2 (p/100)^2) on it (5 %: 0.9975). `applied` is the torque on the body, held over the tick;
no wheel takes it up, so the momentum stays. Nothing of it is pulsed, and no propellant is counted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sil import jit
from sil.signals import Vector

if TYPE_CHECKING:
    from sil.scenario import Scenario


class Thrusters:
    """The actuator `thrusters`; limits are per axis, math.inf for none."""

    def __init__(self, gain: Vector, torque_max_Nm: Vector, K_T: Vector) -> None:
        self._gain, self._torque_max, self._K_T = gain, torque_max_Nm, K_T
        self.limit(np.zeros(3), np.zeros(3), 1.0)  # compile, or load, now

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Thrusters:
        """The thrusters a scenario describes; null means no limit."""
        thrusters = scenario.actuators.thrusters
        limits = [math.inf if limit is None else limit for limit in thrusters.torque_max_Nm]
        return cls(np.array(thrusters.gain), np.array(limits), np.array(thrusters.K_T))

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float, tick: int = 0) -> Vector:
        """Torque (3,) N m on the body, whatever the wheel momentum. The same in every tick."""
        applied = np.empty(3)
        _applied(command_Nm, self._gain, self._torque_max, self._K_T, applied)
        return applied


@jit.compile
def _applied(command: Vector, gain: Vector, torque_max: Vector, K_T: Vector, applied: Vector) -> None:
    x, y, z = (
        min(max(gain[0] * command[0], -torque_max[0]), torque_max[0]),
        min(max(gain[1] * command[1], -torque_max[1]), torque_max[1]),
        min(max(gain[2] * command[2], -torque_max[2]), torque_max[2]),
    )
    for i in range(3):
        applied[i] = K_T[i, 0] * x + K_T[i, 1] * y + K_T[i, 2] * z
