"""Events in words: choices are told by what they mean, unknown codes are told all the same."""

from __future__ import annotations

from protocol import events
from sil.sinks.events import describe


def test_a_choice_is_told_by_its_meaning() -> None:
    assert describe(events.REAL_MISS, 4, 1)[1].endswith("(tick 4, why: the board's timer was faster)")


def test_a_number_that_is_no_choice_stays_a_number() -> None:
    assert describe(events.REAL_MISS, 4, 9)[1].endswith(" 9)")
    assert "(tick 3" in describe(events.OVERRUN, 3, 1)[1]


def test_an_unknown_code_is_said() -> None:
    assert describe(0xFFF0, 1, 2) == ("warning", "unknown event code 0xFFF0 (a 1, b 2)")
