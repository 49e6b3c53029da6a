"""Random numbers that depend on seed, consumer and tick only: never on the order or the number of calls.

Philox is a counter-based generator: its key is (seed, consumer, block of 256 ticks), and a tick is a row of its block.
Making a generator costs about 20 us, so the block drawn last is kept.
"""

from __future__ import annotations

import zlib

import numpy as np

from sil.signals import Vector

BLOCK = 256  # ticks per key


class _Drawn:
    """`count` numbers per tick; what they are distributed like is the subclass's."""

    def __init__(self, seed: int, consumer: str, count: int) -> None:
        self._seed, self._consumer = seed, zlib.crc32(consumer.encode())
        self._count = count
        self._block, self._rows = -1, np.empty((0, count))

    def at(self, tick: int) -> Vector:
        """The numbers of this tick, whatever was asked before."""
        block, row = divmod(tick, BLOCK)
        if block != self._block:
            key = np.array([self._seed, self._consumer << 32 | block], dtype=np.uint64)
            draws = self._draw(np.random.Generator(np.random.Philox(key=key)))
            self._block, self._rows = block, draws
        numbers: Vector = self._rows[row]
        return numbers

    def _draw(self, generator: np.random.Generator) -> Vector:
        raise NotImplementedError


class Gaussian(_Drawn):
    """Independent normal numbers: `at(tick)` is an array (count,) with standard deviation `sigma` (any unit)."""

    def __init__(self, seed: int, consumer: str, sigma: float, count: int) -> None:
        super().__init__(seed, consumer, count)
        self._sigma = sigma

    def _draw(self, generator: np.random.Generator) -> Vector:
        return self._sigma * generator.standard_normal((BLOCK, self._count))


class Uniform(_Drawn):
    """Independent numbers in [0, 1): `at(tick)` is an array (count,)."""

    def _draw(self, generator: np.random.Generator) -> Vector:
        return generator.random((BLOCK, self._count))
