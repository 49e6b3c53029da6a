"""The timeline of a scenario, `events:`: what happens in mid-run on purpose; its keys, and what contradicts what.

    events: [{at_s: 120, do: link.disconnect, for_s: 10}, {at_s: 200, do: board.restart, for_s: 2},
             {at_s: 250, do: setpoint, deg: [5, 0, 0]}]

An event begins at the first tick that is not before at_s, and is over at the first one that is not before at_s + for_s.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator

from sil.scenario_errors import Path
from sil.scenario_sections import Expected, Lapse, Moment, Numbers3, Section, numbers_of

MOST_DEG = 360e6
MOST_EVENTS = 1000  # and faults of an instrument: each is held against every other
DISCONNECT, RESTART, SETPOINT = "link.disconnect", "board.restart", "setpoint"


def _angles(value: object) -> object:
    if value is None:
        return None
    if (numbers := numbers_of(value, 3)) is None or max(map(abs, numbers)) > MOST_DEG:
        raise Expected(f"3 numbers in deg, within +-{MOST_DEG:g}")
    return numbers


class Event(Section):
    """Something that happens on purpose while the run goes on."""

    at_s: Moment
    """Simulation time; it begins at the first tick not before."""
    do: Literal["link.disconnect", "board.restart", "setpoint"]
    """link.disconnect: nothing passes, either way; board.restart: the board is off, and comes back with nothing in its
    memory; setpoint: another commanded attitude."""
    for_s: Lapse | None = None
    """How long the link is down (null: to the end) or the board is off."""
    deg: Annotated[Numbers3 | None, BeforeValidator(_angles)] = None
    """For setpoint: the commanded attitude, until the guidance profile or another event changes it."""


class Span(NamedTuple):
    """Ticks first .. end - 1 of a run; `end` is the number of its ticks where it lasts to its end."""

    first: int
    end: int


def span(at_s: float, for_s: float | None, period_us: int, ticks: int) -> Span:
    """The ticks with at_s <= t_k < at_s + for_s; microseconds count, so that no rounding moves a tick."""
    at_us = round(at_s * 1e6)
    end = ticks if for_s is None else -(-(at_us + round(for_s * 1e6)) // period_us)
    return Span(-(-at_us // period_us), end)


class Finding(NamedTuple):
    """What is wrong with one key."""

    path: Path
    expected: str
    got: Any


def time_findings(path: Path, at_s: float, for_s: float | None, period_us: int, ticks: int) -> Iterator[Finding]:
    """A start or an end beyond the end of the run. Faults of instruments have the same two keys."""
    duration_s = ticks * period_us / 1e6
    if span(at_s, for_s, period_us, ticks).first >= ticks:
        last_s = (ticks - 1) * period_us / 1e6
        yield Finding((*path, "at_s"), f"at most {last_s:g} s, the last tick's time", at_s)
    elif for_s is not None and round((at_s + for_s) * 1e6) > ticks * period_us:
        most = f"at most {duration_s - at_s:g} s: the run ends at {duration_s:g} s"
        yield Finding((*path, "for_s"), most, for_s)


def findings(events: Sequence[Event], board: str, period_us: int, ticks: int) -> Iterator[Finding]:
    """What one event alone, or one beside another, cannot mean."""
    if len(events) > MOST_EVENTS:
        yield Finding(("events",), f"at most {MOST_EVENTS} events", len(events))
        return
    for index, event in enumerate(events):
        path: Path = ("events", index)
        yield from time_findings(path, event.at_s, event.for_s, period_us, ticks)
        yield from _keys_of(path, event)
        if board == "none":
            yield Finding((*path, "do"), "an event of a run with a board (board is none)", event.do)
        elif event.do == RESTART and event.for_s is not None:
            off = span(event.at_s, event.for_s, period_us, ticks)
            if off.first == off.end:
                expected = f"a time in s that covers a tick, one every {period_us / 1e6:g} s"
                yield Finding((*path, "for_s"), expected, event.for_s)
        for other, before in enumerate(events[:index]):
            if before.do == event.do and _meet(before, event, period_us, ticks):
                yield Finding((*path, "at_s"), f"no overlap with events[{other}] ({before.at_s:g} s)", event.at_s)


def _keys_of(path: Path, event: Event) -> Iterator[Finding]:
    """Keys that this verb needs, or has no use for."""
    if event.do == RESTART and event.for_s is None:
        yield Finding((*path, "for_s"), "a number in s above 0, how long the board is off", None)
    if event.do == SETPOINT and event.for_s is not None:
        yield Finding((*path, "for_s"), "no such key: a set-point lasts until the next one", event.for_s)
    if event.do == SETPOINT and event.deg is None:
        yield Finding((*path, "deg"), "3 numbers in deg for setpoint", None)
    if event.do != SETPOINT and event.deg is not None:
        yield Finding((*path, "deg"), f"no such key with {event.do}", event.deg)


def _meet(one: Event, other: Event, period_us: int, ticks: int) -> bool:
    """Two events of the same kind at the same time; a set-point is an instant."""
    if one.do == SETPOINT:
        return span(one.at_s, None, period_us, ticks).first == span(other.at_s, None, period_us, ticks).first
    ends = [float("inf") if each.for_s is None else each.at_s + each.for_s for each in (one, other)]
    return one.at_s < ends[1] and other.at_s < ends[0]
