"""Frames and packets for the checks: CONFIG of a law, SAMPLEs, and packets that a receiver has to refuse."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import Any

from protocol import config, frames
from protocol.frames import NO_TICK, Config, Reading, Sample, Stop, Tick
from protocol.law_tables import LawTable, config_words

ROWS = ((0, 2**28, 0, 0),)  # set-point: a sixteenth of a turn about x, from tick 0
UNKNOWN_LAW = 0xFFF0
ALL_VALID = 7
HELLO_START = 0
DEGREE = 2**32 // 360
SOURCE_AT, PRESENT_AT, VALID_AT, RESERVED_AT = 52, 53, 54, 55  # of SAMPLE
ROLE_AT, BUILD_AT, STOP_RESERVED_AT, CONFIG_RESERVED_AT = 10, 28, 10, 14
VERSION_AT, TYPE_AT, TICK_AT = 0, 1, 4


def words_of(table: LawTable, rows: Sequence[Sequence[int]] = ROWS, **values: Any) -> tuple[int, ...]:
    """CONFIG words of a law, its defaults but for `values`."""
    return config_words(table, values, rows)


def unknown_law(table: LawTable) -> tuple[int, ...]:
    """A CONFIG that every board answers with READY, status 2."""
    return (UNKNOWN_LAW, *words_of(table)[1:])


def sample(tick: int, **changes: Any) -> Sample:
    """A plausible SAMPLE(tick): all readings there and valid, the attitude swinging by some degrees about each axis."""
    swing = (tick % 16) * DEGREE // 4
    euler = Reading(0, (3 * DEGREE + swing, -2 * DEGREE, DEGREE - swing))
    readings = (euler, Reading(0, (2**30, 0, 0, 0)), Reading(0, (0, 0, 0)))
    small = tick % 1000
    ack = tick - 1 if tick else NO_TICK
    source = frames.FRESH if tick else frames.ZERO
    applied, momentum = (small, -small, 2 * small), (1000 * small, -500 * small, 250 * small)
    made = Sample(tick, (0, 0, 0), applied, momentum, ack, 0, source, ALL_VALID, readings)
    return made._replace(**changes)


def cut(words: Sequence[int], size: int) -> list[Config]:
    """The words in parts of `size` words each."""
    starts = range(0, len(words), size)
    return [Config(part, len(starts), start, tuple(words[start : start + size])) for part, start in enumerate(starts)]


def part_of(table: LawTable) -> tuple[Config, Config]:
    """The words of a law in two parts."""
    words = words_of(table, telemetry_every=0)
    first, second = cut(words, -(-len(words) // 2))
    return first, second


def whole(table: LawTable, **values: Any) -> tuple[Config, ...]:
    """The words of a law in as few parts as it takes."""
    return config.split(words_of(table, **values))


# -- packets to be refused ---------------------------------------------------------------------------------------------


def sealed(packet: bytes, start: int = frames.LAYOUT_HASH) -> bytes:
    """Header and body with their CRC."""
    return packet + zlib.crc32(packet, start).to_bytes(4, "little")


def altered(packet: bytes, at: int, value: int, start: int = frames.LAYOUT_HASH) -> bytes:
    """The packet with another byte in it, its CRC right all the same."""
    body = bytearray(packet[:-4])
    body[at] = value
    return sealed(bytes(body), start)


def refused(tick: int, nonce: int, table: LawTable) -> Iterator[tuple[str, bytes]]:
    """(what is wrong, packet): each would have an effect on a running board if it were taken."""
    good = frames.pack(sample(tick), 0)
    step, stop = frames.pack(Tick(tick), 0), frames.pack(Stop(0), 0)
    hello = frames.pack(frames.Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, nonce, 0, "refuse me"), 0)
    part = frames.pack(part_of(table)[0], 0)
    no_tick = NO_TICK.to_bytes(4, "little")
    flipped = bytearray(good)
    flipped[20] ^= 0x10
    yield "SAMPLE with a wrong bit", bytes(flipped)
    yield "SAMPLE whose CRC starts from 0", sealed(good[:-4], HELLO_START)
    yield "HELLO whose CRC starts from L", sealed(hello[:-4])
    yield "HELLO with a wrong bit", bytes([*hello[:-1], hello[-1] ^ 1])
    yield "SAMPLE of header version 2", altered(good, VERSION_AT, 2)
    yield "TICK of header version 0", altered(step, VERSION_AT, 0)
    yield "type 0x06", altered(step, TYPE_AT, 0x06)
    yield "type 0x86", altered(stop, TYPE_AT, 0x86)
    yield "type 0x00", altered(step, TYPE_AT, 0x00)
    yield "TICK four bytes too long", sealed(step[:-4] + bytes(4))
    yield "STOP four bytes too short", sealed(stop[:-8])
    yield "SAMPLE one byte too long", sealed(good[:-4] + b"\0")
    yield "SAMPLE without its last reading", sealed(good[:-20])
    yield "CONFIG with half a word", sealed(part[:-6])
    yield "SAMPLE without a tick", sealed(good[:TICK_AT] + no_tick + good[TICK_AT + 4 : -4])
    yield "TICK without a tick", sealed(step[:TICK_AT] + no_tick)
    yield "STOP with a tick", sealed(stop[:TICK_AT] + bytes(4) + stop[TICK_AT + 4 : -4])
    yield "HELLO with a tick", sealed(hello[:TICK_AT] + bytes(4) + hello[TICK_AT + 4 : -4], HELLO_START)
    yield "SAMPLE of source 3", altered(good, SOURCE_AT, 3)
    yield "SAMPLE with present 15", altered(good, PRESENT_AT, 15)
    yield "SAMPLE with valid 15", altered(good, VALID_AT, 15)
    yield "SAMPLE with reserved 1", altered(good, RESERVED_AT, 1)
    yield "STOP with reserved 1", altered(stop, STOP_RESERVED_AT, 1)
    yield "CONFIG with reserved 1", altered(part, CONFIG_RESERVED_AT, 1)
    yield "CONFIG with part = parts", altered(part, 8, part[10])
    yield "HELLO of role 2", altered(hello, ROLE_AT, 2, HELLO_START)
    yield "HELLO with a control character in build", altered(hello, BUILD_AT, 0x07, HELLO_START)


def not_for_a_board(tick: int) -> list[Any]:
    """Valid frames of the kinds that a board sends, not receives."""
    return [
        frames.Command(tick, (1, 2, 3), 0, 0, frames.USED),
        frames.Telemetry(tick, 1, 1, (1, 2, 3)),
        frames.Event(tick, 1, 2, 3),
        frames.Ready(frames.READY_OK, frames.NO_INDEX, 1),
        frames.Timing(tick, 1, 2, 3, 4),
    ]
