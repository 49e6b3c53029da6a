"""A channel with faults: loss, bursts, bit errors, lost bytes, duplicates, reordering, delay, jitter, unplugged cables.

Every decision is a pure function of (seed, direction, tick, frame type, number of the frame, copy): counter-based
numbers, so neither the order of calls nor other frames matter, and two laws see the same losses. Probabilities are
compared as integers, p 2^64 against 64 bits drawn; only jitter is drawn in floating point. SPEC.md, section 7.1.

The numbers are the eight little-endian 64-bit words of blake2b(key = seed u64 and "sil.link", 64 bytes) over
direction u8, tick u32, type u8, number u8, copy u8, block u16. Block 0 is the frame's own, the others give more where
more bits or bytes are hit. The burst chain has type 0: its block is always 0, and it draws one word per tick, the eight
ticks from 8 i on from "tick" i.
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from hashlib import blake2b
from statistics import NormalDist
from typing import NamedTuple

from protocol.channel import TO_BOARD, Damage, Fate, wire_time_ns

ONE = 1 << 64
DISTRIBUTIONS = ("uniform", "normal", "exponential")
DROP, BURST, DUPLICATE, REORDER, BIT, BYTE, JITTER = range(7)  # words of block 0
_COUNTER = struct.Struct("<BIBBBH")
_WORDS = struct.Struct("<8Q")
_BYTES_FROM = 1 << 15  # blocks of further byte losses; those of further bit errors begin at 1
_CHAIN = 0  # no frame has this type


class Burst(NamedTuple):
    """Gilbert-Elliott: a chain of two states that moves once per tick, and a probability of loss in each."""

    p_bad: float  # from good to bad
    p_good: float  # and back; 1 / p_good is the mean length of a bad stretch, in ticks
    loss_bad: float = 1.0
    loss_good: float = 0.0


class Jitter(NamedTuple):
    """Delay on top, always from 0 to max_ns: the named distribution cut off there (its tails are not moved)."""

    distribution: str  # of DISTRIBUTIONS; uniform over the whole span
    max_ns: int
    mean_ns: int = 0  # normal, exponential: before it is cut off
    sigma_ns: int = 0  # normal


class Faults(NamedTuple):
    """What is wrong in one direction; the default is a clear wire. Probabilities are per frame, bit or byte."""

    drop: float = 0.0
    burst: Burst | None = None
    bit_error_rate: float = 0.0
    byte_loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_ns: int = 0
    jitter: Jitter | None = None
    disconnect_ns: tuple[tuple[int, int], ...] = ()  # [from, to) each: takes what is on the wire at any time of it
    baud: int | None = None


class Faulty:
    """A `Channel` with faults up (to the board) and down; `period_ns` is T_s, the time a reordered frame is behind."""

    def __init__(self, seed: int, period_ns: int, up: Faults, down: Faults) -> None:
        self._up, self._down = _Way(seed, 0, period_ns, up), _Way(seed, 1, period_ns, down)

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        """One fate for each copy, the frame's own first."""
        way = self._up if direction == TO_BOARD else self._down
        return way.fates(tick, frame_type, number, encoded_len, t_ns)

    def is_bad(self, direction: str, tick: int) -> bool:
        """The state of the burst chain; False without one."""
        way = self._up if direction == TO_BOARD else self._down
        return way.chain is not None and bool(way.chain.is_bad(tick))


class _Way:
    """One direction."""

    def __init__(self, seed: int, direction: int, period_ns: int, faults: Faults) -> None:
        self._faults, self._direction, self._behind_ns = faults, direction, period_ns + 1
        self._draws = _Draws(seed, direction)
        self._drop, self._duplicate, self._reorder = map(_whole, (faults.drop, faults.duplicate, faults.reorder))
        self._bits, self._bytes = _Gaps(faults.bit_error_rate), _Gaps(faults.byte_loss)
        burst = faults.burst
        self.chain = None if burst is None else _Chain(self._draws, burst)
        self._burst_loss = (0, 0) if burst is None else (_whole(burst.loss_good), _whole(burst.loss_bad))
        self._jitter = None if faults.jitter is None or not faults.jitter.max_ns else _Quantile(faults.jitter)
        self._slow = "jitter" if self._jitter else "delay" if faults.delay_ns else "wire" if faults.baud else ""

    def fates(self, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int) -> tuple[Fate, ...]:
        words = self._draws.words(tick, frame_type, number, 0)
        own = self._fate(words, tick, frame_type, number, 0, encoded_len, t_ns)
        if words[DUPLICATE] >= self._duplicate:
            return (own,)
        words = self._draws.words(tick, frame_type, number, 1)
        return own, self._fate(words, tick, frame_type, number, 1, encoded_len, t_ns)

    def _fate(
        self, words: tuple[int, ...], tick: int, frame_type: int, number: int, copy: int, encoded_len: int, t_ns: int
    ) -> Fate:
        faults = self._faults
        arrival_ns, slow = t_ns + wire_time_ns(encoded_len, faults.baud) + faults.delay_ns, self._slow
        if self._jitter is not None:
            arrival_ns += self._jitter(words[JITTER])
        if words[REORDER] < self._reorder:
            arrival_ns, slow = arrival_ns + self._behind_ns, "reorder"
        cause = self._loss(words, tick, t_ns, arrival_ns)
        if cause:
            return Fate(False, arrival_ns, cause)
        key = (tick, frame_type, number, copy)
        flips = self._hits(self._bits, words[BIT], encoded_len * 8, key, 1)
        lost = self._hits(self._bytes, words[BYTE], encoded_len, key, _BYTES_FROM)
        if not flips and not lost:
            return Fate(True, arrival_ns, "", None, slow)
        cause = "bit errors" if not lost else "byte loss" if not flips else "bit errors and byte loss"
        return Fate(True, arrival_ns, cause, Damage(flips, lost), slow)

    def _loss(self, words: tuple[int, ...], tick: int, t_ns: int, arrival_ns: int) -> str:
        if any(t_ns < end and arrival_ns >= start for start, end in self._faults.disconnect_ns):
            return "disconnect"
        if self.chain is not None and words[BURST] < self._burst_loss[self.chain.is_bad(tick)]:
            return "burst"
        return "drop" if words[DROP] < self._drop else ""

    def _hits(self, gaps: _Gaps, word: int, count: int, key: tuple[int, int, int, int], block: int) -> tuple[int, ...]:
        """Which of `count` bits or bytes are hit: first by `word`, then by words of the blocks from `block` on."""
        place = gaps.next(word, count)
        if place >= count:
            return ()
        hits = [place]
        while True:
            for word in self._draws.words(*key, block):
                place += 1 + gaps.next(word, count - place - 1)
                if place >= count:
                    return tuple(hits)
                hits.append(place)
            block += 1


class _Draws:
    """Eight 64-bit words for every counter."""

    def __init__(self, seed: int, direction: int) -> None:
        self._keyed = blake2b(key=seed.to_bytes(8, "little") + b"sil.link", digest_size=64)
        self._direction = direction

    def words(self, tick: int, frame_type: int, number: int, copy: int, block: int = 0) -> tuple[int, ...]:
        keyed = self._keyed.copy()
        keyed.update(_COUNTER.pack(self._direction, tick, frame_type, number, copy, block))
        return _WORDS.unpack(keyed.digest())


class _Chain:
    """The states of a burst chain, tick by tick from 0 on, in balance at the start; a byte is kept for each."""

    def __init__(self, draws: _Draws, burst: Burst) -> None:
        self._draws = draws
        self._moves = (_whole(burst.p_bad), _whole(burst.p_good))
        both = burst.p_bad + burst.p_good
        self._bad_at_start = _whole(burst.p_bad / both) if both else 0
        self._states = bytearray()

    def is_bad(self, tick: int) -> int:
        states = self._states
        while tick >= len(states):
            self._grow()
        return states[tick]

    def _grow(self) -> None:
        """Eight ticks more."""
        states, moves = self._states, self._moves
        for word in self._draws.words(len(states) // 8, _CHAIN, 0, 0):
            if states:
                bad = states[-1]
                states.append(bad ^ (word < moves[bad]))
            else:
                states.append(word < self._bad_at_start)


class _Gaps:
    """How many bits (or bytes) pass unharmed before one is hit, each with probability p: a table of (1 - p)^i 2^64."""

    def __init__(self, p: float) -> None:
        self._p = _whole(p)
        self._not_yet = [-ONE]  # rising: minus the probability that none of the first i is hit

    def next(self, word: int, count: int) -> int:
        """The first of `count` that is hit, or `count` or more: none is."""
        if not self._p:
            return count
        while len(self._not_yet) <= count:
            self._not_yet.append(-(-self._not_yet[-1] * (ONE - self._p) >> 64))
        # place i is the first one hit when (1-p)^(i+1) <= word / 2^64 < (1-p)^i
        if word < -self._not_yet[count]:
            return count
        return bisect_left(self._not_yet, -word, 0, count + 1) - 1


class _Quantile:
    """The inverse of a jitter's distribution: 64 random bits to ns from 0 to max_ns."""

    def __init__(self, jitter: Jitter) -> None:
        if jitter.distribution not in DISTRIBUTIONS:
            raise ValueError(f"jitter: expected one of {', '.join(DISTRIBUTIONS)}, got {jitter.distribution!r}")
        self._jitter = jitter
        self._normal = NormalDist(jitter.mean_ns, jitter.sigma_ns) if jitter.distribution == "normal" else None
        if self._normal is not None:
            self._low, self._high = self._normal.cdf(0.0), self._normal.cdf(jitter.max_ns)
        elif jitter.distribution == "exponential":
            self._low, self._high = 0.0, -math.expm1(-jitter.max_ns / jitter.mean_ns)

    def __call__(self, word: int) -> int:
        jitter = self._jitter
        if jitter.distribution == "uniform":
            return (jitter.max_ns + 1) * word >> 64
        share = self._low + (self._high - self._low) * ((word >> 11) + 0.5) * 2.0**-53
        if self._normal is not None:
            drawn = self._normal.inv_cdf(share) if 0.0 < share < 1.0 else 0.0
        else:
            drawn = -jitter.mean_ns * math.log1p(-share)
        return min(max(round(drawn), 0), jitter.max_ns)


def _whole(probability: float) -> int:
    """p 2^64, exact. Raises ValueError outside [0, 1]."""
    if not 0.0 <= probability <= 1.0:
        raise ValueError(f"probability: expected 0 to 1, got {probability}")
    return int(probability * ONE)
