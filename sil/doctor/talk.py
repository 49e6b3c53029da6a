"""Talking to a board without a session's cost: HELLO until it is echoed, then HELLO again and again, with a stop watch.

The exchange is legal in every state of a board (SPEC.md, section 6.2): the first HELLO has a new nonce and resets it,
those that follow have the same and are only answered. It needs no law and no CONFIG, works with a board of another
protocol version, and ends with STOP. What it measures: system call, driver, wire, the board's receiver, decoder,
encoder, and all of that back; not the law.
"""

from __future__ import annotations

import secrets
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from protocol import frames
from protocol.channel import wire_time_ns
from protocol.codec import encode
from protocol.frames import Hello, Packet, Stop, Type
from protocol.link import Link, LinkError
from protocol.port import Port
from sil.doctor.overheard import Overheard, is_our_own

BUILD = "sil doctor"
HELLO_EVERY_S = 0.2
ANSWER_S = 1.0  # and the time on the wire
QUIET_S = 0.05
LOST_IN_A_ROW = 5
LONGEST_S = 120.0
KEEP_DROPPED = 4096  # bytes of candidates that were no frame

Tell = Callable[[str], None]


@dataclass
class RoundTrips:
    """What came of `asked` exchanges. `stopped`: why it were fewer, or ""."""

    asked: int
    times_ns: list[int] = field(default_factory=list)
    lost: int = 0
    stopped: str = ""

    @property
    def tried(self) -> int:
        return len(self.times_ns) + self.lost


class Talk:
    """One conversation over `link`, which it closes. baud: of the wire, None where bytes take no time."""

    def __init__(self, link: Link, baud: int | None) -> None:
        self.heard = Overheard(link)
        self.port = Port(self.heard, candidates=self._candidate)
        self.dropped = bytearray()
        self.types: Counter[str] = Counter()  # frames that came unasked
        self.own_echoes = 0
        self._said_hello = False
        self._nonce = 1 + secrets.randbelow(2**64 - 1)
        self._hello = Hello(frames.PROTOCOL_VERSION, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, self._nonce, 0, BUILD)
        self.exchange_bytes = 2 * self._bytes_of_hello()
        self.wire_ns = wire_time_ns(self.exchange_bytes, baud)

    def _bytes_of_hello(self) -> int:
        packet = frames.pack(self._hello, 0)
        return len(packet) if self.heard.datagram else len(encode(packet))

    # -- before anybody was asked --------------------------------------------------------------------------------------

    def listen(self, for_s: float) -> None:
        """Take what comes unasked. Raises LinkClosed."""
        self._await_echo(for_s)

    def greet(self, within_s: float, tell: Tell) -> Hello | None:
        """HELLO every 0.2 s until it is echoed, at most `within_s`; None when it was not. Raises LinkClosed."""
        began = time.monotonic()
        while (waited_s := time.monotonic() - began) < within_s:
            self._say_hello()
            echo = self._await_echo(HELLO_EVERY_S + self.wire_ns * 1e-9)
            if echo is not None:
                self._settle()
                return echo
            tell(f"waiting for a board to answer HELLO: {waited_s:.0f} of {within_s:g} s")
        return None

    # -- round trips ---------------------------------------------------------------------------------------------------

    def round_trips(self, count: int, tell: Tell, longest_s: float = LONGEST_S) -> RoundTrips:
        """HELLO and its echo, `count` times, one after the other. Raises LinkClosed."""
        result = RoundTrips(count)
        began = time.monotonic()
        in_a_row = 0
        while result.tried < count and not result.stopped:
            time_ns = self._round_trip()
            in_a_row = 0 if time_ns is not None else in_a_row + 1
            if time_ns is not None:
                result.times_ns.append(time_ns)
            else:
                result.lost += 1
                self._settle()
            passed_s = time.monotonic() - began
            if in_a_row >= LOST_IN_A_ROW:
                result.stopped = f"{in_a_row} in a row were not answered"
            elif passed_s > longest_s:
                result.stopped = f"{longest_s:g} s are over"
            left_s = passed_s / result.tried * (count - result.tried)
            tell(f"round trips: {result.tried} of {count}, {left_s:.0f} s left")
        return result

    def _round_trip(self) -> int | None:
        """Nanoseconds from before the write until the echo was decoded, None when it did not come."""
        began_ns = time.perf_counter_ns()
        self._say_hello()
        echo = self._await_echo(ANSWER_S + self.wire_ns * 1e-9)
        return None if echo is None else time.perf_counter_ns() - began_ns

    def _settle(self) -> None:
        """Wait until nothing comes any more: the echo of an earlier HELLO looks like the next one's."""
        give_up = time.monotonic() + ANSWER_S
        while time.monotonic() < give_up and self._receive(QUIET_S + self.wire_ns * 1e-9) is not None:
            pass

    # -- one frame -----------------------------------------------------------------------------------------------------

    def _say_hello(self) -> None:
        self._said_hello = True
        self.port.send(self._hello)

    def _await_echo(self, within_s: float) -> Hello | None:
        give_up = time.monotonic() + within_s
        while (left_s := give_up - time.monotonic()) > 0.0:
            packet = self._receive(left_s)
            if packet is not None and self._is_echo(packet):
                echo: Hello = packet.frame
                return echo
        return None

    def _receive(self, within_s: float) -> Packet | None:
        """The next frame; who babbles without a pause does not hold us up longer than `within_s`."""
        self.heard.until_s = time.monotonic() + within_s
        return self.port.receive(within_s)

    def _is_echo(self, packet: Packet) -> bool:
        if packet.type == Type.HELLO:
            hello: Hello = packet.frame
            if hello.role == frames.ROLE_BOARD and hello.nonce == self._nonce and hello.flags & frames.HELLO_ECHO:
                return True
        if is_our_own(packet, self._nonce):
            self.own_echoes += 1
        else:
            self.types[Type(packet.type).name] += 1
        return False

    def _candidate(self, encoded: bytes, reason: str) -> None:
        if reason:
            self.dropped += encoded[: max(0, KEEP_DROPPED - len(self.dropped))]

    def undecoded(self) -> bytes:
        """What came and was no frame: everything when nothing was one, else the candidates that were thrown away."""
        return bytes(self.dropped if self.port.counters.received else self.heard.kept)

    def close(self) -> None:
        """STOP if we said HELLO, so that the board forgets us; then the link is closed, whatever happened."""
        try:
            if self._said_hello:
                self._said_hello = False
                with suppress(LinkError):  # the link may be what failed
                    self.port.send(Stop(frames.STOP_DONE))
        finally:
            self.port.close()
