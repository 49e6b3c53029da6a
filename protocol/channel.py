"""The modelled channel between the ends: what happens to a frame and when it arrives, in simulated time.

The link moves bytes as fast as the host can; the channel says how long they would have taken and which are lost. This
is the seam for faults: a faulty channel has the same `fate` and answers otherwise.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit
NS_PER_S = 1_000_000_000

TO_BOARD, TO_LAB = "to_board", "to_lab"


class Fate(NamedTuple):
    """What becomes of one copy of a frame. `cause` is empty when it was delivered clean."""

    delivered: bool
    arrival_ns: int
    cause: str


class Channel(Protocol):
    """A model of the wire. The answer depends on the arguments alone, never on the order of calls."""

    def fate(self, direction: str, tick: int, frame_type: int, copy: int, encoded_len: int, t_ns: int) -> Fate:
        """Fate of copy number `copy` of a frame of `encoded_len` bytes on the wire; its first bit leaves at `t_ns`."""


def wire_time_ns(encoded_len: int, baud: int | None) -> int:
    """Time of `encoded_len` bytes at `baud`, rounded up to a nanosecond; 0 when the wire has no baud rate."""
    return 0 if baud is None else -(-encoded_len * BITS_PER_BYTE * NS_PER_S // baud)


class Clear:
    """A channel that delivers everything: arrival = t + 10 bits per encoded byte / baud.

    baud: bit/s, or None for a wire that takes no time. datagram: whether a frame travels as one datagram (no COBS, so
    `encoded_len` is the packet's length), which a faulty channel needs to know.
    """

    def __init__(self, baud: int | None, datagram: bool = False) -> None:
        if baud is not None and baud <= 0:
            raise ValueError(f"baud: expected a positive number or none, got {baud}")
        self.baud = baud
        self.datagram = datagram

    def fate(self, direction: str, tick: int, frame_type: int, copy: int, encoded_len: int, t_ns: int) -> Fate:
        """Delivered, one wire time later."""
        return Fate(True, t_ns + wire_time_ns(encoded_len, self.baud), "")
