"""Fractions in [0, 1) for the drawn axes: independent ones, or a Latin hypercube. They depend on the seed alone.

Each axis has its own generator, seeded by (seed, name of the axis): another axis more, or another number
of draws, leaves the fractions of an axis as they were (random sampling).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence

import numpy as np

Row = tuple[float, ...]  # a fraction for each axis


def rows(sample: str, seed: int, keys: Sequence[str], draws: int) -> Iterator[Row]:
    """Rows without end. `lhs`: the first `draws` are a Latin hypercube; what replaces one of them is independent."""
    if sample == "lhs":
        yield from latin_hypercube(seed, len(keys), draws)
    streams = [_generator(seed, key) for key in keys]
    while True:
        yield tuple(float(stream.random()) for stream in streams)


def latin_hypercube(seed: int, axes: int, draws: int) -> list[Row]:
    """`draws` rows such that each axis has one fraction in each of `draws` equal parts of [0, 1)."""
    from scipy.stats import qmc

    sampler = qmc.LatinHypercube(axes, rng=_generator(seed, "Latin hypercube"))
    return [tuple(map(float, row)) for row in sampler.random(draws)]


def _generator(seed: int, name: str) -> np.random.Generator:
    # Philox as for the noise of a run, but from a seed sequence: the sampler of scipy wants to spawn from it.
    return np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, zlib.crc32(name.encode())])))
