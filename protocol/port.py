"""Frames over any link: the one place where frames meet bytes, and the recorder's tap.

Sends number their frames per class (SPEC.md, section 5); receives check the numbers and count what was refused.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from protocol.codec import Tap as CandidateTap
from protocol.codec import decoder_for, encode
from protocol.frames import (
    BadPacket,
    Frame,
    Hello,
    Packet,
    Ready,
    Stop,
    Tick,
    Timing,
    is_housekeeping,
    pack,
    unpack_checked,
)
from protocol.link import Link

Tap = Callable[[str, bytes], object]
FRUITLESS_READS = 64  # of garbage in a row, once the time is over; what is behind it is for the next receive
HOUSEKEEPING_FRAMES = frozenset((Hello, Ready, Tick, Timing, Stop))


@dataclass(slots=True, frozen=True)
class PortCounters:
    """Totals since the port was opened. `unknown`: right CRC, yet no frame we know; `strangers`: others' datagrams."""

    sent: int
    received: int
    unknown: int
    sequence_gaps: int
    duplicates: int
    crc_errors: int
    cobs_errors: int
    too_long: int
    too_short: int
    empty: int
    discarded_bytes: int
    strangers: int


class Port:
    """Frames over `link`. tap("tx" | "rx", packet) is called for every frame; candidates(encoded, reason) for every
    candidate of the decoder, good or bad."""

    def __init__(self, link: Link, tap: Tap | None = None, candidates: CandidateTap | None = None) -> None:
        self.link = link
        self._tap = tap
        self._decoder = decoder_for(link.datagram, candidates)
        self._ready: deque[Packet] = deque()
        self._send_next = [0, 0]  # deterministic, housekeeping
        self._expect: list[int | None] = [None, None]
        self._sent = self._received = self._unknown = self._gaps = self._duplicates = 0

    def send(self, *frames: Frame) -> tuple[bytes, ...]:
        """Number, pack and write. Returns the packets."""
        packets = tuple([self.pack(frame) for frame in frames])
        self.write(*packets)
        return packets

    def write(self, *packets: bytes) -> None:
        """Put packets on the link: one write for all on a byte stream, one datagram each otherwise."""
        link = self.link
        if link.datagram:
            for packet in packets:
                link.send(packet)
        elif packets:
            link.send(encode(packets[0]) if len(packets) == 1 else b"".join([encode(p) for p in packets]))
        self._sent += len(packets)
        if self._tap is not None:
            for packet in packets:
                self._tap("tx", packet)

    def write_altered(self, encoded: bytes) -> None:
        """Put bytes on the link that were those of a frame once: between zeros on a byte stream, else as a datagram.

        The other end's decoder discards them; they are no frame, and are neither counted nor tapped.
        """
        if not self.link.datagram:
            self.link.send(b"\0" + encoded + b"\0")
        elif encoded:
            self.link.send(encoded)

    def pack(self, frame: Frame) -> bytes:
        """Give the frame its sequence number and make its packet, for a later `write` (or several, when repeated)."""
        which = 1 if type(frame) in HOUSEKEEPING_FRAMES else 0
        sequence = self._send_next[which]
        packet = pack(frame, sequence)
        self._send_next[which] = (sequence + 1) & 0xFFFF
        return packet

    def receive(self, timeout_s: float | None) -> Packet | None:
        """The next valid frame, or None when none came within `timeout_s` (None: wait for ever). Raises LinkClosed."""
        ready = self._ready
        if ready:
            return ready.popleft()
        deadline, fruitless = time.monotonic() + timeout_s if timeout_s else 0.0, 0
        while True:
            data = self.link.receive(timeout_s)
            if not data:
                return None
            for raw in self._decoder.feed(data):
                self._take(raw)
            if ready:
                return ready.popleft()
            if timeout_s is not None:  # bytes, but no frame: wait on for what is left of the time
                timeout_s, fruitless = max(0.0, deadline - time.monotonic()), fruitless + 1
                if not timeout_s and fruitless > FRUITLESS_READS:
                    return None  # whoever floods us with garbage does not keep us

    def _take(self, raw: bytes) -> None:
        """One packet with a right CRC: count, check its number, queue it."""
        try:
            packet = unpack_checked(raw)
        except BadPacket:
            self._unknown += 1
            return
        self._check_sequence(packet)
        self._received += 1
        if self._tap is not None:
            self._tap("rx", raw)
        self._ready.append(packet)

    def _check_sequence(self, packet: Packet) -> None:
        """A number ahead of the expected one is a gap of so many frames; one behind is a duplicate or out of order."""
        which = 1 if is_housekeeping(packet.type) else 0
        expected, sequence = self._expect[which], packet.sequence
        if expected is not None and sequence != expected:
            ahead = (sequence - expected) & 0xFFFF
            if ahead >= 0x8000:
                self._duplicates += 1
                return
            self._gaps += ahead
        self._expect[which] = (sequence + 1) & 0xFFFF

    def reset(self, forget: bool = True) -> None:
        """A new session: deterministic numbers begin at 0 both ways, counters stay.

        forget: queued frames are of the old session (the lab's end, once the echo is there; behind a HELLO, on the
        board's end, they are of the new one). Housekeeping counts on; the next number of the other end is taken as it
        comes. A candidate that has begun is left alone: if it is of the old session, the zero before the next frame
        ends it.
        """
        self._send_next[0] = 0
        self._expect = [0, None]
        if forget:
            self._ready.clear()

    @property
    def counters(self) -> PortCounters:
        """Totals since the port was opened."""
        seen = self._decoder.counters
        return PortCounters(
            sent=self._sent,
            received=self._received,
            unknown=self._unknown,
            sequence_gaps=self._gaps,
            duplicates=self._duplicates,
            crc_errors=seen.crc_errors,
            cobs_errors=seen.cobs_errors,
            too_long=seen.too_long,
            too_short=seen.too_short,
            empty=seen.empty,
            discarded_bytes=seen.discarded_bytes,
            strangers=self.link.strangers,
        )

    def fileno(self) -> int:
        return self.link.fileno()

    def close(self) -> None:
        self.link.close()
