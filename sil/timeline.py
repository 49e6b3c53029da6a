"""A scenario's `events:` worked out: outages of the channel, restarts of the board, rows of guidance, lines in the log.

All of it is known before the run begins, in integers, so that every clock meets it at the same tick.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from protocol import events as codes
from protocol.outages import NEVER_NS, Disconnect, Outage, PowerOff
from sil.profiles import SetpointRow
from sil.scenario_events import DISCONNECT, RESTART, SETPOINT, Event, span

Notice = tuple[int, int, int, int]  # tick, code, a, b


class Restart(NamedTuple):
    """The board is off at ticks off_tick .. on_tick - 1, and answers again from on_tick on."""

    off_tick: int
    on_tick: int


def setpoint_rows(events: Sequence[Event], period_us: int, ticks: int) -> tuple[SetpointRow, ...]:
    """Rows that the events add to the guidance profile's, in order of tick."""
    rows = [
        SetpointRow(span(event.at_s, None, period_us, ticks).first, event.deg)
        for event in events
        if event.do == SETPOINT and event.deg is not None
    ]
    return tuple(sorted(rows))


def restarts(events: Sequence[Event], period_us: int, ticks: int) -> tuple[Restart, ...]:
    """When the board is off."""
    return tuple(Restart(*span(e.at_s, e.for_s, period_us, ticks)) for e in events if e.do == RESTART)


def outages(events: Sequence[Event], period_us: int, ticks: int) -> tuple[Outage, ...]:
    """What the channel does not let through; a board that is off cuts off what was on its way."""
    found: list[Outage] = []
    for event in events:
        from_ns = _ns(event.at_s)
        if event.do == DISCONNECT:
            found.append(Disconnect(from_ns, NEVER_NS if event.for_s is None else from_ns + _ns(event.for_s)))
        elif event.do == RESTART:
            found.append(PowerOff(from_ns, span(event.at_s, event.for_s, period_us, ticks).first))
    return tuple(found)


def notices(events: Sequence[Event], period_us: int, ticks: int) -> Iterator[Notice]:
    """What the log says of the events, each at its tick."""
    words = {DISCONNECT: (codes.LINK_DOWN, codes.LINK_UP), RESTART: (codes.BOARD_OFF, codes.BOARD_ON)}
    for index, event in enumerate(events):
        first, end = span(event.at_s, event.for_s, period_us, ticks)
        if event.do == SETPOINT:
            yield first, codes.SETPOINT, first, index
            continue
        begins, ends = words[event.do]
        yield first, begins, first, end - first
        if end < ticks:
            yield end, ends, end, end - first


def _ns(time_s: float) -> int:
    return round(time_s * 1e6) * 1000
