"""Sensor unit: any sensor at a pace of its own, held in between, late, with jitter. Times are whole microseconds.

    sample i        is the truth at s_i = i P + j_i,  s_0 = 0 exactly
    jitter          j_i = round(min(max(N(0, jitter/3), -jitter), jitter)), of seed, sensor and i alone
    it comes out    transport: at s_i + D
                    unit:      at (ceil(s_i / D) + 1) D: 1/z with sample time D behind the hold. At n D the output
                               becomes what was held at (n - 1) D, so D late and held for D: 1.5 D on average
    reading at t_k  the newest sample that has come out by then; before that, the truth at t = 0
    age             t_k - s_i; noise is drawn for i, so a held reading holds its noise

P is the sensor's period. A unit delay without one has P = D. A transport delay without one has a sample for each tick:

    reading at t_k  the truth at min(t_k - D + j_k, t_k); where that is not above 0, the truth at t = 0

Only samples that some tick reads are taken. `due_ns` says when the next of them is, between two ticks or at one; the
loop brings the plant there and calls `observe`, or `read` where it is t_k. A sample at t_k is in the reading at t_k.
"""

from __future__ import annotations

from collections import deque

from protocol.frames import Reading
from sil.noise import Gaussian
from sil.scenario_sampling import Times
from sil.signals import Motion, Sensor

UINT32_MAX = 0xFFFFFFFF  # us, the oldest that SAMPLE can say


class Instants:
    """Which sample is read at which tick, and when it is taken: of a sensor with a beat of its own."""

    def __init__(self, times: Times, tick_us: int, seed: int, consumer: str) -> None:
        self._delay_us, self._unit, self._tick_us = times.delay_us, times.unit, tick_us
        self._period_us = times.beat_us(tick_us)
        self._most_us = times.jitter_s * 1e6
        self._jitter = Gaussian(seed, consumer, self._most_us / 3.0, 1) if times.jitter_s else None

    def at_us(self, sample: int) -> int:
        """s_i, us."""
        return sample * self._period_us + self._moved_us(sample) if sample else 0

    def read_at(self, tick: int) -> int:
        """The sample that is read at `tick`: the newest of those with s_i no later than what has come out."""
        t_us = tick * self._tick_us
        until_us = (t_us // self._delay_us - 1) * self._delay_us if self._unit else t_us - self._delay_us
        if until_us < 0:
            return 0
        latest = until_us // self._period_us + 1  # jitter is at most half a period
        return next(sample for sample in (latest, latest - 1, latest - 2) if self.at_us(sample) <= until_us)

    def first_tick(self, sample: int) -> int:
        """The first tick at which `sample` has come out."""
        out_us = self.at_us(sample) + self._delay_us
        if self._unit:
            out_us = -(-out_us // self._delay_us) * self._delay_us
        return -(-out_us // self._tick_us)

    def _moved_us(self, sample: int) -> int:
        if self._jitter is None:
            return 0
        return round(min(max(float(self._jitter.at(sample)[0]), -self._most_us), self._most_us))


class OfTicks(Instants):
    """The same of a sensor that looks for each tick: sample k is that of tick k."""

    def at_us(self, sample: int) -> int:
        """s_k, us."""
        t_us = sample * self._tick_us
        return max(0, min(t_us - self._delay_us + self._moved_us(sample), t_us)) if sample else 0

    def read_at(self, tick: int) -> int:
        """Its own, or none yet."""
        return tick if self.at_us(tick) > 0 else 0

    def first_tick(self, sample: int) -> int:
        """Its own, or the first that has one."""
        tick = max(sample, self._delay_us // self._tick_us)
        while self.read_at(tick) < sample:  # jitter is at most half a tick
            tick += 1
        return tick


def instants(times: Times, tick_us: int, seed: int, consumer: str) -> Instants:
    """When a sensor with these times looks; it draws the numbers of `consumer`."""
    kind = Instants if times.period_us or times.unit else OfTicks
    return kind(times, tick_us, seed, consumer)


class Sampled:
    """A sensor around `good`, which is read once a sample with the sample's number."""

    def __init__(self, good: Sensor, instants: Instants) -> None:
        self._good, self._instants = good, instants
        self.bit, self.valid = good.bit, True
        self._taken: deque[tuple[int, Reading, bool]] = deque()  # sample, reading, whether it was valid
        self._next = 0  # sample
        self.due_ns = 0

    def observe(self, motion: Motion) -> None:
        """The truth at `due_ns`: the next sample is taken."""
        assert motion.t_ns == self.due_ns, "a sample has its instant"
        self._taken.append((self._next, self._good.read(motion, self._next), self._good.valid))
        # What comes out first after this sample need not be the one after it: a slow board skips some.
        self._next = self._instants.read_at(self._instants.first_tick(self._next + 1))
        self.due_ns = self._instants.at_us(self._next) * 1000

    def read(self, motion: Motion, tick: int) -> Reading:
        """The reading that leaves at `tick`; `valid` is that of its sample."""
        while motion.t_ns == self.due_ns:
            self.observe(motion)
        wanted = self._instants.read_at(tick)
        while self._taken[0][0] < wanted:
            self._taken.popleft()
        sample, reading, self.valid = self._taken[0]
        assert sample == wanted, "every sample that is read was taken"
        age_us = reading.age_us + motion.t_ns // 1000 - self._instants.at_us(sample)
        return Reading(min(age_us, UINT32_MAX), reading.values)
