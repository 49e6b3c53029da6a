"""One end of a cable with a board on the other: frames out, and the answers they bring.

That nothing more comes is known without waiting for it: behind what is sent goes a HELLO, the barrier. A board answers
it in every state, in order, so what comes before its echo is all there is. A barrier with the session's own nonce
changes nothing (SPEC, 6.2); one with a new nonce begins a new session, and works in a board without one too.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from protocol import config, frames
from protocol.channel import wire_time_ns
from protocol.frames import Frame, Hello, Packet, Ready, Stop, Tick, Type
from protocol.link import LinkError
from sil.board_test.outcome import Silent, called, listed
from sil.doctor.talk import Talk

BUILD = "sil board-test"
HELLOS = 3  # of one greeting
ANSWER_BYTES = 1000  # of the longest answer: COMMAND, TELEMETRY, 16 EVENTs
KEPT_STRAYS = 8
NONCE_BITS = 64


@dataclass(frozen=True)
class Patience:
    """How long a board may take, wall seconds; the time on the wire comes on top."""

    hello_s: float = 4.0  # to be there at all
    answer_s: float = 2.0
    ready_s: float = 120.0  # it may compile its law
    boot_s: float = 30.0
    quiet_s: float = 0.05  # silence that counts as the end of what comes


class Bench:
    """Talks to the board on `talk`'s link, session after session. baud: of the wire, None where bytes take no time."""

    def __init__(self, talk: Talk, baud: int | None = None, patience: Patience | None = None) -> None:
        self.talk, self.port, self.baud = talk, talk.port, baud
        self.patience = patience or Patience()
        self.nonce = 0
        self.echo: Hello | None = None  # the last one
        self.strays: list[str] = []  # frames that nobody had asked for
        self.tape: list[Packet] | None = None  # everything that comes, while somebody wants it
        self._stays_silent = talk.heard.fileno() < 0  # a board in this process has answered, or never will

    # -- sessions ------------------------------------------------------------------------------------------------------

    def greet(self, clock_rate_q16: int = 0) -> Hello:
        """A new session: HELLO with a new nonce until it is echoed, a few times at most. Raises Silent."""
        self.nonce = fresh_nonce()
        for attempt in range(1, HELLOS + 1):
            self.send(self.hello(clock_rate_q16=clock_rate_q16))
            before = self._until_echo(self.nonce)
            if before is not None:
                self._stray(before)
                if attempt > 1:
                    self.settle()
                self.port.reset(forget=False)
                assert self.echo is not None
                return self.echo
        raise Silent(f"HELLO with a new nonce: not answered, {HELLOS} times, within {self._within_s(0):.1f} s each")

    def configure(self, words: Sequence[int]) -> Ready:
        """All parts of CONFIG, then READY, which may take its time. Raises Silent."""
        self.send(*config.split(words))
        return self.ready()

    def ready(self) -> Ready:
        """The READY that is due. Raises Silent."""
        got = self.until(lambda packet: packet.type == Type.READY, self.patience.ready_s, "CONFIG")
        self._stray(got[:-1])
        ready: Ready = got[-1].frame
        return ready

    def open(self, words: Sequence[int], clock_rate_q16: int = 0) -> Ready:
        """Greet and configure."""
        self.greet(clock_rate_q16)
        return self.configure(words)

    def hello(self, nonce: int | None = None, role: int = frames.ROLE_LAB, clock_rate_q16: int = 0) -> Hello:
        """A HELLO with this nonce; None: the session's."""
        named = self.nonce if nonce is None else nonce
        return Hello(frames.PROTOCOL_VERSION, role, 0, frames.LAYOUT_HASH, named, clock_rate_q16, BUILD)

    # -- exchanges -----------------------------------------------------------------------------------------------------

    def answers(self, *out: Frame | bytes) -> list[Packet]:
        """Send (a frame, or a packet as it stands), and everything that it brought. Needs a session. Raises Silent."""
        return self._behind(self.nonce, out)

    def last_answers(self, *out: Frame | bytes) -> list[Packet]:
        """The same in any state; what was a session is over, and a new one has begun."""
        self.nonce = fresh_nonce()
        got = self._behind(self.nonce, out)
        self.port.reset(forget=False)
        return got

    def answer(self, packet: bytes, tick: int) -> list[Packet]:
        """Write a packet that is to be answered for `tick`: COMMAND and the frames it announces. Raises Silent."""
        self.port.write(packet)
        missing: int | None = None  # until COMMAND says how many follow

        def complete(packet: Packet) -> bool:
            nonlocal missing
            if packet.type == Type.COMMAND and packet.tick == tick:
                missing = packet.frame.follows
            elif packet.type in (Type.TELEMETRY, Type.EVENT) and missing is not None:
                missing -= 1
            return missing == 0

        got = self.until(complete, self._within_s(len(packet)), f"tick {tick}")
        return [each for each in got if each.type != Type.TIMING]

    def _behind(self, nonce: int, out: Sequence[Frame | bytes]) -> list[Packet]:
        size = self.send(*out, self.hello(nonce))
        got = self._until_echo(nonce, size)
        if got is None:
            raise Silent(f"HELLO behind {listed(map(name_of, out))}: not answered within {self._within_s(size):.1f} s")
        return [packet for packet in got if packet.type != Type.TIMING]

    def _until_echo(self, nonce: int, size: int = 0) -> list[Packet] | None:
        """What comes before the echo of `nonce`; None where that does not come."""

        def is_echo(packet: Packet) -> bool:
            frame = packet.frame
            return packet.type == Type.HELLO and frame.nonce == nonce and bool(frame.flags & frames.HELLO_ECHO)

        try:
            got = self.until(is_echo, self._within_s(size), "HELLO")
        except Silent:
            return None
        self.echo = got[-1].frame
        return got[:-1]

    def until(self, wanted: Callable[[Packet], bool], within_s: float, after: str) -> list[Packet]:
        """Frames up to and including the one that is wanted. Raises Silent, LinkError."""
        got: list[Packet] = []
        give_up = time.monotonic() + within_s
        while (left_s := give_up - time.monotonic()) > 0.0:
            packet = self.receive(left_s)
            if packet is not None:
                got.append(packet)
                if wanted(packet):
                    return got
            elif self._stays_silent:
                break
        only = f", only {listed(map(called, got))}" if got else ""
        raise Silent(f"{after}: no answer within {within_s:.1f} s{only}")

    def receive(self, within_s: float) -> Packet | None:
        """The next frame."""
        self.talk.heard.until_s = time.monotonic() + within_s
        packet = self.port.receive(within_s)
        if packet is not None and self.tape is not None:
            self.tape.append(packet)
        return packet

    def settle(self) -> list[Packet]:
        """What still comes until it is quiet."""
        got = []
        give_up = time.monotonic() + self.patience.answer_s
        pause_s = self.patience.quiet_s + wire_time_ns(ANSWER_BYTES, self.baud) * 1e-9
        while time.monotonic() < give_up and (packet := self.receive(pause_s)) is not None:
            got.append(packet)
        return got

    # -- bytes ---------------------------------------------------------------------------------------------------------

    def send(self, *out: Frame | bytes) -> int:
        """One write for all on a byte stream. Returns how many bytes of packets."""
        packets = [each if isinstance(each, bytes) else self.port.pack(each) for each in out]
        self.port.write(*packets)
        return sum(map(len, packets))

    def raw(self, data: bytes) -> None:
        """Bytes on the link as they are."""
        self.port.link.send(data)

    def _within_s(self, size: int) -> float:
        return self.patience.answer_s + wire_time_ns(size + ANSWER_BYTES, self.baud) * 1e-9

    def _stray(self, packets: Sequence[Packet]) -> None:
        unasked = [called(packet) for packet in packets if packet.type != Type.TIMING]
        self.strays += unasked[: KEPT_STRAYS - len(self.strays)]

    # -- the end -------------------------------------------------------------------------------------------------------

    def leave(self) -> bool:
        """STOP; whether the board then says that it has no session: its answer to a TICK is HELLO with nonce 0."""
        self.send(Stop(frames.STOP_DONE), Tick(0))
        with suppress(Silent):
            got = self.until(_is_unconfigured, self._within_s(0), "TICK")
            return called(got[-1]) == "HELLO (nonce 0)"
        return False

    def close(self) -> None:
        """STOP, whatever came before, and close the link."""
        try:
            with suppress(LinkError):
                self.send(Stop(frames.STOP_DONE))
        finally:
            self.talk.close()


def _is_unconfigured(packet: Packet) -> bool:
    return packet.type == Type.HELLO and not packet.frame.nonce


def fresh_nonce() -> int:
    """Random, 64 bit, not 0."""
    return 1 + secrets.randbelow(2**NONCE_BITS - 1)


def name_of(out: Frame | bytes) -> str:
    """What is sent, in a word."""
    return "a refused packet" if isinstance(out, bytes) else type(out).__name__.upper()
