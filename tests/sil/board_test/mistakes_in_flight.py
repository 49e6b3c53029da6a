"""Mistakes with ticks: the timing contract, clause by clause."""

from __future__ import annotations

from wrong_boards import Mistaken, Saying, wrong

from firmware_sim.flight import Flight
from protocol import frames
from protocol.frames import Command, Telemetry
from protocol.port import Port


@wrong("SAMPLE is answered twice", "ticks: answer", "ticks: random")
class AnswersTwice(Saying):
    def say(self, frame):
        return (frame, frame) if isinstance(frame, Command) else (frame,)


@wrong("`follows` is one too many", "ticks: answer")
class FollowsTooMany(Saying):
    def say(self, frame):
        return (frame._replace(follows=frame.follows + 1) if isinstance(frame, Command) else frame,)


@wrong("TELEMETRY behind the EVENTs", "ticks: answer")
class OtherOrder(Port):
    def send(self, *out):
        return super().send(*sorted(out, key=lambda frame: isinstance(frame, Telemetry)))


@wrong("TELEMETRY every tick, whatever CONFIG says", "ticks: answer")
class Talkative(Flight):
    def step(self, tick, sample):
        self._telemetry_every = 1
        return super().step(tick, sample)


@wrong("TICK is answered again and again", "ticks: TICK")
class TicksAgain(Mistaken):
    def _on_tick(self, packet):
        if self._flight is not None and packet.tick < self._next_tick:
            self._next_tick = packet.tick
        super()._on_tick(packet)


@wrong("TICK steps its own tick only", "ticks: TICK", "ticks: ahead")
class OneTick(Mistaken):
    def _on_tick(self, packet):
        if self._flight is not None:
            self._next_tick = max(self._next_tick, packet.tick)
        super()._on_tick(packet)


@wrong("a stale SAMPLE is answered", "ticks: stale")
class AnswersStale(Mistaken):
    def _on_sample(self, packet):
        super()._on_sample(packet)
        if self._flight is not None and packet.tick < self._next_tick - 1:
            self._port.send(Command(packet.tick, (0, 0, 0), 0, 0, frames.REPEATED))


@wrong("a stale SAMPLE is not counted", "ticks: stale", "ticks: events")
class ForgetsStale(Flight):
    def count_dropped(self, tick):
        pass


class Ahead(Mistaken):
    """A board that re-starts from another distance on."""

    limit = 4

    def _on_sample(self, packet):
        flight = self._flight
        if flight is None or packet.tick < self._next_tick:
            return super()._on_sample(packet)
        if packet.tick - self._next_tick > self.limit:
            flight.restart(self._next_tick, packet.tick)
            self._next_tick = packet.tick
        while self._next_tick < packet.tick:
            self._step(None)
        self._step(packet.frame)


@wrong("four ticks ahead is a re-start already", "ticks: ahead")
class TooSoon(Ahead):
    limit = 3


@wrong("five ticks ahead are propagated", "ticks: re-start")
class TooLate(Ahead):
    limit = 5


@wrong("a re-start forgets the counters", "ticks: re-start")
class CountersAnew(Flight):
    def restart(self, expected, tick):
        super().restart(expected, tick)
        self._lost = self._dropped = 0


@wrong("a re-start keeps the law's state", "ticks: re-start")
class KeepsState(Flight):
    def restart(self, expected, tick):
        law = self._law
        super().restart(expected, tick)
        self._law = law


@wrong("the link watchdog is a tick late", "ticks: watchdog")
class LateWatchdog(Flight):
    def _watch(self, tick, heard, notices):
        self._link_limit = 6
        return super()._watch(tick, heard, notices)


@wrong("the link watchdog leaves the torque", "ticks: watchdog")
class LoudWatchdog(Flight):
    def step(self, tick, sample):
        answer = super().step(tick, sample)
        loud = answer[0].flags & frames.FLAG_WATCHDOG
        return [answer[0]._replace(torque=(1, 0, 0)) if loud else answer[0], *answer[1:]]


@wrong("an invalid SAMPLE does not end the watchdog", "ticks: watchdog")
class OnlyUsable(Flight):
    def _watch(self, tick, heard, notices):
        return super()._watch(tick, heard and self._good_run > 0, notices)


@wrong("busy until before the next SAMPLE, by a whole period", "ticks: overrun")
class NoMailbox(Flight):
    def _admit(self, tick, sample):
        usable, overrun = super()._admit(tick, sample)
        self._free_at_ns -= self._answer_delay_ns // 2
        return usable, overrun


@wrong("an invalid reading is used", "ticks: invalid")
class UsesInvalid(Flight):
    def _admit(self, tick, sample):
        return super()._admit(tick, None if sample is None else sample._replace(valid=7))


@wrong("a lost reading that it does not need counts as lost", "ticks: invalid")
class NeedsAll(Flight):
    def _admit(self, tick, sample):
        self._needs = 7
        return super()._admit(tick, sample)


@wrong("identification resumes a sample early", "ticks: pause")
class ResumesEarly(Flight):
    def _fill(self, tick, sample):
        real, self._good_run = self._good_run, self._good_run + (self._good_run > 0)
        super()._fill(tick, sample)
        self._good_run = real


@wrong("`stale: reuse` is not looked at", "ticks: reuse")
class NeverReuses(Flight):
    def _admit(self, tick, sample):
        self._reuse = False
        return super()._admit(tick, sample)


@wrong("`stale: reuse` outlives a re-start", "ticks: reuse")
class ReusesOldTimes(Flight):
    def _begin(self):
        had = getattr(self, "_has_reading", False)
        super()._begin()
        self._has_reading = had


@wrong("a reused sample is none that is lost", "ticks: reuse")
class CountsReused(Flight):
    def _admit(self, tick, sample):
        usable, overrun = super()._admit(tick, sample)
        self._lost -= self._reused
        return usable, overrun


@wrong("the set-point is gone where no SAMPLE comes", "ticks: set-point")
class ForgetsSetpoint(Flight):
    def _take_setpoint(self, tick, sample):
        super()._take_setpoint(tick, sample)
        if self._setpoint_from_sample and sample is None:
            self._setpoint = (0, 0, 0)


@wrong("a guidance row holds a tick late", "ticks: set-point")
class LateRow(Flight):
    def _take_setpoint(self, tick, sample):
        super()._take_setpoint(tick - 1, sample)


@wrong("seventeen EVENTs", "ticks: events")
class ManyEvents(Flight):
    def _answer(self, tick, torque, flags, usable, notices):
        answer = super()._answer(tick, torque, flags, usable, notices)
        extra = notices[16:17]
        return [answer[0]._replace(follows=answer[0].follows + len(extra)), *answer[1:], *extra]


@wrong("tick numbers are signed", "ticks: far")
class SignedTicks(Mistaken):
    def _on_sample(self, packet):
        if packet.tick < 2**31:
            super()._on_sample(packet)


@wrong("a step without a SAMPLE costs no time", "ticks: random")
class NeverBusyAlone(Flight):
    def _admit(self, tick, sample):
        free_at = self._free_at_ns
        found = super()._admit(tick, sample)
        if sample is None:
            self._free_at_ns = free_at
        return found
