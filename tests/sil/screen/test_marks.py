"""Pictures made of characters: the right length for any number, and the number can be read off them."""

from __future__ import annotations

import math

from hypothesis import example, given
from hypothesis import strategies as st

from sil.screen import marks

ANY = st.floats(allow_nan=True, allow_infinity=True)
WIDTH = st.integers(0, 60)


@given(share=ANY, width=WIDTH)
def test_a_filled_bar_has_its_length_whatever_the_share(share: float, width: int) -> None:
    """Protects: no number, however wild, breaks the layout of a line."""
    bar, rest = marks.filled(share, width)
    assert len(bar) + len(rest) == width
    assert bool(bar) == (share > 0 and width > 0)


@given(share=ANY, width=WIDTH)
def test_a_bar_about_zero_has_its_length_and_side(share: float, width: int) -> None:
    """Protects: zero stands in the middle, and the bar on the side of the sign."""
    left, bar, right = marks.about_zero(share, width)
    assert len(left + bar + right) == 2 * (width // 2) + 1
    assert (left + bar + right).index(marks.ZERO) == width // 2
    if share >= 1 and width >= 2:
        assert right == "" and bar.startswith(marks.ZERO)
    if share <= -1 and width >= 2:
        assert left == "" and bar.endswith(marks.ZERO)


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0, 1e6) | st.just(math.nan)), max_size=80), st.integers(1, 50))
def test_bins_keep_the_largest_value(points: list[tuple[float, float]], count: int) -> None:
    """Protects: a short peak is never lost in a history, whatever its resolution."""
    bins = marks.binned(points, 0.0, 100.0, count)
    finite = [y for _, y in points if math.isfinite(y)]
    assert len(bins) == count
    assert max((value for value in bins if value is not None), default=None) == max(finite, default=None)


def test_a_history_shows_what_is_little_and_blanks_what_is_unknown() -> None:
    """Protects: 0 is a line at the bottom, the top is full, what was not measured is empty."""
    assert marks.history([None, 0.0, 0.001, 0.5, 1.0], 1.0) == " ▁▁▄█"


@given(
    st.lists(st.lists(st.tuples(st.floats(-10, 110), ANY), max_size=40), min_size=1, max_size=2),
    st.integers(0, 30),
    st.integers(0, 10),
)
def test_a_chart_stays_in_its_cells(series: list[list[tuple[float, float]]], width: int, height: int) -> None:
    """Protects: curves that leave the box, or are not numbers, draw no character that is not a braille cell."""
    cells = marks.chart([sorted(points, key=lambda p: p[0]) for points in series], (0, 100, -1, 1), width, height)
    assert [len(row) for row in cells] == [width] * height
    assert all(cell >> 8 < len(series) and cell & 0xFF for row in cells for cell in row if cell)


def test_a_chart_draws_a_rising_line() -> None:
    """Protects: left is early, up is more, and the line has no gaps."""
    cells = marks.chart([[(0.0, 0.0), (1.0, 1.0)]], (0, 1, 0, 1), 4, 2)
    rows = ["".join(chr(marks.BRAILLE + cell) if cell else " " for cell in row) for row in cells]
    assert rows == ["  ⡠⠊", "⡠⠊  "]


@given(st.lists(ANY, max_size=20), st.floats(1e-6, 10))
@example([8589934592.0], 1e-6)
@example([1e12, 1e12, -math.inf, 1e308], 1e-6)
def test_a_span_holds_its_values(values: list[float], least: float) -> None:
    """Protects: the numbers beside a chart are above and below everything drawn in it."""
    finite = [value for value in values if abs(value) <= marks.LARGEST]
    low, high = marks.span(values, least)
    slack = 1e-9 * max(abs(low), abs(high), 1)
    assert high > low
    assert all(low - slack <= value <= high + slack for value in finite)
