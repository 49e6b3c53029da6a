"""Bytes that came and were no frame: what they look like (text, a wrong baud rate, a loop), and how they are shown."""

from __future__ import annotations

import math
import time
from typing import NamedTuple

from protocol import frames
from protocol.link import Link, LinkError

KEEP_BYTES = 4096  # of what came; the rest is only counted
ROW_BYTES, SHOWN_ROWS = 16, 4
MOSTLY = 0.85
FEW_BYTES = 12  # too few to say anything about
PRINTABLE = frozenset((*range(0x20, 0x7F), *b"\t\r\n\x1b"))
# A UART that samples at another rate than the sender's reads edges as runs of ones or zeros.
RUNS = frozenset((0x00, 0x80, 0xC0, 0xE0, 0xF0, 0xF8, 0xFC, 0xFE, 0xFF))


class Guess(NamedTuple):
    """What bytes look like: a word for programs, a line for people, and what to do."""

    kind: str
    found: str
    advice: str


class Overheard(Link):
    """A link that keeps the first KEEP_BYTES of what comes, as it comes, and hands everything on.

    After `until_s` of time.monotonic() nothing comes any more: a port goes on reading for as long as there are bytes.
    """

    def __init__(self, inner: Link) -> None:
        self.inner = inner
        self.datagram = inner.datagram
        self.url = inner.url
        self.kept = bytearray()
        self.count = 0
        self.until_s = math.inf

    @classmethod
    def open(cls, url: str, listen: bool) -> Link:
        raise LinkError("overheard: wraps a link that is open already")

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        raise LinkError("overheard: wraps a link that is open already")

    def send(self, data: bytes) -> None:
        self.inner.send(data)

    def receive(self, timeout_s: float | None) -> bytes:
        if time.monotonic() > self.until_s:
            return b""
        data = self.inner.receive(timeout_s)
        self.count += len(data)
        self.kept += data[: max(0, KEEP_BYTES - len(self.kept))]
        return data

    def fileno(self) -> int:
        return self.inner.fileno()

    def close(self) -> None:
        self.inner.close()


def guess(data: bytes) -> Guess:
    """What bytes that were no frame look like."""
    if len(data) < FEW_BYTES:
        return Guess("few", "too few to tell what they are", "noise when a cable is plugged in is no matter")
    text = _share(data, PRINTABLE)
    if text >= MOSTLY:
        return Guess("text", "text: a console, a log or another program's protocol", TEXT_ADVICE)
    if data.count(0x00) / len(data) >= MOSTLY:
        return Guess("break", "almost all 00: the line is held low", BREAK_ADVICE)
    if _share(bytes(byte & 0x7F for byte in data), PRINTABLE) >= MOSTLY + 0.1:
        return Guess("parity", "text once bit 7 is taken off: the sender adds a parity bit (7E1)", PARITY_ADVICE)
    if _share(data, RUNS) >= 0.5:
        return Guess("baud", "mostly runs of ones and zeros, as a wrong baud rate makes them", BAUD_ADVICE)
    return Guess("binary", "neither text nor frames: wrong baud rate, or another program's protocol", BAUD_ADVICE)


TEXT_ADVICE = "look at it with a terminal program; the board speaks on another of its ports, or prints before it speaks"
BREAK_ADVICE = "the transmitter is off, swapped or inverted, or its level is wrong (RS-232 against 3.3 V)"
PARITY_ADVICE = "set the board to 8 data bits, no parity, 1 stop bit"
BAUD_ADVICE = "compare the baud rates of both ends; --try-bauds tries the usual ones"


def _share(data: bytes, members: frozenset[int]) -> float:
    return sum(byte in members for byte in data) / len(data)


def is_our_own(packet: frames.Packet, nonce: int) -> bool:
    """Whether this is the HELLO that we sent ourselves."""
    if packet.type != frames.Type.HELLO:
        return False
    hello: frames.Hello = packet.frame
    return hello.role == frames.ROLE_LAB and hello.nonce == nonce


def rows(data: bytes) -> tuple[str, ...]:
    """The first bytes, hexadecimal and as text: `0000  48 65 6c 6c 6f ...  |Hello...|`"""
    cut = data[: ROW_BYTES * SHOWN_ROWS]
    return tuple(
        f"{start:04x}  {piece.hex(' '):<{3 * ROW_BYTES - 1}}  |{''.join(map(_character, piece))}|"
        for start in range(0, len(cut), ROW_BYTES)
        if (piece := cut[start : start + ROW_BYTES])
    )


def _character(byte: int) -> str:
    return chr(byte) if 0x20 <= byte < 0x7F else "."
