"""What every fault of a sensor does: nothing, as long as it is not there.

    reading = the good sensor's,                                  before and after
              on the axes of the fault spoilt, on the others not,  while it is there

Values are the wire's integers: Euler angles and rates x, y, z; a quaternion is one whole.
"""

from __future__ import annotations

from protocol.frames import Reading
from sil.faulted import Order
from sil.signals import Motion, Sensor

QUATERNION = 1  # bit
Values = tuple[int, ...]


class Wrapped:
    """A sensor around `good`."""

    def __init__(self, good: Sensor, order: Order) -> None:
        self._good, self._order = good, order
        self.bit, self.valid = good.bit, True
        self._places = range(4) if good.bit == QUATERNION else order.axes

    def read(self, motion: Motion, tick: int) -> Reading:
        """The reading that leaves at `tick`; `valid` says whether the instrument vouches for it."""
        reading = self._good.read(motion, tick)
        self.valid = self._good.valid
        return self._spoilt(reading, tick) if self._order.at(tick) else reading

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        raise NotImplementedError

    def _mixed(self, good: Values, spoilt: Values) -> Values:
        return tuple([spoilt[i] if i in self._places else value for i, value in enumerate(good)])
