"""Sensor unit: any sensor at a pace of its own, held in between, late, with jitter. Times are whole microseconds.

    sample i        is the truth at s_i = i P + phase + j_i,  s_0 = 0 exactly
    jitter          j_i = round(min(max(N(0, jitter/3), -jitter), jitter)), of seed, sensor and i alone
    it comes out    transport: at s_i + D
                    unit:      at (ceil(s_i / D) + 1) D: 1/z with sample time D behind the hold. At n D the output
                               becomes what was held at (n - 1) D, so D late and held for D: 1.5 D on average
    reading at t_k  the newest sample that has come out by then; before that, the truth at t = 0
    age             t_k - s_i; noise is drawn for i, so a held reading holds its noise

P is the sensor's period. Without one it looks whenever that decides a reading: transport: at t_k - D (P the board's
period, phase -(D mod P)); unit: at n D. A sample at t_k itself is in the reading at t_k.

Only samples that some tick reads are taken. `due_ns` says when the next of them is, between two ticks or at one; the
loop brings the plant there and calls `observe`, or `read` where it is t_k.
"""

from __future__ import annotations

from collections import deque

from protocol.frames import Reading
from sil.noise import Gaussian
from sil.scenario_sampling import Times
from sil.signals import Motion, Sensor

UINT32_MAX = 0xFFFFFFFF  # us, the oldest that SAMPLE can say


class Instants:
    """Which sample is read at which tick, and when it is taken. Integers, and nothing but (tick) decides."""

    def __init__(self, times: Times, tick_us: int, seed: int, consumer: str) -> None:
        self._delay_us, self._unit, self._tick_us = times.delay_us, times.unit, tick_us
        self._phase_us = 0
        if times.period_us:
            self._period_us = times.period_us
        elif times.unit:
            self._period_us = times.delay_us
        else:
            self._period_us, self._phase_us = tick_us, -(times.delay_us % tick_us)
        self._most_us = times.jitter_s * 1e6
        self._jitter = Gaussian(seed, consumer, self._most_us / 3.0, 1) if times.jitter_s else None

    def at_us(self, sample: int) -> int:
        """s_i, us."""
        if not sample:
            return 0
        at_us = sample * self._period_us + self._phase_us
        if self._jitter is None:
            return at_us
        return at_us + round(min(max(float(self._jitter.at(sample)[0]), -self._most_us), self._most_us))

    def read_at(self, tick: int) -> int:
        """The sample that is read at `tick`: the newest of those with s_i no later than what has come out."""
        t_us = tick * self._tick_us
        until_us = (t_us // self._delay_us - 1) * self._delay_us if self._unit else t_us - self._delay_us
        if until_us < 0:
            return 0
        latest = (until_us - self._phase_us) // self._period_us + 1  # jitter is below half a period
        return next(sample for sample in (latest, latest - 1, latest - 2) if self.at_us(sample) <= until_us)

    def age_us(self, tick: int) -> int:
        """t_k - s_i of the sample that is read at `tick`, us."""
        return tick * self._tick_us - self.at_us(self.read_at(tick))

    def first_tick(self, sample: int) -> int:
        """The first tick at which `sample` has come out."""
        out_us = self.at_us(sample) + self._delay_us
        if self._unit:
            out_us = -(-out_us // self._delay_us) * self._delay_us
        return -(-out_us // self._tick_us)


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
        if motion.t_ns == self.due_ns:
            self.observe(motion)
        wanted = self._instants.read_at(tick)
        while self._taken[0][0] < wanted:
            self._taken.popleft()
        sample, reading, self.valid = self._taken[0]
        assert sample == wanted, "every sample that is read was taken"
        age_us = reading.age_us + motion.t_ns // 1000 - self._instants.at_us(sample)
        return Reading(min(age_us, UINT32_MAX), reading.values)
