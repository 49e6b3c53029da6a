"""EVENT codes: number, name and the meaning of the two integers. Below 0x100 the board's, from there the laboratory's.

Board events are frames; laboratory events never cross the wire, but are recorded beside them and so share the numbers.
"""

from __future__ import annotations

from typing import NamedTuple

SAMPLE_LOST = 0x0001
OVERRUN = 0x0002
STALE_SAMPLE = 0x0003
RESTARTED = 0x0004
WATCHDOG_ON = 0x0005
WATCHDOG_OFF = 0x0006
REFERENCE_RESTART = 0x0007
ARITHMETIC_SATURATION = 0x0008
NAN = 0x0009
READING_INVALID = 0x000A

COMMAND_LATE = 0x0100
COMMAND_MISSED = 0x0101
HOLD_LIMIT = 0x0102
RECOVERED = 0x0103
REAL_MISS = 0x0104
PLANT_NAN = 0x0105
EPOCH_REBASED = 0x0108
BOARD_RESTARTED = 0x0109
DIVERGED = 0x010A
LINK_DOWN = 0x0110
LINK_UP = 0x0111
BOARD_OFF = 0x0112
BOARD_ON = 0x0113
SETPOINT = 0x0114
FAULT_BEGINS = 0x0115
FAULT_ENDS = 0x0116

FIRST_LAB_CODE = 0x0100


class EventKind(NamedTuple):
    """One code: its name and what the numbers a and b say ("" when they are 0)."""

    code: int
    name: str
    about: str
    a: str
    b: str


_INSTRUMENT = "of (0 attitude sensor, 1 star tracker, 2 gyros, 3 wheels, 4 thrusters)"
_AXES = "axes (1 x, 2 y, 3 x y, 4 z, 5 x z, 6 y z, 7 x y z)"
_BEGAN = "when (0 on the way, 1 at the start)"
_FAULT = "kind (0 off, 1 stuck, 2 garbage, 3 wrong, 4 slow, 5 delayed, 6 intermittent)"

_KINDS = (
    EventKind(SAMPLE_LOST, "SAMPLE_LOST", "tick stepped without a usable SAMPLE", "tick", "samples lost so far"),
    EventKind(OVERRUN, "OVERRUN", "the SAMPLE came while the board was busy", "tick", "overruns so far"),
    EventKind(STALE_SAMPLE, "STALE_SAMPLE", "SAMPLE of a tick already stepped, dropped", "its tick", "dropped so far"),
    EventKind(RESTARTED, "RESTARTED", "too far ahead: bumpless re-start", "tick expected", "tick that came"),
    EventKind(WATCHDOG_ON, "WATCHDOG_ON", "link watchdog: torque is zero from here", "tick", "ticks without a SAMPLE"),
    EventKind(WATCHDOG_OFF, "WATCHDOG_OFF", "a SAMPLE came: the law commands again", "tick", ""),
    EventKind(REFERENCE_RESTART, "REFERENCE_RESTART", "reference model began anew", _AXES, _BEGAN),
    EventKind(
        ARITHMETIC_SATURATION,
        "ARITHMETIC_SATURATION",
        "an operation of the law saturates from here (COMMAND's flag bit 3 rose)",
        "tick",
        "",
    ),
    EventKind(NAN, "NAN", "the law's torque was not a number; it is zero", "axis 0, 1, 2", ""),
    EventKind(READING_INVALID, "READING_INVALID", "a reading the law needs is invalid", "needed mask", "valid"),
    EventKind(COMMAND_LATE, "COMMAND_LATE", "a COMMAND came after its tick, dropped", "its tick", "us late"),
    EventKind(COMMAND_MISSED, "COMMAND_MISSED", "no command in time for this tick", "its tick", "misses in a row"),
    EventKind(HOLD_LIMIT, "HOLD_LIMIT", "held too long: zero torque", "tick of the missed command", "misses in a row"),
    EventKind(RECOVERED, "RECOVERED", "a good command after misses", "its tick", "misses before it"),
    EventKind(
        REAL_MISS,
        "REAL_MISS",
        "missed on the clock though in time by the model",
        "tick",
        "why (0 COMMAND late on the clock, 1 the board's timer was faster, 2 answer incomplete)",
    ),
    EventKind(PLANT_NAN, "PLANT_NAN", "the plant's state is not a number", "tick", ""),
    EventKind(EPOCH_REBASED, "EPOCH_REBASED", "woke more than a period late: the epoch moved", "tick", "us"),
    EventKind(BOARD_RESTARTED, "BOARD_RESTARTED", "the board said HELLO within a session", "tick", "restarts so far"),
    EventKind(DIVERGED, "DIVERGED", "attitude beyond the scenario's bound", "axis 0, 1, 2", "angle in 1e-3 deg"),
    EventKind(LINK_DOWN, "LINK_DOWN", "the scenario disconnects the link", "tick", "ticks it lasts"),
    EventKind(LINK_UP, "LINK_UP", "the link is connected again", "tick", "ticks it was down"),
    EventKind(BOARD_OFF, "BOARD_OFF", "the scenario switches the board off", "tick", "ticks it lasts"),
    EventKind(BOARD_ON, "BOARD_ON", "the board is on again, in a session of its own", "tick", "ticks it was off"),
    EventKind(SETPOINT, "SETPOINT", "the scenario commands another attitude", "tick", "number in events, from 0"),
    EventKind(FAULT_BEGINS, "FAULT_BEGINS", "a fault of an instrument, on purpose", _INSTRUMENT, _FAULT),
    EventKind(FAULT_ENDS, "FAULT_ENDS", "it works again", _INSTRUMENT, _FAULT),
)

EVENTS = {kind.code: kind for kind in _KINDS}


def name_of(code: int) -> str:
    """The name of a code, or its number when it is unknown."""
    kind = EVENTS.get(code)
    return kind.name if kind else f"0x{code:04X}"
