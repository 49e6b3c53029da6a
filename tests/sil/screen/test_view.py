"""The live view: fits any window, says what matters, survives numbers that are none."""

from __future__ import annotations

import math
import re
from typing import Any

import made
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import events
from sil.screen import palette, view
from sil.screen.messages import error_deg
from sil.screen.seen import EVENTS, SAMPLES, TIMES, Seen


def text(seen: Seen, width: int = 80, height: int = 24) -> str:
    return "\n".join(line.plain for line in view.lines(seen, width, height))


@settings(max_examples=60)
@given(width=st.integers(20, 200), height=st.integers(1, 60), ticks=st.integers(0, 60), follows=st.booleans())
def test_the_view_fits_any_window(width: int, height: int, ticks: int, follows: bool) -> None:
    """Protects: no line wraps and nothing scrolls, so that the view can be drawn over itself."""
    lines = view.lines(made.seen(ticks, follows="reference" if follows else ""), width, height)
    assert len(lines) <= height
    assert max(line.cell_len for line in lines) <= width


def test_a_window_of_80_by_24_shows_everything_that_matters() -> None:
    """Protects: the usual window has state, limits, deadlines, link and events in it."""
    seen = made.seen()
    seen.take(made.state(100, events=[(50.0, events.COMMAND_MISSED, 99, 1, 0)], rebased=2))
    shown = text(seen)
    for words in ("roll", "pitch", "yaw", "attitude", "reference", "error", "torque", "momentum", "wake-up late",
                  "answer after", "missed 0", "COMMAND_MISSED", "2 ticks woke more than a", "left"):  # fmt: skip
        assert words in shown, words
    assert re.search(r"roll +1\.000 +1\.500 +-0\.5000 ", shown)


def test_a_large_window_has_charts_of_attitude_and_error() -> None:
    """Protects: 160 columns are used."""
    shown = text(made.seen(), 160, 45)
    assert "pitch attitude, deg" in shown and "yaw error, deg" in shown
    assert max(len(line.rstrip()) for line in shown.splitlines()) > 140


def test_a_chart_too_narrow_for_what_its_dim_line_is_does_not_say_half_of_it() -> None:
    narrow, wide = text(made.seen(follows="reference"), 100, 40), text(made.seen(follows="reference"), 140, 45)
    assert "pitch attitude, deg" in narrow and "reference d" not in narrow
    assert "pitch attitude, deg   reference dim" in wide


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
def test_a_run_that_blows_up_is_still_shown(bad: float) -> None:
    """Protects: the view of a diverging run, which is when somebody looks."""
    seen = made.seen()
    wild: dict[str, Any] = {"attitude_deg": (bad,) * 3, "torque_Nm": (bad,) * 3, "momentum_Nms": (bad,) * 3}
    sample = (50.0, (bad,) * 3, (0.0,) * 3)
    seen.take(made.state(100, **wild, held_against=sample, samples=[sample]))
    for size in ((80, 24), (160, 45)):
        assert max(len(line) for line in text(seen, *size).splitlines()) <= size[0]


def test_what_is_wrong_stands_out() -> None:
    """Protects: counters that must be 0 are dim words until they count, and red or amber when they do."""
    good = made.seen()
    bad = made.seen()
    assert bad.state is not None
    bad.state.counters["real_misses"] = 3
    tones = [{str(span.style) for line in view.lines(one, 80, 24) for span in line.spans} for one in (good, bad)]
    assert palette.BAD in tones[1]
    assert not re.search(r"white|black", str(tones)), "a background is the user's"


def test_memory_is_bounded_however_long_the_run() -> None:
    """Protects: a view that runs for days."""
    seen = made.seen(0, window_s=1e9)
    for k in range(SAMPLES + 100):
        seen.take(made.state(k, events=[(0.5 * k, k % 19, 0, 0, 0)]))
    assert len(seen.past) == SAMPLES and len(seen.happenings) <= EVENTS and len(seen.late._last) == TIMES


def test_the_worst_is_remembered() -> None:
    """Protects: the worst wake-up and the peak error are those of the run, not of what is in memory."""
    seen = made.seen(1)
    seen.take(made.state(1, late_ns=[7_000_000], samples=[(0.5, (9.0, 0.0, 0.0), (0.0, 0.0, 0.0))]))
    for k in range(2, 3000):
        seen.take(made.state(k))
    assert seen.late.worst == 7.0 and round(seen.late.percentile(99), 9) == 0.05
    assert seen.peaks[0] == 9.0 and seen.past[0].t_s >= 0.5 * 2999 - 600 - 0.5


def test_events_of_a_kind_are_counted_in_one_line() -> None:
    """Protects: a storm of misses does not push the event that caused it out of the window at once."""
    seen = made.seen()
    storm = [(1.0, events.WATCHDOG_ON, 2, 20, 1)]
    for k in range(50):
        storm += [(2.0 + k, events.COMMAND_LATE, k, 1, 0), (2.0 + k, events.COMMAND_MISSED, k, k, 0)]
    seen.take(made.state(100, events=storm))
    assert [(one.code, one.count) for one in seen.happenings] == [
        (events.WATCHDOG_ON, 1), (events.COMMAND_LATE, 50), (events.COMMAND_MISSED, 50),
    ]  # fmt: skip
    assert "COMMAND_MISSED x 50" in text(seen, 80, 30)


@given(st.floats(-1e6, 1e6), st.floats(-180, 180))
def test_an_error_is_the_short_way_round(attitude: float, reference: float) -> None:
    """Protects: 179 and -179 degrees are two degrees apart."""
    error = error_deg((0.0, (attitude, 0.0, 0.0), (reference, 0.0, 0.0)))
    assert error is not None and -180 <= error[0] <= 180
    assert math.isclose(math.remainder(attitude - reference - error[0], 360.0), 0.0, abs_tol=1e-6)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "-"), (0.0, "0.000"), (-0.0, "0.000"), (-1e-9, "0.000"), (12.3456, "12.346"), (123456.7, "123456.7"),
     (1e12, "1.0e+12"), (math.nan, "-"), (math.inf, "inf")],
)  # fmt: skip
def test_a_number_never_outgrows_its_column(value: float | None, shown: str) -> None:
    """Protects: columns stay columns."""
    assert view.number(value, 3) == shown
