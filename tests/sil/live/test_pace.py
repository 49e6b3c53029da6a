"""How many ticks a viewer is shown: never more than are allowed, never none for ever, evenly, the newest among them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from sil.live.pace import SAVED_UP, TICKS_PER_S, Allowance, spread


@given(st.lists(st.tuples(st.integers(0, 3000), st.floats(0.0, 3.0)), max_size=60))
def test_never_more_than_allowed(rounds):
    allowance, now = Allowance(0.0), 0.0
    shown = 0
    for ticks, pause in rounds:
        now += pause
        got = allowance.of(ticks, now)
        assert len(got) == ticks
        shown += sum(got)
        assert shown <= SAVED_UP + now * TICKS_PER_S + 1e-6


def test_a_run_at_forty_ticks_a_second_is_shown_whole():
    allowance = Allowance(0.0)
    assert all(all(allowance.of(1, k / 40)) for k in range(10_000))


@given(st.integers(1, 5000), st.data())
def test_even_and_with_the_newest(of, data):
    shown = data.draw(st.integers(1, of))
    chosen = [k for k, yes in enumerate(spread(shown, of)) if yes]
    assert len(chosen) == shown and chosen[-1] == of - 1
    gaps = [b - a for a, b in zip([-1, *chosen], chosen, strict=False)]
    assert max(gaps) - min(gaps) <= 1
