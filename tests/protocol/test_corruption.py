"""A million damaged frames: no exception, no wrong frame, every intact neighbour delivered, bounded memory.

What CRC-32 promises: of packets up to 250 bytes it finds every burst of up to 32 bits and every pattern of up to 4
wrong bits (Hamming distance 5 up to 2974 bits). Damage to the COBS bytes shifts the rest of a packet, which is
outside that promise: there a wrong packet passes with probability 2^-32. Over this million that is an expectation of
2e-4 wrong frames, and with the fixed seed a fact: none. A zero in front of every frame is what brings the decoder back.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from wire_examples import ONE_OF_EACH

from protocol import frames as f
from protocol.codec import MAX_ENCODED, DatagramDecoder, StreamDecoder, encode

STREAM_CORRUPTIONS = 800_000
DATAGRAM_CORRUPTIONS = 200_000
BATCH = 1000
SEED = 20240207

Damage = Callable[[bytearray, random.Random], None]


def flip_bits(wire: bytearray, rng: random.Random) -> None:
    for _ in range(1 + int(rng.random() * 4)):
        wire[int(rng.random() * len(wire))] ^= 1 << int(rng.random() * 8)


def replace_byte(wire: bytearray, rng: random.Random) -> None:
    wire[int(rng.random() * len(wire))] = int(rng.random() * 256)


def insert_byte(wire: bytearray, rng: random.Random) -> None:
    wire.insert(int(rng.random() * (len(wire) + 1)), int(rng.random() * 256))


def lose_bytes(wire: bytearray, rng: random.Random) -> None:
    at = int(rng.random() * len(wire))
    del wire[at : at + 1 + int(rng.random() * 8)]


def break_in_two(wire: bytearray, rng: random.Random) -> None:
    wire.insert(int(rng.random() * len(wire)), 0)


def burst(wire: bytearray, rng: random.Random) -> None:
    at = int(rng.random() * len(wire))
    wire[at : at + 4] = rng.randbytes(4)


def scramble(wire: bytearray, rng: random.Random) -> None:
    wire[1:-1] = rng.randbytes(len(wire))


def join(wire: bytearray, rng: random.Random) -> None:
    """Both delimiters lost and the frame repeated: what a missed interrupt makes of two frames."""
    wire[:] = wire[1:-1] * (1 + int(rng.random() * 3))


DAMAGES: tuple[Damage, ...] = (
    flip_bits, flip_bits, flip_bits, replace_byte, insert_byte, lose_bytes, break_in_two, burst, scramble, join,
)  # fmt: skip


def cut(stream: bytes, rng: random.Random) -> list[bytes]:
    """Pieces of random size, as a driver would hand them over."""
    pieces, at = [], 0
    while at < len(stream):
        size = 1 + int(rng.random() ** 3 * 5000)
        pieces.append(stream[at : at + size])
        at += size
    return pieces


def test_damaged_stream_costs_the_damaged_frames_only() -> None:
    rng = random.Random(SEED)
    originals = [f.pack(frame, number) for number, frame in enumerate(ONE_OF_EACH)]
    victims = [encode(packet) for packet in originals]
    decoder = StreamDecoder()
    survivors = changed = 0
    for start in range(0, STREAM_CORRUPTIONS, BATCH):
        stream: list[bytes] = []
        intact: list[bytes] = []
        for number in range(start, start + BATCH):
            victim = victims[int(rng.random() * len(victims))]
            wire = bytearray(victim)
            DAMAGES[int(rng.random() * len(DAMAGES))](wire, rng)
            changed += wire != victim
            intact.append(f.pack(f.Tick(number), number & 0xFFFF))
            stream += (bytes(wire), encode(intact[-1]))
        got: list[bytes] = []
        for piece in cut(b"".join(stream), rng):
            got += decoder.feed(piece)
            assert decoder.buffered <= MAX_ENCODED
        assert [packet for packet in got if packet[1] == f.Type.TICK and packet not in originals] == intact
        others = set(got) - set(intact)
        assert others <= set(originals)
        survivors += len(got) - len(intact)
    seen = decoder.counters
    assert changed > 0.97 * STREAM_CORRUPTIONS
    assert seen.frames == STREAM_CORRUPTIONS + survivors
    assert survivors < 0.1 * STREAM_CORRUPTIONS  # damage to a delimiter alone leaves the frame whole
    assert min(seen.crc_errors, seen.cobs_errors, seen.too_short, seen.too_long) > 1000


def test_damaged_datagrams_are_dropped() -> None:
    rng = random.Random(SEED)
    originals = [f.pack(frame, number) for number, frame in enumerate(ONE_OF_EACH)]
    decoder = DatagramDecoder()
    for _ in range(DATAGRAM_CORRUPTIONS):
        packet = originals[int(rng.random() * len(originals))]
        wire = bytearray(packet)
        DAMAGES[int(rng.random() * len(DAMAGES))](wire, rng)
        got = decoder.feed(bytes(wire))
        assert not got or got == [bytes(wire)] == [packet]
    assert decoder.counters.crc_errors > 0.8 * DATAGRAM_CORRUPTIONS
