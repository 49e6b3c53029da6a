"""Packets to bytes on a wire and back: COBS between zero bytes, and a decoder that any cut of the bytes leaves in step.

Byte stream: 0x00, COBS(packet), 0x00. Between two zeros stands one candidate; empty candidates are ignored. Datagram:
one packet, no COBS. SPEC.md, section 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from cobs import cobs

from protocol.frames import MAX_PACKET, MIN_PACKET, has_right_crc

MAX_ENCODED = MAX_PACKET + 1  # COBS adds one byte to a packet of at most 254
MIN_ENCODED = MIN_PACKET + 1
DELIMITER = b"\0"

Tap = Callable[[bytes, str], None]


@dataclass(slots=True)
class Counters:
    """What a receiver has seen and thrown away; `discarded_bytes` is every byte of a candidate that was no frame."""

    frames: int = 0
    empty: int = 0
    too_short: int = 0
    too_long: int = 0
    cobs_errors: int = 0
    crc_errors: int = 0
    discarded_bytes: int = 0


class Decoder(Protocol):
    """Bytes in, packets with a right CRC out. Never raises, keeps at most MAX_ENCODED bytes, counts what it drops."""

    counters: Counters

    def feed(self, data: bytes) -> list[bytes]: ...

    def reset(self) -> None: ...


def encode(packet: bytes) -> bytes:
    """The bytes of one packet on a byte stream."""
    encoded: bytes = cobs.encode(packet)
    return b"\0" + encoded + b"\0"


def decoder_for(datagram: bool, tap: Tap | None = None) -> Decoder:
    """The decoder that fits a link."""
    return DatagramDecoder(tap) if datagram else StreamDecoder(tap)


class StreamDecoder:
    """Decoder of a byte stream. `tap(encoded, reason)` sees every candidate, reason "" when it was a frame.

    The result and every counter depend on the bytes alone, not on how they were cut. A candidate longer than any frame
    is thrown away as it comes, up to the next zero; the tap then sees the first MAX_ENCODED + 1 bytes of it at most.
    """

    def __init__(self, tap: Tap | None = None) -> None:
        self.counters = Counters()
        self._tap = tap
        self._pending = b""
        self._discarding = False

    def reset(self) -> None:
        """Forget what has come of the present candidate; the counters stay."""
        self._pending = b""
        self._discarding = False

    @property
    def buffered(self) -> int:
        """Bytes kept from one feed to the next, at most MAX_ENCODED."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[bytes]:
        """The packets that `data` completes, in order."""
        pieces = data.split(DELIMITER)
        last = pieces.pop()
        packets: list[bytes] = []
        for piece in pieces:
            if self._discarding:
                self.counters.discarded_bytes += len(piece)
                self._discarding = False
                continue
            if self._pending:
                piece = self._pending + piece
                self._pending = b""
            if piece:
                self._close(piece, packets)
            else:
                self.counters.empty += 1
        if last:
            self._keep(last)
        return packets

    def _close(self, encoded: bytes, packets: list[bytes]) -> None:
        """A candidate is complete: keep its packet or say why not."""
        counters = self.counters
        if len(encoded) > MAX_ENCODED:
            counters.too_long += 1
            return self._drop(encoded, "too_long")
        if len(encoded) < MIN_ENCODED:
            counters.too_short += 1
            return self._drop(encoded, "too_short")
        try:
            packet = cobs.decode(encoded)
        except cobs.DecodeError:
            counters.cobs_errors += 1
            return self._drop(encoded, "cobs")
        if len(packet) < MIN_PACKET or not has_right_crc(packet):
            counters.crc_errors += 1
            return self._drop(encoded, "crc")
        counters.frames += 1
        packets.append(packet)
        if self._tap is not None:
            self._tap(encoded, "")
        return None

    def _keep(self, rest: bytes) -> None:
        """The beginning of a candidate: keep it, unless it is already longer than any frame."""
        if self._discarding:
            self.counters.discarded_bytes += len(rest)
            return
        self._pending += rest
        if len(self._pending) > MAX_ENCODED:
            self.counters.too_long += 1
            self._drop(self._pending, "too_long")
            self._pending = b""
            self._discarding = True

    def _drop(self, encoded: bytes, reason: str) -> None:
        self.counters.discarded_bytes += len(encoded)
        if self._tap is not None:
            self._tap(encoded[: MAX_ENCODED + 1], reason)


class DatagramDecoder:
    """Decoder of datagrams: each is one packet or nothing."""

    def __init__(self, tap: Tap | None = None) -> None:
        self.counters = Counters()
        self._tap = tap

    def reset(self) -> None:
        """Nothing is kept between datagrams."""

    def feed(self, data: bytes) -> list[bytes]:
        """[data] when it is a packet with a right CRC."""
        counters = self.counters
        if MIN_PACKET <= len(data) <= MAX_PACKET and has_right_crc(data):
            counters.frames += 1
            reason = ""
        elif not data:
            counters.empty += 1
            return []
        elif len(data) < MIN_PACKET:
            counters.too_short += 1
            reason = "too_short"
        elif len(data) > MAX_PACKET:
            counters.too_long += 1
            reason = "too_long"
        else:
            counters.crc_errors += 1
            reason = "crc"
        if self._tap is not None:
            self._tap(data[: MAX_ENCODED + 1], reason)
        if reason:
            counters.discarded_bytes += len(data)
            return []
        return [data]
