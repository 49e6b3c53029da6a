"""What a board hears, as bytes: the input of targets `board` (c/board.c reads the same) and `twins`.

Options (u8), then records. The first byte of a record, modulo 4, says what it is:

    0, 1   length (u8) and header and body of a packet, which gets its CRC and goes over the link as it should
    2      length (u8) and bytes that come as they are
    3      m (u8), e (u8): the clock goes on by m * 2^(e mod 56) ns
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from protocol.codec import StreamDecoder, encode
from protocol.frames import LAYOUT_HASH, MAX_PACKET, Type

PACKET, RAW, CLOCK = 0, 2, 3
LONGEST_BODY = MAX_PACKET - 4
DATAGRAM = 1
LAST_NS = 2**63 - 1


class Record(NamedTuple):
    """One record; `payload` is what follows its head."""

    kind: int
    payload: bytes


def records(data: bytes) -> Iterator[Record]:
    """The records behind the options."""
    at = 1
    while len(data) - at >= 2:
        kind = data[at] % 4
        if kind == CLOCK:
            yield Record(CLOCK, data[at + 1 : at + 3].ljust(2, b"\0"))
            at += 3
            continue
        length = data[at + 1]
        yield Record(RAW if kind == RAW else PACKET, data[at + 2 : at + 2 + length])
        at += 2 + length


def joined(options: int, made: Sequence[Record]) -> bytes:
    """The inverse of records()."""
    data = bytes([options])
    for kind, payload in made:
        data += bytes([kind]) + (b"" if kind == CLOCK else bytes([len(payload)])) + payload
    return data


def heard_steps(data: bytes, step: Any) -> tuple[int, list[Any]]:
    """(options, steps) as c_board.py has them; `step` is its Step."""
    options = data[0] & 15
    steps, now_ns = [], 0
    for kind, payload in records(data):
        if kind == CLOCK:
            now_ns = min(now_ns + (payload[0] << payload[1] % 56), LAST_NS)
            steps.append(step(time_ns=now_ns))
        elif kind == RAW:
            steps.append(step(payload))
        elif len(payload) >= 2:
            packet = with_crc(payload[:LONGEST_BODY])
            steps.append(step(packet if options & DATAGRAM else encode(packet)))
    return options, steps


def from_steps(steps: Sequence[Any], options: int = 0) -> bytes:
    """Steps of c_board.py as an input. The clock's time is rounded."""
    made: list[Record] = []
    now_ns = 0
    for step in steps:
        if step.time_ns is not None:
            exponent = max((step.time_ns - now_ns).bit_length() - 8, 0)
            mantissa = step.time_ns - now_ns >> exponent
            made.append(Record(CLOCK, bytes((mantissa, exponent))))
            now_ns += mantissa << exponent
            continue
        packets = StreamDecoder().feed(step.data)
        if len(packets) == 1 and encode(packets[0]) == step.data:
            made.append(Record(PACKET, packets[0][:-4]))
        else:
            made += [Record(RAW, step.data[at : at + 255]) for at in range(0, len(step.data), 255)]
    return joined(options, made)


def with_crc(body: bytes) -> bytes:
    """Header and body (two bytes at least) with the CRC that their type asks for."""
    return body + zlib.crc32(body, 0 if body[1] == Type.HELLO else LAYOUT_HASH).to_bytes(4, "little")
