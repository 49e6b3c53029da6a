"""Boards with one mistake each, in this process: what `sil board-test` has to find. `Host` plugs one in as a board.

A mistake is a few lines of a subclass of the Python board, of its flight, its port or its parts of CONFIG.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from firmware_sim.board import Board
from firmware_sim.flight import Flight
from firmware_sim.hal import HostHal
from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.config import Assembly
from protocol.frames import NO_TICK, Command, Config, Event, Hello, Packet, Ready, Telemetry, Type
from protocol.law_tables import COMMON
from protocol.links import Link, inproc
from protocol.port import Port
from sil.boards import BoardOrder


class Host:
    """A board in this process that runs whenever the laboratory waits, and says HELLO at boot."""

    pid = None
    wrong: ClassVar[Wrong]

    def __init__(self, order: BoardOrder) -> None:
        lab, end = inproc.pair()
        self.link: Link = lab
        lab.send = self._at_once(lab.send)  # type: ignore[method-assign]
        self._end = end
        self.port = self.wrong.port(end)
        self.board = self.wrong.board(self.port, HostHal(self.port))
        self.board.wrong = self.wrong  # type: ignore[attr-defined]
        lab.pump = self._run
        self.wrong.boot(self.board)

    def _at_once(self, send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """A write is a read on the other side, as on a slow line."""

        def send_and_run(data: bytes) -> None:
            send(data)
            self._run()

        return send_and_run

    def _run(self) -> None:
        while (packet := self.port.receive(0.0)) is not None:
            self.board.handle(packet)

    def check_alive(self) -> None:
        """As long as the test."""

    def post_mortem(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        self.link.close()
        self._end.close()


class Mistaken(Board):
    """A board whose flight and parts are of the mistake's classes."""

    wrong: Wrong

    def _forget(self) -> None:
        super()._forget()
        if hasattr(self, "wrong"):
            self._assembly.__class__ = self.wrong.assembly

    def _configure(self) -> Ready:
        ready = super()._configure()
        if self._flight is not None:
            self._flight.__class__ = self.wrong.flight
        return ready


@dataclass(frozen=True)
class Wrong:
    """One mistake: what is wrong, which checks have to say so, and the classes that make it."""

    what: str
    checks: tuple[str, ...]
    board: type[Board] = Mistaken
    flight: type[Flight] = Flight
    port: type[Port] = Port
    assembly: type[Assembly] = Assembly
    boot: Callable[[Board], None] = Board.announce

    @property
    def groups(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(check.partition(":")[0] for check in self.checks))


WRONG: list[Wrong] = []


def wrong(what: str, *checks: str, **classes: Any) -> Callable[[type], type]:
    """A decorator: this class is the mistake."""

    def keep(made: type) -> type:
        for base, name in ((Board, "board"), (Flight, "flight"), (Port, "port"), (Assembly, "assembly")):
            if issubclass(made, base):
                WRONG.append(Wrong(what, checks, **{name: made, **classes}))
        return made

    return keep


class Saying(Port):
    """A port that alters what the board says."""

    def say(self, frame: Any) -> Iterable[Any]:
        """What is sent instead."""
        return (frame,)

    def send(self, *out: Any) -> tuple[bytes, ...]:
        return super().send(*(said for frame in out for said in self.say(frame)))


class Hearing(Port):
    """A port that alters a packet before it looks at it; the CRC is made right again."""

    def hear(self, packet: bytearray) -> None:
        """Alter it in place."""

    def _take(self, raw: bytes) -> None:
        altered = bytearray(raw)
        self.hear(altered)
        super()._take(bytes(altered))


class Decoding(Port):
    """A port with another decoder."""

    decoder: type[StreamDecoder] = StreamDecoder

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self._decoder = self.decoder()


# -- handshake ---------------------------------------------------------------------------------------------------------


@wrong("a nonce of ones only is taken for none", "handshake: nonce")
class NoSuchNonce(Saying):
    def say(self, frame):
        none = isinstance(frame, Hello) and frame.nonce == 2**64 - 1
        return (frame._replace(nonce=0) if none else frame,)


@wrong("a clock rate of its own in HELLO", "handshake: echo")
class OwnRate(Saying):
    def say(self, frame):
        return (frame._replace(clock_rate_q16=65536) if isinstance(frame, Hello) else frame,)


@wrong("HELLO is answered twice", "handshake: once")
class Stutters(Saying):
    def say(self, frame):
        return (frame, frame) if isinstance(frame, Hello) and frame.flags & frames.HELLO_ECHO else (frame,)


@wrong("every third HELLO is not answered", "handshake: once")
class Deaf(Mistaken):
    heard = 0

    def _on_hello(self, packet):
        if packet.frame.nonce == self._nonce:
            self.heard += 1
            if self.heard % 3 == 0:
                return
        super()._on_hello(packet)


@wrong("flag configured is never set", "handshake: configured")
class NeverConfigured(Saying):
    def say(self, frame):
        return (frame._replace(flags=frame.flags & ~2) if isinstance(frame, Hello) else frame,)


@wrong("flag configured is set by any READY", "handshake: configured")
class ConfiguredByAnyReady(Mistaken):
    def _hello(self, echo):
        hello = super()._hello(echo)
        return hello._replace(flags=hello.flags | (frames.HELLO_CONFIGURED if self._ready else 0))


@wrong("none of the laws", "handshake: laws")
class NoLaws(Mistaken):
    def _configure(self):
        return Ready(frames.READY_UNKNOWN_LAW, 0, 0)


@wrong("a law is refused with its own defaults", "handshake: laws")
class RefusesDefaults(Mistaken):
    def _configure(self):
        ready = super()._configure()
        if self._flight is not None and self._flight._table.name == "mrac":
            self._flight = None
            return Ready(frames.READY_LAW_REFUSES, frames.NO_INDEX, 0)
        return ready


@wrong("answers are numbered on from one session to the next", "handshake: sequence")
class NumbersOn(Port):
    def reset(self, forget=True):
        number = self._send_next[0]
        super().reset(forget)
        self._send_next[0] = number


@wrong("HELLO and READY are numbered from 0 in each session", "handshake: sequence")
class NumbersAnew(Port):
    def reset(self, forget=True):
        super().reset(forget)
        self._send_next[1] = 0


@wrong("no zero before a frame", "handshake: framing")
class NoLeadingZero(Port):
    def write(self, *packets):
        self.link.send(b"".join(encode(packet)[1:] for packet in packets))


@wrong("it prints between its frames", "handshake: framing", "end: clean")
class Prints(Port):
    def write(self, *packets):
        super().write(*packets)
        self.link.send(b"tick\r\n")


# -- states ------------------------------------------------------------------------------------------------------------


@wrong("STOP is ignored", *(f"states: {name}" for name in ("configuring", "half configured", "refused", "ready", "running")),
       "end: left")  # fmt: skip
class IgnoresStop(Mistaken):
    def _on_stop(self, packet):
        pass


@wrong("STOP is answered", "states: ready", "states: running")
class AnswersStop(Mistaken):
    def _on_stop(self, packet):
        super()._on_stop(packet)
        self._port.send(self._hello(echo=False))


@wrong("without a session TICK is not answered", "states: unconfigured")
class SilentWithoutSession(Mistaken):
    def handle(self, packet):
        if self._nonce is not None or packet.type != Type.TICK:
            super().handle(packet)


@wrong("without a session SAMPLE is taken for tick 0 of one", "states: unconfigured")
class FliesWithoutSession(Mistaken):
    def handle(self, packet):
        if self._nonce is None and packet.type == Type.SAMPLE:
            self._port.send(Command(packet.tick, (0, 0, 0), 0, 0, frames.USED))
        else:
            super().handle(packet)


@wrong("the HELLO of a board is answered", "states: unconfigured", "states: running")
class AnswersBoards(Mistaken):
    def _on_hello(self, packet):
        super()._on_hello(packet._replace(frame=packet.frame._replace(role=frames.ROLE_LAB)))


@wrong("the same HELLO resets it", "states: ready", "states: running", "config: parts")
class ResetByTheSame(Mistaken):
    def _on_hello(self, packet):
        if packet.frame.role == frames.ROLE_LAB:
            self._nonce = None
        super()._on_hello(packet)


@wrong("a new HELLO does not reset it", "states: ready", "states: running")
class KeepsItsFlight(Mistaken):
    def _on_hello(self, packet):
        if packet.frame.role == frames.ROLE_LAB and self._flight is not None:
            self._nonce = packet.frame.nonce
            self._port.send(self._hello(echo=True))
        else:
            super()._on_hello(packet)


@wrong("CONFIG in flight begins anew", "states: running", "config: parts")
class ConfiguredAgain(Mistaken):
    def _on_config(self, packet):
        if self._ready is not None and self._ready.status == frames.READY_OK:
            nonce = self._nonce
            self._forget()
            self._nonce = nonce
        super()._on_config(packet)


@wrong("after a READY that says no, a second CONFIG is taken", "states: refused", "config: parts")
class TriesAgain(Mistaken):
    def _on_config(self, packet):
        if self._ready is not None and self._ready.status != frames.READY_OK:
            self._ready, self._assembly = None, Assembly()
        super()._on_config(packet)


@wrong("SAMPLE before READY is not answered", "states: configuring", "states: half configured", "states: refused")
class SilentBeforeReady(Mistaken):
    def _on_sample(self, packet):
        if self._flight is not None:
            super()._on_sample(packet)


@wrong("SAMPLE before READY is answered with an echo", "states: configuring")
class EchoesBeforeReady(Mistaken):
    def _on_sample(self, packet):
        if self._flight is None:
            self._port.send(self._hello(echo=True))
        else:
            super()._on_sample(packet)


@wrong("COMMAND to a board is taken for a TICK", "states: running", "receiver: refused")
class TakesCommands(Mistaken):
    def handle(self, packet):
        if packet.type == Type.COMMAND and self._flight is not None:
            self._on_tick(packet)
        else:
            super().handle(packet)


# -- CONFIG ------------------------------------------------------------------------------------------------------------


class Answering(Mistaken):
    """A board that alters its READY."""

    def said(self, ready: Ready) -> Ready:
        return ready

    def _configure(self):
        return self.said(super()._configure())


@wrong("the index of a bad word is one too high", "config: bad words", "config: rows")
class OffByOne(Answering):
    def said(self, ready):
        return ready._replace(index=ready.index + 1) if ready.status == frames.READY_BAD_WORD else ready


@wrong("the index of a READY without one is 0", "config: statuses")
class IndexZero(Answering):
    def said(self, ready):
        return ready._replace(index=0) if ready.status == frames.READY_MISSING_PARTS else ready


@wrong("too few words are a bad word", "config: statuses", "config: parts")
class OtherStatus(Answering):
    def said(self, ready):
        return ready._replace(status=1) if ready.status == frames.READY_MISSING_PARTS else ready


@wrong("what the law refuses is taken", "config: statuses")
class TakesAll(Answering):
    def said(self, ready):
        return Ready(0, frames.NO_INDEX, 0x12345678) if ready.status == frames.READY_LAW_REFUSES else ready


@wrong("READY has another hash", "config: rows", "config: limits", "config: parts", "config: many words")
class OtherHash(Answering):
    def said(self, ready):
        return ready._replace(table_hash=ready.table_hash ^ 1) if ready.status == frames.READY_OK else ready


@wrong("a refusal has a hash", "config: statuses", "config: bad words")
class HashOfRefusal(Answering):
    def said(self, ready):
        return ready._replace(table_hash=7) if ready.status != frames.READY_OK else ready


class Ranged(Mistaken):
    """A board that looks at one common word in its own way."""

    word, verdict = "", (lambda value: None)

    def _configure(self):
        words = self._assembly.words() or ()
        index = [word.name for word in COMMON].index(self.word)
        if len(words) > index and (found := type(self).verdict(words[index])) is not None:
            return found
        return super()._configure()


@wrong("a word one above its range is taken", "config: bad words")
class TooWide(Ranged):
    word = "torque_bits"
    verdict = staticmethod(lambda value: Ready(0, frames.NO_INDEX, 1) if value == 31 else None)


@wrong("a word at the end of its range is refused", "config: limits")
class TooNarrow(Ranged):
    word = "torque_bits"
    verdict = staticmethod(lambda value: Ready(1, 10, 0) if value == 8 else None)


@wrong("the same tick twice in the guidance rows is taken", "config: rows")
class EqualTicks(Answering):
    def said(self, ready):
        words = self._assembly.words() or ()
        if ready.status == frames.READY_BAD_WORD and ready.index > 40 and words[ready.index] == words[ready.index - 4]:
            return Ready(0, frames.NO_INDEX, 1)
        return ready


@wrong("parts are put together as they come", "config: parts")
class AsTheyCome(Assembly):
    def words(self):
        return tuple(word for part in self._parts.values() for word in part.words)


@wrong("a repeated part counts as another one", "config: parts")
class CountsTwice(Assembly):
    def add(self, part: Config) -> bool:
        done = super().add(part)
        self.count = getattr(self, "count", 0) + 1
        return done or self.count >= part.parts


@wrong("parts that overlap are taken", "config: parts")
class Overlapping(Assembly):
    def words(self):
        words: list[int] = []
        for part in sorted(self._parts.values()):
            words[part.offset :] = part.words
        return tuple(words)


@wrong("parts outlive a new nonce", "config: parts")
class KeepsParts(Mistaken):
    def _forget(self):
        kept = getattr(self, "_assembly", None)
        super()._forget()
        self._assembly = kept or self._assembly


@wrong("a thousand rows end it", "config: many words")
class NoRoom(Mistaken):
    def _on_config(self, packet):
        if packet.frame.parts < 60:
            super()._on_config(packet)


# -- receiver ----------------------------------------------------------------------------------------------------------


@wrong("reserved fields are not looked at", "receiver: refused")
class Reserved(Hearing):
    def hear(self, packet):
        if packet[1] == Type.SAMPLE:
            packet[55] = 0
        if packet[1] == Type.STOP:
            packet[10:12] = bytes(2)


@wrong("the header's version is not looked at", "receiver: refused")
class AnyVersion(Hearing):
    def hear(self, packet):
        packet[0] = 1


@wrong("the tick of STOP is not looked at", "receiver: refused", "end: left")
class AnyTick(Hearing):
    def hear(self, packet):
        if packet[1] == Type.STOP and packet[4:8] != b"\xff" * 4:
            packet[4:8] = NO_TICK.to_bytes(4, "little")
        elif packet[1] == Type.STOP:
            packet[4:8] = bytes(4)


@wrong("the CRC is not looked at", "receiver: refused", "states: running")
class NoCrc(Decoding):
    class decoder(StreamDecoder):
        def _close(self, encoded, packets):
            from cobs import cobs

            try:
                raw = cobs.decode(encoded)
            except cobs.DecodeError:
                return
            if 12 <= len(raw) <= 250:
                packets.append(raw)


@wrong("the frame behind garbage is lost", "receiver: garbage")
class LosesTheNext(Decoding):
    class decoder(StreamDecoder):
        def feed(self, data):
            before = self.counters.discarded_bytes
            packets = super().feed(data)
            return packets[1:] if self.counters.discarded_bytes > before else packets


@wrong("behind a candidate that is too long, it begins anew before the next zero", "receiver: garbage")
class NoDiscarding(Decoding):
    class decoder(StreamDecoder):
        def feed(self, data):
            packets = []
            for at in range(len(data)):
                packets += super().feed(data[at : at + 1])
                self._discarding = False
            return packets


@wrong("a frame has to come in one read", "receiver: cuts")
class WholeReads(Decoding):
    class decoder(StreamDecoder):
        def feed(self, data):
            self.reset()
            return super().feed(data)


# -- ticks -------------------------------------------------------------------------------------------------------------


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


# -- numbers, speed, the end -------------------------------------------------------------------------------------------


class OffByALsb(Flight):
    """One torque of one tick is a count off."""

    tick = 37

    def step(self, tick, sample):
        answer = super().step(tick, sample)
        if tick == self.tick:
            x, y, z = answer[0].torque
            answer[0] = answer[0]._replace(torque=(x, y + 1, z))
        return answer


WRONG += [Wrong("a torque is off by one count in one tick", ("numbers: pd", "numbers: mrac", "numbers: appc"), flight=OffByALsb)]


@wrong("a word of TELEMETRY is off by one count in one tick", "numbers: mrac")
class OffInTelemetry(Saying):
    def say(self, frame):
        if isinstance(frame, Telemetry) and frame.tick == 23:
            return (frame._replace(words=(*frame.words[:-1], frame.words[-1] + 1)),)
        return (frame,)


@wrong("an EVENT has another number", "numbers: appc")
class OtherEvent(Saying):
    def say(self, frame):
        return (frame._replace(b=frame.b + 1) if isinstance(frame, Event) else frame,)


@wrong("an answer comes after its tick", "latency")
class Slow(Flight):
    def step(self, tick, sample):
        if tick == 3 and sample is not None and sample.transit_us == 0:
            time.sleep(0.55)
        return super().step(tick, sample)


@wrong("at boot it does not say HELLO", "reset", boot=lambda board: None)
class SilentAtBoot(Mistaken):
    pass


def _boots_with_ready(board: Board) -> None:
    board.announce()
    board._port.send(Ready(0, frames.NO_INDEX, 0))


@wrong("at boot it says more than HELLO", "reset", boot=_boots_with_ready)
class ChattersAtBoot(Mistaken):
    pass


@wrong("it says HELLO now and then", "end: clean")
class Restless(Mistaken):
    count = 0

    def handle(self, packet: Packet) -> None:
        super().handle(packet)
        self.count += 1
        if packet.type == Type.HELLO and self.count % 3 == 0:
            self._port.send(self._hello(echo=False))


class Dies(Mistaken):
    """It is gone after so many frames."""

    left = 60

    def handle(self, packet: Packet) -> None:
        self.left -= 1
        if self.left > 0:
            super().handle(packet)


class Babbles(Mistaken):
    """It answers with anything that is a frame."""

    def handle(self, packet: Packet) -> None:
        super().handle(packet)
        tick = packet.tick if packet.tick != NO_TICK else 0
        choices = [
            Command(tick, (1, 2, 3), 0xFFFF, 200, frames.USED), Telemetry(tick, 1, 1, ()), Event(tick, 0xFFFF, -1, 1),
            Ready(9, 9, 9), Command(tick + 7, (0, 0, 0), 0, 0, frames.RESTARTED), Telemetry(tick, 7, 7, (1,) * 58),
            frames.Timing(tick, 1, 2, 3, 4), frames.Stop(3),
        ]  # fmt: skip
        if self._nonce is not None:
            self._port.send(*self.rng.sample(choices, self.rng.randrange(3)))

    rng = random.Random(5)


__all__ = ["WRONG", "Babbles", "Dies", "Host", "Wrong"]
