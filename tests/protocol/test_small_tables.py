"""Channel, events, CONFIG parts: the small modules that both ends lean on."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wire_examples import i32

from protocol import events
from protocol import frames as f
from protocol.channel import TO_BOARD, Clear, Fate, wire_time_ns
from protocol.config import MAX_WORDS, Assembly, TooManyWords, split


def test_a_clear_channel_takes_ten_bits_per_byte() -> None:
    channel = Clear(115200)
    assert channel.fates(TO_BOARD, 7, f.Type.SAMPLE, 0, 79, 500) == (Fate(True, 500 + 6_857_639, slow="wire"),)
    assert Clear(None).fates(TO_BOARD, 7, f.Type.SAMPLE, 0, 79, 500) == (Fate(True, 500),)
    assert wire_time_ns(1, 10_000_000_000) == 1
    assert wire_time_ns(1, 3) == 3_333_333_334


@pytest.mark.parametrize("baud", [0, -1])
def test_a_channel_has_a_positive_baud_rate(baud: int) -> None:
    with pytest.raises(ValueError, match="expected a positive number"):
        Clear(baud)


def test_event_codes_names_and_constants_agree() -> None:
    constants = {k: v for k, v in vars(events).items() if k.isupper() and isinstance(v, int) and k != "FIRST_LAB_CODE"}
    assert {kind.name: kind.code for kind in events.EVENTS.values()} == constants
    assert len(set(constants.values())) == len(constants)
    assert events.name_of(events.OVERRUN) == "OVERRUN"
    assert events.name_of(0x7777) == "0x7777"


@given(st.lists(i32, max_size=400), st.randoms(use_true_random=False))
def test_config_parts_in_any_order_any_number_of_times(words: list[int], rng: random.Random) -> None:
    parts = list(split(words))
    assert all(len(f.pack(part, 0)) <= f.MAX_PACKET for part in parts)
    sent = parts * 2
    rng.shuffle(sent)
    assembly = Assembly()
    complete = [assembly.add(part) for part in sent]
    assert complete[-1]
    assert assembly.words() == tuple(words)


def test_config_parts_that_do_not_join_are_no_words() -> None:
    assembly = Assembly()
    assert not assembly.add(f.Config(0, 2, 0, (1, 2)))
    assert assembly.words() == (1, 2)
    assert assembly.add(f.Config(1, 2, 3, (4,)))
    assert assembly.words() is None
    assert assembly.add(f.Config(0, 1, 0, (9,)))
    assert assembly.words() == (9,)


def test_config_is_bounded() -> None:
    with pytest.raises(TooManyWords, match="at most"):
        split([0] * (MAX_WORDS + 1))
    assembly = Assembly()
    for part in range(5000):
        assert not assembly.add(f.Config(part, 5001, 0, (1,)))
    assert assembly.words() == ()
