"""Frame layouts as tables of fields: struct formats, the tables of SPEC.md and the layout hash L all come from here.

Everything is little endian. A packet is header, body, CRC-32; see SPEC.md, sections 2 and 3.
"""

from __future__ import annotations

import zlib
from enum import IntEnum
from typing import NamedTuple

MAX_PACKET = 250  # bytes, header to CRC
HEADER_SIZE = 8
CRC_SIZE = 4
MIN_PACKET = HEADER_SIZE + CRC_SIZE
MAX_BODY = MAX_PACKET - MIN_PACKET


class Type(IntEnum):
    """Frame types. Bit 7 says housekeeping: own sequence, never compared between runs."""

    CONFIG = 0x01
    SAMPLE = 0x02
    COMMAND = 0x03
    TELEMETRY = 0x04
    EVENT = 0x05
    HELLO = 0x81
    READY = 0x82
    TICK = 0x83
    TIMING = 0x84
    STOP = 0x85


class Field(NamedTuple):
    """One field of a body: `length` numbers of `ctype`, one of u8 u16 u32 u64 i32 char."""

    name: str
    ctype: str
    length: int
    unit: str
    about: str


class Layout(NamedTuple):
    """One frame type. `ticked`: the header says the tick, else NO_TICK. `tail`: what repeats at the end."""

    type: Type
    ticked: bool
    sender: str
    fields: tuple[Field, ...]
    tail: str
    about: str


class ReadingLayout(NamedTuple):
    """One optional reading at the end of SAMPLE: age, then values. `bit` is its bit in `present` and `valid`."""

    bit: int
    name: str
    fields: tuple[Field, ...]


CTYPES = {"u8": ("B", 1), "u16": ("H", 2), "u32": ("I", 4), "u64": ("Q", 8), "i32": ("i", 4), "char": ("s", 1)}

HEADER = (
    Field("version", "u8", 1, "", "layout generation of the header, 1"),
    Field("type", "u8", 1, "", "frame type"),
    Field("sequence", "u16", 1, "", "counts per direction and class, modulo 2^16"),
    Field("tick", "u32", 1, "tick", "the tick k the frame belongs to, or NO_TICK"),
)

_AGE = Field("age", "u32", 1, "us", "age of the reading at t_k")

READINGS = (
    ReadingLayout(0, "euler", (_AGE, Field("euler", "i32", 3, "2^-32 turn", "attitude angles about x, y, z"))),
    ReadingLayout(1, "quaternion", (_AGE, Field("quaternion", "i32", 4, "2^-30", "attitude, scalar first"))),
    ReadingLayout(2, "rate", (_AGE, Field("rate", "i32", 3, "2^-rate_bits rad/s", "body rate, body axes"))),
)

LAYOUTS = (
    Layout(
        Type.CONFIG,
        False,
        "lab",
        (
            Field("part", "u16", 1, "", "number of this part, 0 .. parts-1"),
            Field("parts", "u16", 1, "", "how many parts there are"),
            Field("offset", "u16", 1, "word", "index of this part's first word"),
            Field("reserved", "u16", 1, "", "0"),
        ),
        "words i32",
        "one part of the configuration words; idempotent, any order, any number of times",
    ),
    Layout(
        Type.SAMPLE,
        True,
        "lab",
        (
            Field("setpoint", "i32", 3, "2^-32 turn", "commanded attitude about x, y, z"),
            Field("applied", "i32", 3, "2^-torque_bits N m", "torque on the body that acts from t_k on, body axes"),
            Field("momentum", "i32", 3, "2^-momentum_bits N m s", "absolute wheel momentum at t_k, body axes"),
            Field("ack", "u32", 1, "tick", "source tick of the command that acts now; NO_TICK before the first"),
            Field("transit", "u32", 1, "us", "modelled time of this frame on the wire"),
            Field("source", "u8", 1, "", "of what acts: 0 zero, 1 fresh, 2 held"),
            Field("present", "u8", 1, "mask", "which readings follow"),
            Field("valid", "u8", 1, "mask", "which of them are valid"),
            Field("reserved", "u8", 1, "", "0"),
        ),
        "readings",
        "what the board may know at t_k",
    ),
    Layout(
        Type.COMMAND,
        True,
        "board",
        (
            Field("torque", "i32", 3, "2^-torque_bits N m", "torque on the body, body axes"),
            Field("flags", "u16", 1, "mask", "see the table of flags"),
            Field("follows", "u8", 1, "", "how many TELEMETRY and EVENT frames of this tick follow"),
            Field("used", "u8", 1, "", "1 used, 2 propagated, 3 repeated, 4 restarted, 5 reused"),
        ),
        "",
        "the answer to tick k",
    ),
    Layout(
        Type.TELEMETRY,
        True,
        "board",
        (
            Field("law_id", "u16", 1, "", "which law"),
            Field("law_version", "u16", 1, "", "and which version: together they select the table of words"),
        ),
        "words i32",
        "what the law shows of itself",
    ),
    Layout(
        Type.EVENT,
        True,
        "board",
        (
            Field("code", "u16", 1, "", "see the table of events"),
            Field("reserved", "u16", 1, "", "0"),
            Field("a", "i32", 1, "", "first number, meaning by code"),
            Field("b", "i32", 1, "", "second number, meaning by code"),
        ),
        "",
        "something happened; its text lives in the lab",
    ),
    Layout(
        Type.HELLO,
        False,
        "both",
        (
            Field("protocol_version", "u16", 1, "", "1"),
            Field("role", "u8", 1, "", "0 lab, 1 board"),
            Field("flags", "u8", 1, "mask", "bit 0 own timer, bit 1 configured, bit 2 echo"),
            Field("layout_hash", "u32", 1, "", "L"),
            Field("nonce", "u64", 1, "", "names the session; the lab draws it, the board echoes it"),
            Field("clock_rate_q16", "u32", 1, "2^-16", "lab: simulated seconds per wall second, 0 lockstep; board: 0"),
            Field("build", "char", 24, "", "printable ASCII, padded with NUL"),
        ),
        "",
        "opens a session, and says that the board has none; frozen for ever",
    ),
    Layout(
        Type.READY,
        False,
        "board",
        (
            Field("status", "u16", 1, "", "0 ok, 1 bad word, 2 unknown law, 3 law refuses, 4 missing words"),
            Field("index", "u16", 1, "word", "the bad CONFIG word, or 0xFFFF"),
            Field("table_hash", "u32", 1, "", "hash of tables and words; 0 unless status is 0"),
        ),
        "",
        "the next SAMPLE is answered in time, or why not",
    ),
    Layout(Type.TICK, True, "lab", (), "", "no SAMPLE of this tick survived the link in time (L11)"),
    Layout(
        Type.TIMING,
        True,
        "board",
        (
            Field("busy", "u32", 1, "ns", "host time the answer took"),
            Field("stack", "u32", 1, "byte", "stack high water, 0 unknown"),
            Field("rx_errors", "u32", 1, "", "receiver errors since boot (UART overrun, framing, parity)"),
            Field("discarded", "u32", 1, "byte", "bytes the decoder discarded since the session began"),
        ),
        "",
        "how the board's host fares; optional, never compared",
    ),
    Layout(
        Type.STOP,
        False,
        "lab",
        (
            Field("reason", "u16", 1, "", "0 done, 1 interrupted, 2 failed"),
            Field("reserved", "u16", 1, "", "0"),
        ),
        "",
        "ends the session; the board forgets nonce and configuration",
    ),
)

LAYOUT_BY_TYPE = {layout.type: layout for layout in LAYOUTS}


def struct_format(fields: tuple[Field, ...]) -> str:
    """The struct format of consecutive fields, without the byte-order mark; a lone number carries no count."""
    codes = []
    for field in fields:
        code = CTYPES[field.ctype][0]
        codes.append(code if field.length == 1 else f"{field.length}{code}")
    return "".join(codes)


def size_of(fields: tuple[Field, ...]) -> int:
    """Bytes of consecutive fields; there is no padding."""
    return sum(CTYPES[field.ctype][1] * field.length for field in fields)


def canonical_text() -> str:
    """The text whose CRC-32 is the layout hash: every layout but HELLO's, one line per frame, field and reading."""
    lines = [_line(field) for field in HEADER]
    for layout in LAYOUTS:
        if layout.type != Type.HELLO:
            tick = "tick" if layout.ticked else "no_tick"
            lines.append(f"{layout.type.name} 0x{layout.type:02X} {tick} {layout.tail or 'fixed'}")
            lines.extend(_line(field) for field in layout.fields)
    for reading in READINGS:
        lines.append(f"reading {reading.bit} {reading.name}")
        lines.extend(_line(field) for field in reading.fields)
    return "\n".join(lines) + "\n"


def _line(field: Field) -> str:
    return f"{field.name} {field.ctype} {field.length} {field.unit or '1'}"


LAYOUT_HASH = zlib.crc32(canonical_text().encode("ascii"))
