"""The frames as Python sees them: one NamedTuple per type, and the numbers that stand for something.

Layouts and units are in `layouts.py`, the meaning of every field in SPEC.md.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

from protocol.layouts import LAYOUT_BY_TYPE, LAYOUT_HASH, MAX_BODY, MAX_PACKET, MIN_PACKET, Type, size_of

PROTOCOL_VERSION = 1
NO_TICK = 0xFFFFFFFF
HOUSEKEEPING = 0x80

ZERO, FRESH, HELD = 0, 1, 2  # Sample.source
USED, PROPAGATED, REPEATED, RESTARTED, REUSED = 1, 2, 3, 4, 5  # Command.used
WITHOUT_SAMPLE = (PROPAGATED, REPEATED, REUSED)  # Command.used of a step without a usable SAMPLE
FLAG_SATURATED = 1 << 0  # torque at its limit
FLAG_WATCHDOG = 1 << 1  # link watchdog: torque is zero
FLAG_IDENTIFICATION_PAUSED = 1 << 2
FLAG_ARITHMETIC = 1 << 3  # arithmetic saturation in the law
FLAG_OVERRUN = 1 << 4  # this tick's SAMPLE found the board busy
FLAG_STARTING = 1 << 5  # law not yet in control
EULER, QUATERNION, RATE = 1 << 0, 1 << 1, 1 << 2  # Sample present and valid masks, readings_mask
ROLE_LAB, ROLE_BOARD = 0, 1
HELLO_OWN_TIMER, HELLO_CONFIGURED, HELLO_ECHO = 1 << 0, 1 << 1, 1 << 2
READY_OK, READY_BAD_WORD, READY_UNKNOWN_LAW, READY_LAW_REFUSES, READY_MISSING_PARTS = 0, 1, 2, 3, 4
NO_INDEX = 0xFFFF
AHEAD_LIMIT = 4  # a SAMPLE this many ticks ahead is propagated up to; farther ahead is a bumpless re-start
STOP_DONE, STOP_INTERRUPTED, STOP_FAILED = 0, 1, 2
MAX_CONFIG_WORDS = (MAX_BODY - size_of(LAYOUT_BY_TYPE[Type.CONFIG].fields)) // 4
MAX_TELEMETRY_WORDS = (MAX_BODY - size_of(LAYOUT_BY_TYPE[Type.TELEMETRY].fields)) // 4

Triple: TypeAlias = tuple[int, int, int]


class Config(NamedTuple):
    """One part of the CONFIG words: words[offset], words[offset + 1], ... of `parts` parts."""

    part: int
    parts: int
    offset: int
    words: tuple[int, ...]


class Reading(NamedTuple):
    """One sensor's reading in wire units, `age_us` old at t_k."""

    age_us: int
    values: tuple[int, ...]


class Sample(NamedTuple):
    """SAMPLE(k). setpoint in 2^-32 turn; applied, momentum in LSBs of CONFIG; readings: euler, quaternion, rate."""

    tick: int
    setpoint: Triple
    applied: Triple
    momentum: Triple
    ack: int
    transit_us: int
    source: int
    valid: int
    readings: tuple[Reading | None, Reading | None, Reading | None]


class Command(NamedTuple):
    """COMMAND(k). torque on the body in LSBs of CONFIG; `follows` counts the TELEMETRY and EVENT frames after it."""

    tick: int
    torque: Triple
    flags: int
    follows: int
    used: int


class Telemetry(NamedTuple):
    """TELEMETRY(k): words of the table that (law_id, law_version) selects."""

    tick: int
    law_id: int
    law_version: int
    words: tuple[int, ...]


class Event(NamedTuple):
    """EVENT(k): a code of `protocol.events` and two integers."""

    tick: int
    code: int
    a: int
    b: int


class Hello(NamedTuple):
    """HELLO: opens a session. Frozen for ever; its CRC starts from 0, so that any build can read any other's."""

    protocol_version: int
    role: int
    flags: int
    layout_hash: int
    nonce: int
    clock_rate_q16: int
    build: str


class Ready(NamedTuple):
    """READY: the answer to a complete CONFIG."""

    status: int
    index: int  # type: ignore[assignment]
    table_hash: int


class Tick(NamedTuple):
    """TICK(k): step tick k without a SAMPLE; in lockstep, and on a clock before the first SAMPLE of a session."""

    tick: int


class Timing(NamedTuple):
    """TIMING(k): host times and error counters of the board, never compared."""

    tick: int
    busy_ns: int
    stack_bytes: int
    rx_errors: int
    discarded_bytes: int


class Stop(NamedTuple):
    """STOP: the session ends."""

    reason: int


Frame: TypeAlias = Config | Sample | Command | Telemetry | Event | Hello | Ready | Tick | Timing | Stop


class Packet(NamedTuple):
    """A packet taken apart. `raw` is the packet itself, header to CRC."""

    version: int
    type: int
    sequence: int
    tick: int
    frame: Any  # one of Frame; Any, because the reader knows which from `type`
    raw: bytes


def is_housekeeping(type_: int) -> bool:
    """Whether frames of this type are outside every comparison and have a sequence of their own."""
    return bool(type_ & HOUSEKEEPING)


__all__ = [
    "AHEAD_LIMIT",
    "EULER",
    "FLAG_ARITHMETIC",
    "FLAG_IDENTIFICATION_PAUSED",
    "FLAG_OVERRUN",
    "FLAG_SATURATED",
    "FLAG_STARTING",
    "FLAG_WATCHDOG",
    "FRESH",
    "HELD",
    "HELLO_CONFIGURED",
    "HELLO_ECHO",
    "HELLO_OWN_TIMER",
    "HOUSEKEEPING",
    "LAYOUT_HASH",
    "MAX_CONFIG_WORDS",
    "MAX_PACKET",
    "MAX_TELEMETRY_WORDS",
    "MIN_PACKET",
    "NO_INDEX",
    "NO_TICK",
    "PROPAGATED",
    "PROTOCOL_VERSION",
    "QUATERNION",
    "RATE",
    "READY_BAD_WORD",
    "READY_LAW_REFUSES",
    "READY_MISSING_PARTS",
    "READY_OK",
    "READY_UNKNOWN_LAW",
    "REPEATED",
    "RESTARTED",
    "REUSED",
    "ROLE_BOARD",
    "ROLE_LAB",
    "STOP_DONE",
    "STOP_FAILED",
    "STOP_INTERRUPTED",
    "USED",
    "WITHOUT_SAMPLE",
    "ZERO",
    "Command",
    "Config",
    "Event",
    "Frame",
    "Hello",
    "Packet",
    "Reading",
    "Ready",
    "Sample",
    "Stop",
    "Telemetry",
    "Tick",
    "Timing",
    "Triple",
    "Type",
    "is_housekeeping",
]
