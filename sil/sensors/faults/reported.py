"""Faults that the instrument reports: by the valid bit of SAMPLE, or by the age of its reading.

    off           not valid; the values of the fault's axes are 0 (SAMPLE has one valid bit for all axes)
    intermittent  off at some ticks: at random with the probability `fraction`, or for off_s after every on_s
    slow          a new reading at the fault's first tick and then once per period_s; in between the old one, and older
    delayed       the reading of delay_s ago, rounded up to whole periods; not valid while there is none that old

Each keeps what the good sensor says of itself: a delayed reading that was not valid is not valid when it comes.
"""

from __future__ import annotations

from protocol.frames import Reading
from sil.faulted import Order, delay_ticks, failing, renews
from sil.sensors.faults.wrapped import Wrapped
from sil.signals import Motion, Sensor

UINT32_MAX = 0xFFFFFFFF  # us, the oldest that SAMPLE can say


class Off(Wrapped):
    """Gives nothing."""

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        self.valid = False
        return Reading(0, self._mixed(reading.values, (0,) * len(reading.values)))


class Intermittent(Off):
    """Gives nothing now and then."""

    def __init__(self, good: Sensor, order: Order) -> None:
        super().__init__(good, order)
        self._fails = failing(order)

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        return super()._spoilt(reading, tick) if self._fails(tick) else reading


class Slow(Wrapped):
    """Samples at a pace of its own, and holds."""

    def __init__(self, good: Sensor, order: Order) -> None:
        super().__init__(good, order)
        self._held: tuple[int, Reading, bool] | None = None  # tick, reading, whether it was valid

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        if self._held is None or renews(self._order, tick):
            self._held = (tick, reading, self.valid)
        since, held, valid = self._held
        self.valid = self.valid and valid
        return Reading(_older(held, tick - since, self._order), self._mixed(reading.values, held.values))


class Delayed(Wrapped):
    """What it saw a while ago."""

    def __init__(self, good: Sensor, order: Order) -> None:
        super().__init__(good, order)
        self._delay = delay_ticks(order)
        self._past: dict[int, tuple[Reading, bool]] = {}

    def read(self, motion: Motion, tick: int) -> Reading:
        """The reading that leaves at `tick`; what it sees now is kept, also before the fault begins."""
        reading = self._good.read(motion, tick)
        self.valid = self._good.valid
        self._past[tick] = (reading, self.valid)
        self._past.pop(tick - self._delay - 1, None)
        return self._spoilt(reading, tick) if self._order.at(tick) else reading

    def _spoilt(self, reading: Reading, tick: int) -> Reading:
        held, valid = self._past.get(tick - self._delay, (None, False))
        self.valid = self.valid and valid
        if held is None:
            return Reading(0, self._mixed(reading.values, (0,) * len(reading.values)))
        return Reading(_older(held, self._delay, self._order), self._mixed(reading.values, held.values))


def _older(reading: Reading, ticks: int, order: Order) -> int:
    """Its age in us, so many ticks after it was read."""
    return min(reading.age_us + ticks * order.period_us, UINT32_MAX)
