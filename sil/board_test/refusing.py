"""SPEC 2 and 4: what a receiver has to refuse has no effect, and what stands between frames costs itself only."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from protocol import frames
from protocol.codec import MAX_ENCODED, encode
from protocol.frames import MAX_PACKET, Packet, Stop, Type, pack
from protocol.law_tables import LawTable
from sil.board_test.bench import fresh_nonce
from sil.board_test.examinee import Examinee
from sil.board_test.made import not_for_a_board, refused, sample
from sil.board_test.outcome import Failed, Skipped, called, listed, passed
from sil.board_test.twin import Twin, difference
from sil.doctor.findings import Finding

LONG, VERY_LONG = 300, 5000  # bytes without a zero
SEED = 4
PAUSE_S = 0.0005


class Case(NamedTuple):
    """Bytes between which stand whole SAMPLEs: `ticks` of them, which have to be answered."""

    name: str
    pieces: tuple[bytes, ...]  # a write each
    ticks: int = 1


def packets(at: Examinee) -> Finding:
    """Refused packets and frames that no board receives: no answer, and the flight goes on as if they had not come."""
    twin = Twin(at, at.law)
    twin.send(sample(0))
    names = [name for name, _ in _bad_packets(1, at.law)]
    for tick, name in enumerate(names, start=1):
        at.tell(f"refused packets: {name}")
        _, bad = _bad_packets(tick, at.law)[tick - 1]
        answered = [called(packet) for packet in twin.only(bad)]
        if answered:
            raise Failed(f"{name}: expected no answer, got {listed(answered)}")
        if not twin.send(sample(tick)):
            raise Failed(f"SAMPLE({tick}) behind {name}: expected its COMMAND, got nothing")
        twin.agree()
    return passed(f"{len(names)} packets without an answer or an effect", packets=len(names))


def _bad_packets(tick: int, table: LawTable) -> list[tuple[str, Any]]:
    unasked = ((f"{type(frame).__name__.upper()} to a board", frame) for frame in not_for_a_board(tick))
    return [*refused(tick, fresh_nonce(), table), *unasked]


def garbage(at: Examinee) -> Finding:
    """Bytes that are no frame, between frames that are."""
    twin = Twin(at, at.law)
    made = _datagrams if twin.board.port.link.datagram else _streams
    count, tick = len(list(made(0))), 0
    for number in range(count):
        case = list(made(tick))[number]
        at.tell(f"garbage: {case.name}")
        samples = [sample(tick + i) for i in range(case.ticks)]
        expected = twin.reference.answers(*samples)
        for piece in case.pieces:
            twin.board.raw(piece)
        got = twin.board.answers()
        _held(case.name, expected, got)
        tick += case.ticks
    return passed(f"{count} kinds of garbage cost themselves only", kinds=count)


def cuts(at: Examinee) -> Finding:
    """However the bytes are cut into writes, the frames are the same."""
    twin = Twin(at, at.law)
    if twin.board.port.link.datagram:
        raise Skipped("a datagram is never cut")
    rng = random.Random(SEED)
    tick = 0
    for size in (1, 2, 3, 7, 0):
        samples = [sample(tick + i) for i in range(3)]
        expected = twin.reference.answers(*samples)
        data = b"".join(encode(pack(each, 0)) for each in samples)
        while data:
            length = size or rng.randrange(1, 40)
            twin.board.raw(data[:length])
            data = data[length:]
            time.sleep(PAUSE_S)  # a pty would put them together again
        _held(f"bytes in writes of {size or 'any number'}", expected, twin.board.answers())
        tick += 3
    return passed("writes of 1, 2, 3, 7 and any number of bytes")


def _held(name: str, expected: Sequence[Packet], got: Sequence[Packet]) -> None:
    """Every SAMPLE was answered as by the reference, and there was no other answer."""
    count, wanted = (sum(packet.type == Type.COMMAND for packet in packets) for packets in (got, expected))
    if count != wanted:
        raise Failed(f"{name}: expected {wanted} of {wanted} SAMPLEs answered, got {count}")
    if other := [called(packet) for packet in got if packet.type in (Type.HELLO, Type.READY)]:
        raise Failed(f"{name}: expected answers to SAMPLEs only, got {listed(other)}")
    if said := difference(list(expected), list(got)):
        raise Failed(f"{name}: {said}")


def _streams(tick: int) -> Iterator[Case]:
    rng = random.Random(SEED)
    good, other = encode(pack(sample(tick), 0)), encode(pack(sample(tick + 1), 0))
    stop = encode(pack(Stop(frames.STOP_DONE), 0))  # were one taken, the SAMPLE behind it would not be answered
    damaged = stop[:-3] + bytes([stop[-3] ^ 0x40]) + stop[-2:]
    yield Case("three bytes", (b"\x01\x02\x03" + good,))
    yield Case("one byte that is no zero", (b"\xff" + good,))
    yield Case("twenty zeros", (bytes(20) + good + bytes(20),))
    yield Case("noise without zeros", (bytes(rng.randrange(1, 256) for _ in range(100)) + good,))
    yield Case("noise with zeros", (rng.randbytes(200) + good,))
    yield Case("a candidate a byte too long", (b"\0" + bytes([7]) * (MAX_ENCODED + 1) + good,))
    yield Case(f"a candidate of {LONG} bytes", (bytes([1]) * LONG + good,))
    yield Case(f"a candidate of {VERY_LONG} bytes", (bytes([2]) * VERY_LONG + good,))
    for count in (1, 100, *range(MAX_ENCODED, MAX_ENCODED + 3), 256, *range(2 * MAX_ENCODED, 2 * MAX_ENCODED + 3), 512):
        yield Case(f"STOP behind {count} bytes of the same candidate", (b"\0" + bytes([3]) * count + stop[1:] + good,))
    yield Case("a damaged STOP", (damaged + good,))
    yield Case("STOP without its first zero and byte", (b"\1" + stop[2:] + good,))
    yield Case("a COBS chain that ends too late", (b"\0\xff" + bytes([9]) * 20 + good,))
    yield Case("a frame cut off in the middle", (good[: len(good) // 2] + good,))
    yield Case("a frame without its first bytes", (good[5:] + good,))
    yield Case("text", (b"\r\nboot: ok\r\n" + good + b"\r\n",))
    yield Case("two frames that share a zero", (good + other[1:],), 2)
    yield Case("two frames, the first without its last zero", (good[:-1] + other,), 2)


def _datagrams(tick: int) -> Iterator[Case]:
    rng = random.Random(SEED)
    good = pack(sample(tick), 0)
    yield Case("one byte", (b"\x01", good))
    yield Case("no byte at all", (b"", good))
    yield Case("eleven bytes", (good[:11], good))
    yield Case("noise", (rng.randbytes(100), good))
    yield Case("a byte too many", (rng.randbytes(MAX_PACKET + 1), good))
    yield Case("1400 bytes", (rng.randbytes(1400), good))
    yield Case("two packets in one datagram", (good + good, good))
    yield Case("a packet in COBS", (encode(good), good))
    yield Case("a packet cut off", (good[:-1], good))
