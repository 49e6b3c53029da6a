"""Blind mutation of bytes: flips, telling values, pieces taken away, doubled, or from another input."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from random import Random

TELLING = (0, 1, 2, 3, 4, 7, 8, 0x7F, 0x80, 0x81, 0x83, 0xFE, 0xFF)
WORDS = (0, 1, 2**15, 2**16 - 1, 2**24, 2**31 - 1, 2**31, 2**32 - 1)


def mutated(data: bytes, random: Random, others: Sequence[bytes] = (b"",), tokens: Sequence[bytes] = ()) -> bytes:
    """One to eight changes of `data`."""
    made = bytearray(data)
    for _ in range(1 + random.randrange(8) * random.randrange(2)):
        _once(made, random, others, tokens)
    return bytes(made)


def _once(made: bytearray, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> None:
    kind = random.randrange(9)
    at = random.randrange(len(made) + 1)
    size = 1 + int(random.random() ** 3 * 64)
    if kind == 0 and at < len(made):
        made[at] ^= 1 << random.randrange(8)
    elif kind == 1 and at < len(made):
        made[at] = random.choice(TELLING)
    elif kind == 2 and len(made) >= 4:
        at = random.randrange(len(made) - 3)
        struct.pack_into(random.choice("<>") + "I", made, at, random.choice(WORDS))
    elif kind == 3:
        del made[at : at + size]
    elif kind == 4:
        made[at:at] = made[at : at + size]
    elif kind == 5:
        made[at:at] = random.randbytes(size)
    elif kind == 6 and tokens:
        made[at:at] = random.choice(tokens)
    elif kind == 7 and tokens:
        made[at : at + size] = random.choice(tokens)
    else:
        other = random.choice(others)
        start = random.randrange(len(other) + 1)
        made[at : at + size] = other[start : start + int(random.random() ** 2 * 400)]
