"""Mistakes in opening and closing sessions: HELLO, numbers on the line, the table of states."""

from __future__ import annotations

from wrong_boards import Mistaken, Saying, wrong

from protocol import frames
from protocol.codec import encode
from protocol.config import Assembly
from protocol.frames import Command, Hello, Ready, Type
from protocol.port import Port

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


SESSION_STATES = ("configuring", "half configured", "refused", "ready", "running")


@wrong("STOP is ignored", *(f"states: {name}" for name in SESSION_STATES), "end: left")
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
