"""Faults that no instrument knows of: the reading is as valid and as fresh as ever, and not true.

stuck    the values it had at the first tick of the fault
garbage  each value uniform over all that the wire can carry (a quaternion: components -1..1, of any norm), seeded
wrong    round(scale * value) + bias; angles modulo one turn, rates limited to the wire's range;
         star tracker: q (x) (1, d/2) / |.|, d = bias_deg about the body axes of the fault
"""

from __future__ import annotations

import math

from protocol.frames import Reading
from sil.faulted import Order
from sil.sensors.faults.wrapped import QUATERNION, Values, Wrapped
from sil.signals import Sensor

EULER = 0  # bit
INT32_MAX = 0x7FFFFFFF
TURN_BAM = 2**32
Q30 = 2**30


class Stuck(Wrapped):
    """Its values do not change any more."""

    def __init__(self, good: Sensor, order: Order) -> None:
        super().__init__(good, order)
        self._held: Values | None = None

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        self._held = self._held or reading.values
        return Reading(reading.age_us, self._mixed(reading.values, self._held))


class Garbage(Wrapped):
    """Random values, others at every tick."""

    def __init__(self, good: Sensor, order: Order) -> None:
        super().__init__(good, order)
        self._draws = order.draws(4)
        self._half = Q30 if good.bit == QUATERNION else 2**31

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        drawn = [int(share * 2 * self._half) - self._half for share in self._draws.at(tick).tolist()]
        return Reading(reading.age_us, self._mixed(reading.values, tuple(drawn)))


class Wrong(Wrapped):
    """Scale and bias."""

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        if self.bit == QUATERNION:
            return Reading(reading.age_us, self._turned(reading.values))
        wrong = self._angle if self.bit == EULER else self._rate
        return Reading(reading.age_us, self._mixed(reading.values, tuple([wrong(value) for value in reading.values])))

    def _angle(self, bam: int) -> int:
        wrong = round(self._order.scale * bam) + round(self._order.bias)
        return (wrong + TURN_BAM // 2) % TURN_BAM - TURN_BAM // 2

    def _rate(self, value: int) -> int:
        wrong = round(self._order.scale * value) + round(self._order.bias)
        return max(-INT32_MAX, min(INT32_MAX, wrong))

    def _turned(self, values: Values) -> Values:
        x, y, z = (0.5 * self._order.bias if axis in self._order.axes else 0.0 for axis in range(3))
        s, a, b, c = (value / Q30 for value in values)
        turned = (
            s - a * x - b * y - c * z,
            a + s * x + b * z - c * y,
            b + s * y + c * x - a * z,
            c + s * z + a * y - b * x,
        )
        length = math.hypot(*turned) or 1.0
        return tuple([round(component / length * Q30) for component in turned])
