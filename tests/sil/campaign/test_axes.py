"""`--vary KEY=SPEC`: what a user writes is what is flown, and what cannot be meant is refused in one clear line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.campaign.axes import parse_axis
from sil.trouble import UsageError

FRACTION = st.floats(0.0, 1.0, exclude_max=True)


def values(spec, held=0.5):
    return parse_axis("key", spec, held, "--vary key").values


def drawn(spec, u, held=0.5):
    axis = parse_axis("key", spec, held, "--vary key")
    assert axis.draw is not None and not axis.values
    return axis.draw(u)


def test_points_are_the_numbers_one_would_write():
    assert values("0.5:0.9:9") == (0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)
    assert values("1e-3:-1e-3:3") == (1e-3, 0.0, -1e-3)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.integers(2, 50))
def test_points_have_both_ends_and_the_count(low, high, count):
    if low == high or abs(low - high) < 1e-6 * max(abs(low), abs(high)):
        return
    points = values(f"{low!r}:{high!r}:{count}")
    assert len(points) == count
    assert (points[0], points[-1]) == (low, high)
    assert list(points) == sorted(points, reverse=low > high)


def test_a_key_of_whole_numbers_gets_whole_numbers():
    for spec, expected in (("1:4", (1, 2, 3, 4)), ("1:100:4", (1, 34, 67, 100)), ("7:7", (7,))):
        assert values(spec, held=0) == expected
        assert all(isinstance(value, int) for value in values(spec, held=0))
    assert all(isinstance(value, float) for value in values("1:3", held=2.0))


def test_lists_are_yaml():
    assert values("appc,mrac", "appc") == ("appc", "mrac")
    assert values("true, false", True) == (True, False)
    assert values("[10, 10, 5], [0,0,0]", None) == ((10, 10, 5), (0, 0, 0))
    assert values("lockstep,'scaled:20'", "lockstep") == ("lockstep", "scaled:20")
    assert values("'1:3'", "text") == ("1:3",)  # in quotes it is a text
    assert values((1, 2.5), 0.5) == (1, 2.5)  # from a file
    assert values(3, 1) == (3,)


@given(FRACTION)
def test_draws_stay_within_what_was_written(u):
    assert -2.0 <= drawn("uniform(-2, 3)", u) < 3.0
    assert 1e-3 <= drawn("log(0.001, 0.1)", u) <= 0.1
    assert drawn("choice(24, 16)", u) in (24, 16)
    whole = drawn("uniform(1, 3)", u, held=7)
    assert whole in (1, 2, 3) and isinstance(whole, int)
    assert isinstance(drawn("normal(5, 2)", u, held=7), int)


def test_the_distributions_are_what_they_are_called():
    assert drawn("uniform(1, 3)", 0.5) == 2.0
    assert drawn("log(0.01, 100)", 0.5) == pytest.approx(1.0)
    assert drawn("normal(5, 2)", 0.5) == pytest.approx(5.0)
    assert drawn("normal(5, 2)", 0.8413447460685429) == pytest.approx(7.0)
    assert [drawn("uniform(1, 4)", u, held=1) for u in (0.0, 0.249, 0.25, 0.99)] == [1, 1, 2, 4]


@pytest.mark.parametrize(
    ("spec", "held", "said"),
    [
        ("", 0.5, "got nothing"),
        ("0.5:0.9", 0.5, "a:b:n"),
        ("3:1", 0, "a <= b"),
        ("1:20:4", 0, "every one of them: 1:20"),
        ("0.5:3:4", 0, "whole numbers"),
        ("1:2:1", 0.5, "at least 2 points"),
        ("1:1000000", 0, "at most 100000 points"),
        ("1,1", 0, "each value once"),
        ("gauss(1,2)", 0.5, "one of uniform, log, normal, choice"),
        ("uniform(1)", 0.5, "two numbers"),
        ("uniform(a,b)", 0.5, "two numbers"),
        ("uniform(2,1)", 0.5, "a below b"),
        ("uniform(0.5,3)", 0, "whole numbers"),
        ("log(0,1)", 0.5, "0 < a < b"),
        ("normal(1,0)", 0.5, "above 0"),
        ("choice()", 0.5, "at least one"),
        ("[1", 0.5, "a:b:n"),
    ],
)
def test_what_cannot_be_meant_is_refused(spec, held, said):
    with pytest.raises(UsageError) as caught:
        values(spec, held)
    text = str(caught.value)
    assert text.startswith("--vary key: expected ") and said in text and "\n" not in text


@given(st.text(max_size=30))
def test_no_spec_ends_in_anything_but_an_axis_or_a_refusal(spec):
    try:
        axis = parse_axis("key", spec, None, "--vary key")
    except UsageError:
        return
    assert axis.values or axis.draw is not None
