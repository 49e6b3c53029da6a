"""Outages of a modelled channel: a link that is disconnected for a while, a board that is switched off.

Disconnected is a channel around any other one. Every frame still gets one decision, and it depends on the arguments
alone: a frame that is on the wire at any time of an outage is lost, with the outage's name as its cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from protocol.channel import Channel, Fate

DISCONNECT, BOARD_RESTART = "disconnect", "board.restart"
NEVER_NS = 2**63 - 1


class Outage(Protocol):
    """A reason for which nothing passes."""

    @property
    def cause(self) -> str:
        """What the log says of a frame that is lost to it."""

    def takes(self, tick: int, sent_ns: int, arrival_ns: int) -> bool:
        """Does it lose a frame of `tick` that is on the wire from `sent_ns` to `arrival_ns`?"""


class Disconnect(NamedTuple):
    """The link is down in [from_ns, to_ns), both ways."""

    from_ns: int
    to_ns: int = NEVER_NS
    cause: str = DISCONNECT

    def takes(self, tick: int, sent_ns: int, arrival_ns: int) -> bool:
        return sent_ns < self.to_ns and arrival_ns >= self.from_ns


class PowerOff(NamedTuple):
    """The board is off from `from_ns` on, and has forgotten everything when it is back: `tick` is its first without.

    A frame of an earlier tick that has not arrived by then never does, however long it would take; frames of later
    ticks belong to another session.
    """

    from_ns: int
    tick: int
    cause: str = BOARD_RESTART

    def takes(self, tick: int, sent_ns: int, arrival_ns: int) -> bool:
        return tick < self.tick and arrival_ns >= self.from_ns


class Disconnected:
    """`good` with outages. What an outage takes is its own, whatever else `good` would have done to the frame."""

    def __init__(self, good: Channel, outages: Sequence[Outage]) -> None:
        self._good, self._outages = good, tuple(outages)

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        """The good channel's decisions, but for the copies that an outage takes."""
        good = self._good.fates(direction, tick, frame_type, number, encoded_len, t_ns)
        return tuple([self._decided(tick, t_ns, fate) for fate in good])

    def _decided(self, tick: int, t_ns: int, fate: Fate) -> Fate:
        for outage in self._outages:
            if outage.takes(tick, t_ns, fate.arrival_ns):
                return Fate(False, fate.arrival_ns, outage.cause)
        return fate
