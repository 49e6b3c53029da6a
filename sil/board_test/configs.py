"""SPEC 6.1 and 6.3: how CONFIG is put together from its parts, and which READY answers it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from protocol import frames
from protocol.config import MAX_PARTS
from protocol.frames import NO_INDEX, Config, Packet, Ready, Tick, Type
from protocol.law_tables import COMMON, ROW_WORDS, ConfigError, LawTable, lsb_of, parse_configuration
from protocol.words import INT32_MAX
from sil.board_test.bench import Bench
from sil.board_test.examinee import Examinee
from sil.board_test.made import UNKNOWN_LAW, cut, sample, unknown_law, words_of
from sil.board_test.outcome import Failed, called, expect, judged, listed, passed
from sil.doctor.findings import Finding

INT32_MIN = -(2**31)
COMMON_NAMES = [word.name for word in COMMON]
FIRST_RANGED = 2  # words 0 and 1 choose the law: an unknown one is another status
ROWS_WORD = "guidance_rows"
NOT_TO_BE_MOVED = (ROWS_WORD, "form")  # a board may have no float form
FULL_ROWS = tuple((7 * number, number, -number, 2 * number) for number in range(40))
MANY_ROWS = tuple((number, number, 0, 0) for number in range(1000))


class Case(NamedTuple):
    """A CONFIG and the READY that it deserves."""

    name: str
    words: tuple[int, ...]
    status: int
    word: int = NO_INDEX


# -- READY -------------------------------------------------------------------------------------------------------------


def statuses(at: Examinee) -> Finding:
    """Unknown law, a count that is not right, what the law refuses; the first check that fails is the answer."""
    cases = [case for table in at.laws for case in _statuses(table)]
    return _ready_answers(at, cases)


def _statuses(table: LawTable) -> Iterator[Case]:
    words = words_of(table)
    name, bad = table.name, frames.READY_MISSING_PARTS
    yield Case(f"{name}: law id {UNKNOWN_LAW}", unknown_law(table), frames.READY_UNKNOWN_LAW, 0)
    yield Case(f"{name}: version 65535", _with(words, 1, 65535), frames.READY_UNKNOWN_LAW, 0)
    yield Case(f"{name}: {len(COMMON) - 1} words", words[: len(COMMON) - 1], bad)
    yield Case(f"{name}: one word", words[:1], bad)
    yield Case(f"{name}: one word too many", (*words, 0), bad)
    yield Case(f"{name}: a row too few", words[:-ROW_WORDS], bad)
    yield Case(f"{name}: one row more announced", _with(words, COMMON_NAMES.index(ROWS_WORD), 2), bad)
    yield Case(f"{name}: guidance_rows -1", _with(words, COMMON_NAMES.index(ROWS_WORD), -1), bad)
    yield Case(f"{name}: unknown law before a bad word", _with(unknown_law(table), 3, 0), frames.READY_UNKNOWN_LAW, 0)
    yield Case(f"{name}: a count that is wrong before a bad word", (*_with(words, 3, 0), 0), bad)
    yield from _refusals(table)


def _refusals(table: LawTable) -> Iterator[Case]:
    """Words in their ranges with which the law will not fly (SPEC 9: period, n, lead, readings)."""
    low, high = table.period_s
    wrong = {
        "period_us": [round(low * 1e6) - 1, round(high * 1e6) + 1],
        "transport_delay_ticks": [n for n in range(5) if n not in table.transport_delays][:1],
        "readings_mask": [7 & ~table.needs],
    }
    for name, values in wrong.items():
        word = COMMON[COMMON_NAMES.index(name)]
        for value in values:
            if word.minimum <= value <= word.maximum:
                words = _with(words_of(table), COMMON_NAMES.index(name), value)
                yield Case(f"{table.name}: {name} {value}", words, frames.READY_LAW_REFUSES)


def bad_words(at: Examinee) -> Finding:
    """Every word just outside of its range, above and below: READY names it. The common ones with one law only."""
    cases = [case for number, table in enumerate(at.laws) for case in _bad_words(table, with_common=number == 0)]
    return _ready_answers(at, cases)


def _bad_words(table: LawTable, with_common: bool) -> Iterator[Case]:
    words = words_of(table)
    first = FIRST_RANGED if with_common else len(COMMON)
    all_words = (*COMMON, *table.params)
    for index in range(first, len(all_words)):
        if all_words[index].name == ROWS_WORD:
            continue  # the count of words is looked at first
        for value in _outside(table, words, index):
            name = f"{table.name}: {all_words[index].name} {value}"
            yield Case(name, _with(words, index, value), frames.READY_BAD_WORD, index)
    two = _with(_with(words, COMMON_NAMES.index("period_us"), 0), COMMON_NAMES.index("link_limit"), 0)
    yield Case(f"{table.name}: two bad words", two, frames.READY_BAD_WORD, COMMON_NAMES.index("period_us"))


def _outside(table: LawTable, words: Sequence[int], index: int) -> Iterator[int]:
    """The largest value below a word's range and the smallest above it, as far as 32 bits go."""
    for bound, step in _bounds(table, words, index):
        value = bound + step
        while INT32_MIN <= value <= INT32_MAX:
            if _is_bad(_with(words, index, value), index):
                yield value
                break
            value += step  # half a count of rounding is none too many


def _inside(table: LawTable, words: Sequence[int], index: int) -> Iterator[int]:
    """The smallest and the largest value of a word that are within its range without any rounding."""
    word = (*COMMON, *table.params)[index]
    for bound, step in _bounds(table, words, index):
        exact = word.minimum if step < 0 else word.maximum
        beyond = bound * _lsb(table, words, index) * step > exact * step
        if INT32_MIN <= bound <= INT32_MAX:
            yield bound - step if beyond else bound


def _bounds(table: LawTable, words: Sequence[int], index: int) -> Iterator[tuple[int, int]]:
    """(count nearest to a limit of the word, direction that leads out), the lower limit first."""
    word = (*COMMON, *table.params)[index]
    for bound, step in ((word.minimum, -1), (word.maximum, 1)):
        if math.isfinite(bound):
            yield round(bound / _lsb(table, words, index)), step


def _lsb(table: LawTable, words: Sequence[int], index: int) -> float:
    all_words = (*COMMON, *table.params)
    return lsb_of(all_words[index], dict(zip([word.name for word in all_words], words, strict=False)))


def _is_bad(words: tuple[int, ...], index: int) -> bool:
    try:
        parse_configuration(words)
    except ConfigError as error:
        return error.index == index
    return False


def limits(at: Examinee) -> Finding:
    """Every word at the ends of its range is taken, or refused, as the reference does."""
    wrong, cases = [], [case for number, table in enumerate(at.laws) for case in _limits(table, number == 0)]
    for number, (name, words) in enumerate(cases):
        at.tell(f"CONFIG {number + 1} of {len(cases)}: {name}")
        want, got = at.reference.open(words), at.bench.open(words)
        if want != got:
            wrong.append(f"{name}: expected {_said(want)}, got {_said(got)}")
    return judged(wrong, f"{len(cases)} CONFIGs, READY and its hash as of the reference", cases=len(cases))


def _limits(table: LawTable, with_common: bool) -> Iterator[tuple[str, tuple[int, ...]]]:
    words = words_of(table)
    all_words = (*COMMON, *table.params)
    for index in range(FIRST_RANGED if with_common else len(COMMON), len(all_words)):
        if all_words[index].name not in NOT_TO_BE_MOVED:
            for value in _inside(table, words, index):
                yield f"{table.name}: {all_words[index].name} {value}", _with(words, index, value)


def rows(at: Examinee) -> Finding:
    """Guidance rows: the tick of each comes after the one before and is not negative; READY names the tick's word."""
    cases = []
    for table in at.laws:
        start = len(COMMON) + len(table.params)
        for name, ticks, bad in (
            ("a negative tick", (-1,), 0),
            ("the same tick twice", (0, 5, 5), 2),
            ("a tick before the last", (0, 9, 4, 12), 2),
            ("two rows in disorder", (0, 9, 4, 3), 2),
        ):
            words = words_of(table, [(tick, 1, 2, 3) for tick in ticks])
            index = start + ROW_WORDS * bad
            cases.append(Case(f"{table.name}: {name}", words, frames.READY_BAD_WORD, index))
        cases.append(Case(f"{table.name}: no row", words_of(table, ()), frames.READY_OK))
        cases.append(Case(f"{table.name}: 40 rows", words_of(table, FULL_ROWS), frames.READY_OK))
    return _ready_answers(at, cases)


def _ready_answers(at: Examinee, cases: Sequence[Case]) -> Finding:
    wrong = []
    for number, case in enumerate(cases):
        at.tell(f"CONFIG {number + 1} of {len(cases)}: {case.name}")
        got = at.bench.open(case.words)
        if (want := _deserved(case)) != got:
            wrong.append(f"{case.name}: expected {_said(want)}, got {_said(got)}")
    return judged(wrong, f"{len(cases)} CONFIGs, status and index of each", cases=len(cases))


def _deserved(case: Case) -> Ready:
    table_hash = parse_configuration(case.words).hash if case.status == frames.READY_OK else 0
    return Ready(case.status, case.word, table_hash)


def _said(ready: Ready) -> str:
    index = "0xFFFF" if ready.index == NO_INDEX else ready.index
    return f"status {ready.status}, index {index}, hash {ready.table_hash:08x}"


def _with(words: Sequence[int], index: int, value: int) -> tuple[int, ...]:
    return (*words[:index], value, *words[index + 1 :])


# -- parts -------------------------------------------------------------------------------------------------------------


def parts(at: Examinee) -> Finding:
    """Parts in any order, any number of times, cut in any way; what does not join; what a new session forgets."""
    bench, table = at.bench, at.law
    words = words_of(table, FULL_ROWS)
    good = [_said(Ready(frames.READY_OK, NO_INDEX, parse_configuration(words).hash))]
    joined = [_said(Ready(frames.READY_MISSING_PARTS, NO_INDEX, 0))]
    a, b, c, d = four = cut(words, -(-len(words) // 4))
    for name, sent, expected in (
        ("in order", four, good),
        ("backwards", four[::-1], good),
        ("each twice", [a, a, b, b, c, c, d], good),
        ("all twice", [a, c, a, c, b, b, d], good),
        ("of seven words each", cut(words, 7), good),
        ("one missing", [a, b, d], []),
        ("further ones after READY", [*four, b, d], good * 3),
        ("with a gap", [a, b, c, d._replace(offset=d.offset + 1)], joined),
        ("that overlap", [a, b, c._replace(offset=c.offset - 1), d], joined),
        ("that all say offset 0", [part._replace(offset=0) for part in four], joined),
        ("in the order of their offsets, not of their numbers", _renumbered(four), joined),
        ("the whole again after a READY that says no", [*four[:3], d._replace(offset=0), *four], joined * 5),
        (f"{MAX_PARTS + 1} of them", [Config(0, MAX_PARTS + 1, 0, words[:10]), *four], good),
    ):
        at.tell(f"parts {name}")
        expect(f"CONFIG in parts {name}", expected, _readies(bench, sent))
    _forgets(bench, a, [b, c, d])
    return passed(f"13 ways to send {len(words)} words in parts; a HELLO between two forgets them if it is new")


def _renumbered(four: Sequence[Config]) -> list[Config]:
    """Part numbers 1 and 2 changed over: in the order of the numbers they do not join."""
    a, b, c, d = four
    return [a, b._replace(part=2), c._replace(part=1), d]


def _readies(bench: Bench, sent: Sequence[Config]) -> list[str]:
    """In a session of their own."""
    bench.greet()
    return [_said(packet.frame) for packet in _answers(bench, sent) if packet.type == Type.READY]


def _answers(bench: Bench, sent: Sequence[Config]) -> list[Packet]:
    """To one part after the other; the HELLO behind each, of the same session, changes nothing."""
    got: list[Packet] = []
    for part in sent:
        got += bench.answers(part)
    return got


def _forgets(bench: Bench, first: Config, others: Sequence[Config]) -> None:
    bench.greet()
    bench.answers(first)
    expect("the other parts after a new nonce: READYs", [], _readies(bench, others))


def other_cut(at: Examinee) -> Finding:
    """SPEC: a board should hand parts whose `parts` differ to a fresh collection."""
    bench, words = at.bench, words_of(at.law, FULL_ROWS)
    four, five = cut(words, -(-len(words) // 4)), cut(words, -(-len(words) // 5))
    got = _readies(bench, [four[0], four[2], *five])
    good = [_said(Ready(frames.READY_OK, NO_INDEX, parse_configuration(words).hash))]
    if got != good:
        return passed(f"not begun anew, which a board only should: {listed(got)}", anew=False)
    return passed("parts of another cut begin a new collection", anew=True)


def many_words(at: Examinee) -> Finding:
    """A thousand guidance rows: ready with the right hash, or READY status 3 where there is no room."""
    words = words_of(at.law, MANY_ROWS)
    at.tell(f"CONFIG of {len(words)} words")
    got = at.bench.open(words)
    if got == Ready(frames.READY_OK, NO_INDEX, parse_configuration(words).hash):
        said = f"{len(words)} words are taken"
        fly = [called(packet) for packet in at.bench.answers(sample(0), Tick(1)) if packet.type == Type.COMMAND]
        expect("SAMPLE(0), TICK(1) with a thousand rows", ["COMMAND(0)", "COMMAND(1)"], fly)
        return passed(said, words=len(words), room=True)
    if got == Ready(frames.READY_LAW_REFUSES, NO_INDEX, 0):
        return passed(f"no room for {len(words)} words, and READY says so (status 3)", words=len(words), room=False)
    raise Failed(f"{len(words)} words: expected READY status 0 with its hash, or 3, got {_said(got)}")
