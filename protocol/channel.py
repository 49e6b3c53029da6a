"""The modelled channel between the ends: what happens to a frame and when it arrives, in simulated time.

The link moves bytes as fast as the host can; the channel says how long they would have taken and which are lost. This
is the seam for faults: a faulty channel (faulty.py) has the same `fates` and answers otherwise. SPEC.md, section 7.1.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit
NS_PER_S = 1_000_000_000

TO_BOARD, TO_LAB = "to_board", "to_lab"


class Damage(NamedTuple):
    """What byte faults do to the bytes of one copy on the wire: bits turned over first, then bytes taken out."""

    flips: tuple[int, ...]  # bit 8 i + j is bit j of byte i, rising
    lost: tuple[int, ...]  # bytes, rising

    def harmless(self, encoded_len: int) -> bool:
        """Only delimiters are missing: a neighbour's zero ends the frame as well."""
        return not self.flips and all(place in (0, encoded_len - 1) for place in self.lost)

    def of(self, encoded: bytes) -> bytes:
        """The altered bytes."""
        altered = bytearray(encoded)
        for bit in self.flips:
            altered[bit >> 3] ^= 1 << (bit & 7)
        for place in reversed(self.lost):
            del altered[place]
        return bytes(altered)


class Fate(NamedTuple):
    """What becomes of one copy of a frame. Whether it is in time is for those to say who know its deadline."""

    delivered: bool  # False: lost on the way
    arrival_ns: int  # of its last bit, in simulated time
    cause: str = ""  # of its loss or damage; "": none
    damage: Damage | None = None
    slow: str = ""  # what takes most of its time on the way; "": nothing


class Channel(Protocol):
    """A model of the wire. The answer depends on the arguments alone, never on the order of calls."""

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        """The fate of every copy of a frame, its own first.

        number: of the frame among those of its type in this tick. encoded_len: bytes of 0x00, COBS(packet), 0x00. t_ns:
        when its first bit leaves.
        """


def wire_time_ns(encoded_len: int, baud: int | None) -> int:
    """Time of `encoded_len` bytes at `baud`, rounded up to a nanosecond; 0 when the wire has no baud rate."""
    return 0 if baud is None else -(-encoded_len * BITS_PER_BYTE * NS_PER_S // baud)


class Clear:
    """A channel that delivers everything: arrival = t + 10 bits per encoded byte / baud.

    baud: bit/s, or None for a wire that takes no time.
    """

    def __init__(self, baud: int | None) -> None:
        if baud is not None and baud <= 0:
            raise ValueError(f"baud: expected a positive number or none, got {baud}")
        self.baud = baud

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        """One copy, delivered one wire time later."""
        return (Fate(True, t_ns + wire_time_ns(encoded_len, self.baud), slow="wire" if self.baud else ""),)
