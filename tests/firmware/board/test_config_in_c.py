"""CONFIG in C: every word, in range or not, gets the READY that the Python board gives; in whatever parts it comes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from c_board import CBoard, Heard, Step, assert_same, python_board
from hostile import FORM, any_parts, any_words
from hypothesis import given
from hypothesis import strategies as st

from protocol import config, frames
from protocol.codec import StreamDecoder, encode
from protocol.frames import LAYOUT_HASH, Hello, Ready
from protocol.law_tables import C_LAWS, COMMON, FORM_FLOAT, ROW_WORDS, LawTable, config_words
from protocol.words import INT32_MAX, Word

REFUSED = Ready(frames.READY_LAW_REFUSES, frames.NO_INDEX, 0)
HELLO = Hello(1, 0, 0, LAYOUT_HASH, 7, 0, "test")
TABLES = C_LAWS
by_law = pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)


def steps_of(parts: Sequence[frames.Config]) -> list[Step]:
    packets = [frames.pack(HELLO, 0), *(frames.pack(part, number) for number, part in enumerate(parts))]
    return [Step(encode(packet)) for packet in packets]


def same_answers(c_board: CBoard, parts: Sequence[frames.Config]) -> Ready | None:
    """The last READY of both boards; fails where the two differ by a byte. A C board refuses what only floats allow."""
    steps = steps_of(parts)
    heard, expected = c_board.serve(steps), python_board(steps)
    ready, other = last_ready(heard), last_ready(expected)
    if ready != other and FORM_FLOAT in forms(parts):
        assert other is not None and other.status in (frames.READY_OK, frames.READY_LAW_REFUSES)
        assert ready == REFUSED
    else:
        assert_same(heard, expected)
    return ready


def forms(parts: Sequence[frames.Config]) -> set[int]:
    """What the parts say of the form."""
    return {part.words[FORM - part.offset] for part in parts if part.offset <= FORM < part.offset + len(part.words)}


def last_ready(heard: Heard) -> Ready | None:
    answers = [frames.unpack(packet).frame for data in heard.writes for packet in StreamDecoder().feed(data)]
    return next((answer for answer in reversed(answers) if isinstance(answer, Ready)), None)


def ready_of(c_board: CBoard, words: Sequence[int]) -> Ready:
    ready = same_answers(c_board, config.split(words))
    assert ready is not None
    return ready


@by_law
def test_the_defaults_are_ready(c_board: CBoard, table: LawTable) -> None:
    assert ready_of(c_board, config_words(table, {}, [(0, 1, 2, 3), (5, 0, 0, 0)])).status == frames.READY_OK


@by_law
def test_each_word_at_and_beyond_its_limits(c_board: CBoard, table: LawTable) -> None:
    """The smallest and largest count of each word, and the next ones; bits of a word as far as they go, too."""
    words = config_words(table, {})
    told = set()
    for index, word in enumerate((*COMMON, *table.params)):
        bits = next((i for i, other in enumerate((*COMMON, *table.params)) if other.name == word.q), None)
        for exponent in range(46) if bits is not None else (0,):
            for count in _edges(word, exponent):
                changed = list(words)
                changed[index] = count
                if bits is not None:
                    changed[bits] = exponent
                ready = ready_of(c_board, changed)
                told |= {ready.index} if ready.status == frames.READY_BAD_WORD else set()
    assert told >= set(range(1, len(words))) - _unlimited(table)


def _edges(word: Word, exponent: int) -> set[int]:
    """Counts around the limits of a word, as far as an int32 goes."""
    q = exponent if isinstance(word.q, str) else word.q
    edges = {-INT32_MAX - 1, -1, 0, 1, INT32_MAX}
    for bound in (word.minimum, word.maximum):
        if math.isfinite(bound):
            count = math.floor(Fraction(bound) * 2**q)
            edges |= {count + step for step in (-2, -1, 0, 1, 2)}
    return {count for count in edges if -INT32_MAX - 1 <= count <= INT32_MAX}


def _unlimited(table: LawTable) -> set[int]:
    """Indices that no wrong value is told of: the law's own words (they say another law), and words without a limit."""
    names = [word.name for word in (*COMMON, *table.params)]
    return {0, 1, names.index("guidance_rows")}


@given(seed=st.integers(0, 2**32), data=st.data())
def test_any_words(c_board: CBoard, seed: int, data: st.DataObject) -> None:
    """Random words over a law's defaults, so that any check may be the first that fails."""
    words = list(any_words(Random(seed)))
    i32 = st.integers(-INT32_MAX - 1, INT32_MAX)
    for index in data.draw(st.lists(st.integers(0, len(words) - 1), max_size=3)):
        words[index] = data.draw(i32 | st.integers(-60, 60))
    same_answers(c_board, config.split(words[: data.draw(st.integers(0, len(words)) | st.just(len(words)))]))


@given(seed=st.integers(0, 2**32))
def test_any_parts(c_board: CBoard, seed: int) -> None:
    """Any order, repetitions, other cuts, gaps, overlaps."""
    random = Random(seed)
    parts = [part for _ in range(random.randrange(1, 4)) for part in any_parts(random, any_words(random))]
    if random.random() < 0.5:
        random.shuffle(parts)
    same_answers(c_board, parts)


@pytest.mark.parametrize(
    ("index", "value", "status", "told"),
    [
        (2, 1, frames.READY_LAW_REFUSES, frames.NO_INDEX),  # float
        (1, 99, frames.READY_UNKNOWN_LAW, 0),
        (0, 0xFFFF, frames.READY_UNKNOWN_LAW, 0),  # a user's law
        (23, -1, frames.READY_MISSING_PARTS, frames.NO_INDEX),
        (24, -5000, frames.READY_BAD_WORD, 24),
    ],
)
def test_what_a_c_board_refuses(c_board: CBoard, index: int, value: int, status: int, told: int) -> None:
    words = list(config_words(TABLES[0], {}))
    words[index] = value
    steps = steps_of(config.split(words))
    (answer,) = StreamDecoder().feed(c_board.serve(steps).writes[-1])
    assert frames.unpack(answer).frame == Ready(status, told, 0)


def test_rows_less_than_none_do_not_make_up_for_missing_words(c_board: CBoard) -> None:
    words = list(config_words(TABLES[0], {}))[:-ROW_WORDS]
    words[[word.name for word in COMMON].index("guidance_rows")] = -1
    assert ready_of(c_board, words) == Ready(frames.READY_MISSING_PARTS, frames.NO_INDEX, 0)


def test_the_longest_configuration(c_board: CBoard) -> None:
    """4096 rows: all words that there can be, last part first."""
    rows = [(tick, tick, -tick, 0) for tick in range(4096)]
    words = config_words(TABLES[1], {}, rows)
    ready = same_answers(c_board, config.split(words)[::-1])
    assert ready is not None
    assert ready.status == frames.READY_OK
    late = list(words)
    late[-ROW_WORDS] = 4094
    assert (ready_of(c_board, late).status, ready_of(c_board, late).index) == (1, len(words) - ROW_WORDS)


def test_a_board_with_less_room_says_that_it_has_none(build_folder: Path) -> None:
    """Its own words are still checked first."""
    small = CBoard(build_folder, "-DBOARD_MAX_WORDS=114")
    words = config_words(TABLES[0], {}, [(tick, 0, 0, 0) for tick in range(30)])
    bad = [*words[:3], 5, *words[4:]]
    for given_words, expected in (
        (words[:23] + (2,) + words[24 : -28 * ROW_WORDS], Ready(frames.READY_OK, frames.NO_INDEX, 0)),
        (words, REFUSED),
        (bad, Ready(frames.READY_BAD_WORD, 3, 0)),
        (words[:-4], Ready(frames.READY_MISSING_PARTS, frames.NO_INDEX, 0)),
    ):
        (answer,) = StreamDecoder().feed(small.serve(steps_of(config.split(given_words))).writes[-1])
        ready = frames.unpack(answer).frame
        assert ready._replace(table_hash=0) == expected
