"""Copies of frames as they arrive: what the channel's fates and byte faults make of a packet, and stale SAMPLEs.

Rules: protocol/SPEC.md, L17 and 7.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from protocol import frames
from protocol.channel import Fate
from protocol.codec import StreamDecoder, encode
from sil.sinks.journal import Fate as Outcome

ENCODED_EXTRA = 3  # COBS adds one byte to a packet of up to 254, and a zero stands on either side
ZERO = b"\0"
STALE_LIMIT = 256
HEADER_OF = (1, slice(4, 8))  # type and tick


class Copy(NamedTuple):
    """One copy of a frame at the other end."""

    number: int  # 0: the frame's own
    fate: Fate
    packet: bytes | None  # what the receiver's decoder makes of it; None: lost, or no frame
    wire: bytes  # its bytes where a byte fault altered them, else empty

    @property
    def arrival_ns(self) -> int:
        """When it arrives, if it does."""
        return self.fate.arrival_ns

    def outcome(self, in_time: bool) -> Outcome:
        """Its fate by name."""
        if self.packet is None:
            return Outcome.CORRUPTED if self.fate.delivered else Outcome.DROPPED
        return Outcome.DELIVERED if in_time else Outcome.LATE

    def cause(self, in_time: bool, why_late: str) -> str:
        """Of its loss, its damage, or its lateness."""
        return why_late if self.packet is not None and not in_time else self.fate.cause


def copies_of(packet: bytes, fates: Sequence[Fate]) -> list[Copy]:
    """What arrives of a packet, copy by copy."""
    if len(fates) == 1 and fates[0].delivered and fates[0].damage is None:
        return [Copy(0, fates[0], packet, b"")]
    return [_copy(number, packet, fate) for number, fate in enumerate(fates)]


def _copy(number: int, packet: bytes, fate: Fate) -> Copy:
    if fate.damage is None or not fate.delivered:
        return Copy(number, fate, packet if fate.delivered else None, b"")
    wire = fate.damage.of(encode(packet))
    return Copy(number, fate, _received(wire, packet), wire)


def _received(wire: bytes, sent: bytes) -> bytes | None:
    """The frame that altered bytes stand for, between the zeros of their neighbours; None: none, or another one."""
    found = StreamDecoder().feed(ZERO + wire + ZERO)
    if len(found) != 1 or any(found[0][part] != sent[part] for part in HEADER_OF):
        return None
    try:
        frames.unpack(found[0])
    except frames.BadPacket:
        return None
    return found[0]


def first_arrival_ns(fates: Sequence[Fate], encoded_len: int) -> int:
    """When the first copy that arrives whole is there; where none does, when the frame itself would have been."""
    if len(fates) == 1:
        return fates[0].arrival_ns
    whole = [fate.arrival_ns for fate in fates if fate.delivered and _is_whole(fate, encoded_len)]
    return min(whole) if whole else fates[0].arrival_ns


def _is_whole(fate: Fate, encoded_len: int) -> bool:
    return fate.damage is None or fate.damage.harmless(encoded_len)


def first_of(copies: Sequence[Copy]) -> Copy | None:
    """The copy that arrives first, of those that arrive whole."""
    if len(copies) == 1:
        return copies[0] if copies[0].packet is not None else None
    whole = [copy for copy in copies if copy.packet is not None]
    return min(whole, key=lambda copy: (copy.arrival_ns, copy.number)) if whole else None


class Waiting(NamedTuple):
    """A copy of SAMPLE(tick) under way, in order of arrival, tick and copy."""

    arrival_ns: int
    tick: int
    copy: int
    packet: bytes


class Stale:
    """Copies of SAMPLEs on their way that no tick will be stepped on, at most STALE_LIMIT: one more loses the first."""

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []

    def add(self, arrival_ns: int, tick: int, copy: int, packet: bytes) -> None:
        """It arrives whole, at arrival_ns."""
        self._waiting.append(Waiting(arrival_ns, tick, copy, packet))
        if len(self._waiting) > STALE_LIMIT:
            self._waiting.remove(min(self._waiting))

    def due(self, t_ns: int, tick: int) -> list[Waiting]:
        """Those of ticks before `tick` that are there by t_ns, in the order of L17; they are taken off."""
        if not self._waiting:
            return []
        arrived = sorted(each for each in self._waiting if each.arrival_ns <= t_ns and each.tick < tick)
        self._waiting = [each for each in self._waiting if each not in arrived]
        return arrived

    def forget(self) -> None:
        """The session is lost."""
        self._waiting.clear()
