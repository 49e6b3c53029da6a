"""Faults of the wheels' drives: another torque is asked of the motor than was commanded, on the axes of the fault.

    off           0
    stuck         the torque commanded at the fault's first tick
    garbage       uniform over +-torque_max, another one at every tick, seeded
    wrong         scale * command + bias
    slow          the command of the fault's first tick, renewed once per period_s
    delayed       the command of delay_s ago, rounded up to whole periods; 0 while there was none
    intermittent  0 at some ticks: at random with the probability `fraction`, or for off_s after every on_s

Torque and momentum limits are the good wheels': what they make of it is what really acts, and what SAMPLE says. A wheel
without torque keeps its momentum.
"""

from __future__ import annotations

import numpy as np

from sil.faulted import Order, delay_ticks, failing, renews
from sil.signals import Actuator, Vector


class Driven:
    """An actuator around `good`: commands pass as they are, as long as the fault is not there."""

    def __init__(self, good: Actuator, order: Order, torque_max_Nm: tuple[float | None, ...]) -> None:
        self._good, self._order = good, order
        self._axes = list(order.axes)

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float, tick: int) -> Vector:
        """Torque (3,) N m that really acts on the body for the period that `tick` begins."""
        asked = command_Nm
        if self._order.at(tick):
            asked = command_Nm.copy()
            asked[self._axes] = self._spoilt(command_Nm, tick)[self._axes]
        return self._good.limit(asked, momentum_B, period_s, tick)

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        raise NotImplementedError


class Off(Driven):
    """Gives no torque."""

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        return np.zeros(3)


class Intermittent(Off):
    """Gives no torque now and then."""

    def __init__(self, good: Actuator, order: Order, torque_max_Nm: tuple[float | None, ...]) -> None:
        super().__init__(good, order, torque_max_Nm)
        self._fails = failing(order)

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        return super()._spoilt(command_Nm, tick) if self._fails(tick) else command_Nm


class Wrong(Driven):
    """Scale and bias."""

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        return self._order.scale * command_Nm + self._order.bias


class Garbage(Driven):
    """Any torque."""

    def __init__(self, good: Actuator, order: Order, torque_max_Nm: tuple[float | None, ...]) -> None:
        super().__init__(good, order, torque_max_Nm)
        self._most = np.array([most or 0.0 for most in torque_max_Nm])
        self._draws = order.draws(3)

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        torque_Nm: Vector = (2.0 * self._draws.at(tick) - 1.0) * self._most
        return torque_Nm


class Slow(Driven):
    """Takes commands at a pace of its own, and holds."""

    def __init__(self, good: Actuator, order: Order, torque_max_Nm: tuple[float | None, ...]) -> None:
        super().__init__(good, order, torque_max_Nm)
        self._held_at, self._held = -1, np.zeros(3)

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        if tick == self._held_at or self._takes(tick):
            self._held_at, self._held = tick, command_Nm.copy()
        return self._held

    def _takes(self, tick: int) -> bool:
        return self._held_at < 0 or renews(self._order, tick)


class Stuck(Slow):
    """Takes one command, its last."""

    def _takes(self, tick: int) -> bool:
        return self._held_at < 0


class Delayed(Driven):
    """Does what it was told a while ago."""

    def __init__(self, good: Actuator, order: Order, torque_max_Nm: tuple[float | None, ...]) -> None:
        super().__init__(good, order, torque_max_Nm)
        self._delay = delay_ticks(order)
        self._past: dict[int, Vector] = {}

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float, tick: int) -> Vector:
        """... and keeps what it is told now, also before the fault begins."""
        self._past[tick] = command_Nm.copy()
        self._past.pop(tick - self._delay - 2, None)
        return super().limit(command_Nm, momentum_B, period_s, tick)

    def _spoilt(self, command_Nm: Vector, tick: int) -> Vector:
        return self._past.get(tick - self._delay, np.zeros(3))
