"""The faulty channel: its decisions depend on their keys alone, and come as often as the scenario says."""

from __future__ import annotations

import math
import random
from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.channel import TO_BOARD, TO_LAB, Damage, wire_time_ns
from protocol.codec import StreamDecoder, encode
from protocol.faulty import ONE, Burst, Faults, Faulty, Jitter, _Draws, _Gaps
from protocol.frames import Tick, Type, pack

T_NS = 500_000_000
SIZE = 79  # bytes of a SAMPLE on the wire
EVERYTHING = Faults(
    drop=0.1,
    burst=Burst(0.05, 0.3, 0.9, 0.01),
    bit_error_rate=1e-3,
    byte_loss=1e-3,
    duplicate=0.2,
    reorder=0.1,
    delay_ns=1_000_000,
    jitter=Jitter("normal", 40_000_000, 10_000_000, 8_000_000),
    disconnect_ns=((30 * T_NS, 40 * T_NS),),
    baud=115200,
)


CLEAR = Faults()


def faulty(up: Faults = CLEAR, down: Faults = CLEAR, seed: int = 1) -> Faulty:
    return Faulty(seed, T_NS, up, down)


def fates(channel: Faulty, tick: int, kind: int = Type.SAMPLE, size: int = SIZE, way: str = TO_BOARD, number: int = 0):
    return channel.fates(way, tick, kind, number, size, tick * T_NS)


def within(count: int, trials: int, p: float, sigmas: float = 4.5) -> bool:
    """A binomial count is where it should be; by chance it is not once in 150,000."""
    return abs(count - trials * p) <= sigmas * math.sqrt(trials * p * (1 - p)) + 1e-9


# -- keys alone --------------------------------------------------------------------------------------------------------

KEYS = st.tuples(
    st.sampled_from([TO_BOARD, TO_LAB]), st.integers(0, 300), st.sampled_from([2, 3, 4, 5]), st.integers(0, 15),
    st.integers(15, 253),
)  # fmt: skip


@given(st.lists(KEYS, min_size=1, max_size=30), st.randoms(use_true_random=False), st.integers(0, 2**64 - 1))
@settings(max_examples=60, deadline=None)
def test_the_order_of_calls_does_not_matter(keys, shuffled, seed):
    def ask(channel, key):
        way, tick, kind, number, size = key
        return channel.fates(way, tick, kind, number, size, tick * T_NS)

    channel = Faulty(seed, T_NS, EVERYTHING, EVERYTHING)
    first = {key: ask(channel, key) for key in keys}
    other = Faulty(seed, T_NS, EVERYTHING, EVERYTHING)
    again = list(keys)
    shuffled.shuffle(again)
    assert {key: ask(other, key) for key in again} == first
    assert {key: ask(channel, key) for key in again} == first


def test_two_laws_see_the_same_losses():
    """Another law, other sizes and another number of frames: what is lost of the frames they share is the same."""
    one, other = faulty(EVERYTHING, EVERYTHING), faulty(EVERYTHING, EVERYTHING)
    for tick in range(500):
        for kind, way in ((Type.SAMPLE, TO_BOARD), (Type.COMMAND, TO_LAB), (Type.TELEMETRY, TO_LAB)):
            for number in range(tick % 3):
                other.fates(TO_LAB, tick, Type.EVENT, number, 27, tick * T_NS + 5)
            mine, theirs = fates(one, tick, kind, 79, way), fates(other, tick, kind, 171, way)
            assert [fate.delivered for fate in mine] == [fate.delivered for fate in theirs]
            assert [fate.cause for fate in mine if not fate.delivered] == [f.cause for f in theirs if not f.delivered]


@pytest.mark.parametrize("change", ["seed", "direction", "tick", "type", "number", "copy"])
def test_every_part_of_the_key_counts(change):
    def lost(seed=1, way=TO_BOARD, shift=0, kind=Type.SAMPLE, number=0, copy=0):
        half = Faults(drop=0.5, duplicate=1.0)
        channel = faulty(half, half, seed=seed)
        return [channel.fates(way, t + shift, kind, number, SIZE, 0)[copy].delivered for t in range(400)]

    other = {
        "seed": {"seed": 2}, "direction": {"way": TO_LAB}, "tick": {"shift": 1}, "type": {"kind": Type.COMMAND},
        "number": {"number": 1}, "copy": {"copy": 1},
    }[change]  # fmt: skip
    agree = sum(a == b for a, b in zip(lost(), lost(**other), strict=True))
    assert within(agree, 400, 0.5)


def test_the_words_drawn_are_uniform_and_independent():
    draws = _Draws(7, 0)
    words = [word for tick in range(4000) for word in draws.words(tick, 2, 0, 0)]
    for shift in (0, 30, 56):  # low, middle, high byte: chi-square with 255 degrees of freedom
        counts = Counter(word >> shift & 255 for word in words)
        chi2 = sum((counts[value] - len(words) / 256) ** 2 for value in range(256)) / (len(words) / 256)
        assert abs(chi2 - 255) < 5 * math.sqrt(2 * 255)
    ones = sum((a ^ b).bit_count() for a, b in pairwise(words))
    assert within(ones, 64 * (len(words) - 1), 0.5)


# -- as often as the scenario says -------------------------------------------------------------------------------------


@pytest.mark.parametrize("p", [0.0, 0.01, 0.2, 0.9, 1.0])
def test_drops_come_at_their_rate(p):
    channel = faulty(Faults(drop=p))
    lost = [fate for tick in range(20_000) for fate in fates(channel, tick) if not fate.delivered]
    assert within(len(lost), 20_000, p)
    assert {fate.cause for fate in lost} <= {"drop"}


def test_up_and_down_are_apart():
    channel = faulty(Faults(drop=0.5), Faults())
    assert all(fates(channel, tick, way=TO_LAB)[0].delivered for tick in range(200))


def test_bursts_have_their_share_and_their_length():
    burst = Burst(p_bad=0.02, p_good=0.25, loss_bad=0.8, loss_good=0.05)
    channel, ticks = faulty(Faults(burst=burst)), 60_000
    bad = [channel.is_bad(TO_BOARD, tick) for tick in range(ticks)]
    lost = [not fates(channel, tick)[0].delivered for tick in range(ticks)]
    stretches = "".join("B" if each else "." for each in bad).split(".")
    lengths = [len(each) for each in stretches if each]
    share = burst.p_bad / (burst.p_bad + burst.p_good)
    assert sum(bad) / ticks == pytest.approx(share, rel=0.1)
    assert sum(lengths) / len(lengths) == pytest.approx(1 / burst.p_good, rel=0.08)
    of_bad = sum(gone for gone, state in zip(lost, bad, strict=True) if state)
    assert within(of_bad, sum(bad), burst.loss_bad)
    assert within(sum(lost) - of_bad, ticks - sum(bad), burst.loss_good)


def test_the_burst_chain_is_in_balance_at_the_start():
    share = 0.3
    bad = sum(faulty(Faults(burst=Burst(0.03, 0.07)), seed=seed).is_bad(TO_BOARD, 0) for seed in range(3000))
    assert within(bad, 3000, share)


@given(st.integers(0, 400), st.integers(0, 2**64 - 1))
@settings(max_examples=40, deadline=None)
def test_the_state_of_a_tick_does_not_depend_on_which_was_asked_first(tick, seed):
    burst = Faults(burst=Burst(0.1, 0.2))
    fresh, stepped = faulty(burst, seed=seed), faulty(burst, seed=seed)
    states = [stepped.is_bad(TO_BOARD, each) for each in range(tick + 1)]
    assert fresh.is_bad(TO_BOARD, tick) == states[-1]


@pytest.mark.parametrize("rate", [1e-5, 1e-4, 3e-3])
def test_bit_errors_come_at_their_rate_and_anywhere(rate):
    channel, frames = faulty(Faults(bit_error_rate=rate)), 30_000
    hit = [each.damage.flips for tick in range(frames) for each in fates(channel, tick) if each.damage]
    flips = [bit for bits in hit for bit in bits]
    assert within(len(flips), frames * SIZE * 8, rate)
    assert within(len(hit), frames, 1 - (1 - rate) ** (SIZE * 8))
    assert all(bits == tuple(sorted(set(bits))) and bits[0] >= 0 and bits[-1] < SIZE * 8 for bits in hit)
    if len(flips) > 1000:
        thirds = Counter(3 * bit // (SIZE * 8) for bit in flips)
        assert all(within(thirds[third], len(flips), 1 / 3) for third in range(3))


def test_bytes_go_missing_at_their_rate():
    channel = faulty(Faults(byte_loss=1e-3))
    lost = [
        place for tick in range(20_000) for each in fates(channel, tick) if each.damage for place in each.damage.lost
    ]
    assert within(len(lost), 20_000 * SIZE, 1e-3)


@given(st.floats(0, 1), st.integers(0, 2**64 - 1), st.integers(0, 300))
@settings(max_examples=300)
def test_the_table_of_gaps_is_the_geometric_distribution_in_integers(p, word, count):
    left, passed = ONE, 0  # (1 - p)^i 2^64
    while passed < count and word < (left := left * (ONE - int(p * ONE)) >> 64):
        passed += 1
    assert _Gaps(p).next(word, count) == passed


def test_duplicates_have_a_fate_of_their_own():
    channel = faulty(Faults(duplicate=0.3, drop=0.5))
    both = [each for tick in range(10_000) if len(each := fates(channel, tick)) == 2]
    assert within(len(both), 10_000, 0.3)
    assert within(sum(a.delivered != b.delivered for a, b in both), len(both), 0.5)


def test_an_overtaken_frame_is_behind_that_of_the_next_tick():
    channel = faulty(Faults(reorder=0.2, baud=9600))
    arrivals = [fates(channel, tick)[0] for tick in range(5000)]
    overtaken = [tick for tick, fate in enumerate(arrivals) if fate.slow == "reorder"]
    assert within(len(overtaken), 5000, 0.2)
    wire_ns = wire_time_ns(SIZE, 9600)
    assert all(arrivals[tick].arrival_ns == (tick + 1) * T_NS + wire_ns + 1 for tick in overtaken)


@pytest.mark.parametrize(
    ("jitter", "mean", "sigma"),
    [
        (Jitter("uniform", 60_000), 30_000, 60_000 / math.sqrt(12)),
        (Jitter("normal", 100_000, 50_000, 5_000), 50_000, 5_000),
        (Jitter("exponential", 10_000_000, 10_000), 10_000, 10_000),
    ],
    ids=lambda value: value.distribution if isinstance(value, Jitter) else "",
)
def test_jitter_is_distributed_as_its_name_says(jitter, mean, sigma):
    channel, count = faulty(Faults(delay_ns=7, jitter=jitter)), 20_000
    late = [fates(channel, tick)[0].arrival_ns - tick * T_NS - 7 for tick in range(count)]
    assert min(late) >= 0 and max(late) <= jitter.max_ns
    found = sum(late) / count
    assert abs(found - mean) < 5 * sigma / math.sqrt(count)
    assert math.sqrt(sum((each - found) ** 2 for each in late) / count) == pytest.approx(sigma, rel=0.05)


@pytest.mark.parametrize("jitter", [Jitter("normal", 1000, 900, 500), Jitter("exponential", 1000, 5000)])
def test_jitter_is_cut_off_not_piled_up(jitter):
    """Of a cut distribution no more lie at its very end than anywhere near."""
    channel = faulty(Faults(jitter=jitter))
    late = [fates(channel, tick)[0].arrival_ns - tick * T_NS for tick in range(20_000)]
    assert max(late) <= 1000
    assert sum(each >= 990 for each in late) < 0.03 * len(late)


def test_a_disconnection_takes_what_is_on_the_wire_at_any_time_of_it():
    channel = faulty(Faults(disconnect_ns=((10, 20), (30, 31)), delay_ns=2))
    times = {7: True, 8: False, 10: False, 19: False, 20: True, 27: True, 28: False, 30: False, 31: True}
    found = {t_ns: channel.fates(TO_BOARD, 0, Type.SAMPLE, 0, SIZE, t_ns)[0] for t_ns in times}
    assert {t_ns: fate.delivered for t_ns, fate in found.items()} == times
    assert {fate.cause for fate in found.values() if not fate.delivered} == {"disconnect"}


def test_without_faults_it_is_a_clear_wire():
    (fate,) = fates(faulty(Faults(baud=115200)), 3)
    assert (fate.delivered, fate.arrival_ns, fate.cause, fate.damage) == (True, 3 * T_NS + 6_857_639, "", None)


@pytest.mark.parametrize("p", [-0.1, 1.1, math.nan])
def test_what_is_no_probability_is_refused(p):
    with pytest.raises(ValueError, match="expected 0 to 1"):
        faulty(Faults(drop=p))


# -- bytes -------------------------------------------------------------------------------------------------------------


@given(st.data())
@settings(max_examples=100)
def test_damage_is_what_it_says(data):
    encoded = encode(pack(Tick(data.draw(st.integers(0, 1000))), 3))
    places = st.sets(st.integers(0, len(encoded) - 1), max_size=4)
    bits = st.sets(st.integers(0, len(encoded) * 8 - 1), max_size=4)
    flips, lost = tuple(sorted(data.draw(bits))), tuple(sorted(data.draw(places)))
    altered = Damage(flips, lost).of(encoded)
    turned = int.from_bytes(encoded, "little") ^ sum(1 << bit for bit in flips)
    expected = turned.to_bytes(len(encoded), "little")
    assert altered == bytes(byte for place, byte in enumerate(expected) if place not in lost)
    if Damage(flips, lost).harmless(len(encoded)):
        assert StreamDecoder().feed(b"\0" + altered + b"\0") == StreamDecoder().feed(encoded)


def test_a_frame_with_one_altered_bit_is_never_taken():
    encoded = encode(pack(Tick(5), 3))
    for bit in range(len(encoded) * 8):
        assert StreamDecoder().feed(b"\0" + Damage((bit,), ()).of(encoded) + b"\0") == []


def test_decisions_cost_little():
    """Lockstep has some 150 us for a tick; a bound with room for a busy machine."""
    import time

    channel = faulty(EVERYTHING, EVERYTHING)
    order = random.Random(1).sample(range(2000), 2000)
    began = time.process_time()
    for tick in order:
        fates(channel, tick)
    assert (time.process_time() - began) / 2000 < 100e-6
