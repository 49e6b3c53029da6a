"""What the laboratory tells the process that draws: one JSON array per datagram, the name of its kind first."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, NamedTuple

BIGGEST = 1 << 20  # bytes of a datagram
BEGIN_FRAME, END_FRAME = "\x1b[?2026h", "\x1b[?2026l"  # synchronized output; terminals that do not know it ignore it
SHOW_CURSOR = "\x1b[?25h"

Triple = tuple[float, float, float]
Sample = tuple[float, Triple, Triple | None]  # simulated s, attitude and reference in deg
EventRow = tuple[float, int, int, int, int]  # simulated s, code, a, b, origin (0 laboratory, 1 board)


class Plan(NamedTuple):
    """What does not change in a run."""

    scenario: str
    about: tuple[str, ...]  # law, clock, board and link, for the title
    duration_s: float
    window_s: float  # how far back histories go
    period_s: float
    wall_period_ms: float | None  # None: lockstep
    torque_max_Nm: tuple[float | None, ...]
    momentum_max_Nms: tuple[float | None, ...]
    follows: str  # what attitude is held against: `reference`, `set-point`; "": nothing


class State(NamedTuple):
    """What a run looks like after a tick. Lists hold what is new since the last State."""

    t_s: float  # simulated
    wall_s: float  # since the run began
    attitude_deg: Triple
    held_against: Sample | None  # the newest instant of which attitude and reference are both known
    torque_Nm: Triple  # commanded
    source: str  # of the command that acts: fresh, held, zero
    momentum_Nms: Triple
    late_ns: list[int]  # of each wake-up
    answer_ns: list[int]
    rebased: int  # ticks that woke more than a period late
    counters: dict[str, int]  # of link and commands
    samples: list[Sample]
    events: list[EventRow]


class Line(NamedTuple):
    """A line that stays above the view."""

    text: str


class End(NamedTuple):
    """The run is over: draw once more and leave the terminal in order."""


Message = Plan | State | Line | End
KINDS: dict[str, Callable[..., Message]] = {kind.__name__: kind for kind in (Plan, State, Line, End)}


def pack(message: Message) -> bytes:
    """One datagram."""
    return json.dumps([type(message).__name__, *message]).encode()


def unpack(data: bytes) -> Message:
    """The inverse; tuples come back as lists. Raises ValueError for what pack() did not make."""
    fields: Any = json.loads(data)
    try:
        return KINDS[fields[0]](*fields[1:])
    except (KeyError, TypeError, IndexError):
        raise ValueError(f"message: expected one of {', '.join(KINDS)} with its fields, got {data[:80]!r}") from None


def error_deg(sample: Sample) -> Triple | None:
    """Attitude minus reference, modulo a turn; None where no reference is known."""
    _, attitude, reference = sample
    if reference is None:
        return None
    x, y, z = [_wrapped(angle - wanted) for angle, wanted in zip(attitude, reference, strict=True)]
    return x, y, z


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0 if math.isfinite(angle_deg) else angle_deg
