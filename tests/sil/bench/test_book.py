"""Figures: ratios are those of the pairs measured together, goals judge what they say, and JSON can be written."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.bench.book import Book, Goal, Line, Plan, spread

FIGURES = st.floats(1e-6, 1e9)
PAIRS = st.lists(st.tuples(FIGURES, FIGURES), min_size=1, max_size=9)


def line_of(pairs: list[tuple[float, float]], goal: Goal | None = None) -> Line:
    line = Line("case", "us", "cyclictest", goal)
    for ours, beside in pairs:
        line.add(ours, beside)
    return line


@given(PAIRS)
def test_ratios_are_those_of_the_pairs_not_of_the_medians(pairs: list[tuple[float, float]]) -> None:
    line = line_of(pairs)
    assert line.ratios == [ours / beside for ours, beside in pairs]
    found = spread(line.ratios)
    assert found is not None
    assert found.low <= found.median <= found.high


def test_a_line_with_fewer_repeats_beside_it_has_as_many_ratios() -> None:
    """Interrupted between ours and what runs beside it."""
    line = line_of([(2.0, 1.0)])
    line.add(3.0)
    assert line.ratios == [2.0]


def test_nothing_counted_beside_us_has_no_ratio_but_an_excess() -> None:
    """0 late wake-ups of cyclictest must not divide."""
    line = line_of([(1.0, 0.0)], Goal(1.0, of="excess", judged="each"))
    assert line.ratios == []
    assert line.met is True


@pytest.mark.parametrize(
    ("goal", "met"),
    [
        (Goal(2.0), True),  # median of 1, 2, 9
        (Goal(2.0, judged="each"), False),
        (Goal(1.9), False),
        (Goal(2.0, at_most=False), True),
        (Goal(2.1, at_most=False), False),
        (Goal(20.0, of="ours"), True),
        (Goal(19.0, of="ours"), False),
        (Goal(10.0, of="excess"), True),
        (Goal(9.0, of="excess"), False),
    ],
)
def test_a_goal_judges_what_it_says(goal: Goal, met: bool) -> None:
    assert line_of([(10.0, 10.0), (20.0, 10.0), (90.0, 10.0)], goal).met is met


def test_a_goal_without_figures_is_neither_met_nor_missed() -> None:
    """A bench that was skipped, or interrupted before its first repeat, has missed nothing."""
    assert Line("case", "us", goal=Goal(1.5)).met is None
    alone = Line("case", "us", goal=Goal(1.5))
    alone.add(5.0)  # nothing to compare with
    assert alone.met is None


def test_the_text_of_a_goal_says_what_is_compared() -> None:
    texts = [goal.text() for goal in (Goal(1.5), Goal(5.0, of="ours"), Goal(1.0, of="excess"), Goal(1, at_most=False))]
    assert texts == ["<= 1.5", "sil <= 5", "sil <= +1", ">= 1"]


def test_a_line_is_made_once() -> None:
    book = Book("plant")
    book.line("free", "steps/s").add(1.0)
    book.line("free", "steps/s").add(2.0)
    assert [line.ours for line in book.lines] == [[1.0, 2.0]]


def test_a_book_is_json_with_the_published_keys() -> None:
    """What a program reads: `sil bench --json`."""
    book = Book("plant", "about", load=(0.1, 0.2))
    book.line("free", "steps/s", "Basilisk", more=True).add(4.0, 2.0)
    book.line("alone", "us").add(3.0)
    book.line("not measured", "us", goal=Goal(1.0))
    found = json.loads(json.dumps(book.plain(), allow_nan=False))
    assert set(found) == {
        *("about", "finished", "skipped", "wall_s", "load_before_after", "lines", "notes", "details"),
    }
    free, alone, nothing = found["lines"]
    assert free["ratio"] == {"median": 2.0, "low": 2.0, "high": 2.0, "values": [2.0]}
    assert (free["beside_what"], free["more_is_better"], free["goal"], free["met"]) == ("Basilisk", True, None, None)
    assert (alone["ratio"], alone["beside"], alone["ours"]["values"]) == (None, None, [3.0])
    assert (nothing["ours"], nothing["goal"], nothing["met"]) == (None, "<= 1", None)


def test_every_repeat_is_announced() -> None:
    said: list[str] = []
    assert list(Plan(2, doing=said.append).rounds("plant")) == [0, 1]
    assert said == ["plant, repeat 1 of 2", "plant, repeat 2 of 2"]
