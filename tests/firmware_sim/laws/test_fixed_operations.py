"""fixed.py against exact integers and libm: the C firmware is held to the same definitions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim import fixed, jit
from firmware_sim.checked import RegisterOverflow, rebound

int32 = st.integers(-(2**31), 2**31 - 1)
int62 = st.integers(-(2**62), 2**62)
TURN = 2 * math.pi / 2**32


def half_up(value: Fraction) -> int:
    return math.floor(value + Fraction(1, 2))


@given(int62, st.integers(-0, 61))
def test_shift_round_is_division_rounded_half_up(x: int, n: int) -> None:
    assert fixed.shift_round(x, n) == half_up(Fraction(x, 2**n))


@given(int32, int32, st.integers(0, 62))
def test_mul_q(a: int, b: int, n: int) -> None:
    assert fixed.mul_q(a, b, n) == half_up(Fraction(a * b, 2**n))


@given(st.integers(-(2**60), 2**60), int32, st.integers(30, 62))
def test_mul_wide(a: int, b: int, n: int) -> None:
    """Exact up to n = 32; beyond, the cut at 2^32 can only lower the result by what rounds down."""
    exact = half_up(Fraction(a * b, 2**n))
    if n <= 32:
        assert fixed.mul_wide(a, b, n) == exact
    else:
        assert fixed.mul_wide(a, b, n) == half_up(Fraction((a * b) >> 32, 2 ** (n - 32)))
        assert exact - 1 <= fixed.mul_wide(a, b, n) <= exact


@given(int62, int62)
def test_div_trunc_is_c_division(a: int, b: int) -> None:
    if b == 0:
        return
    assert fixed.div_trunc(a, b) == math.trunc(Fraction(a, b))


def test_div_trunc_by_zero_and_signs() -> None:
    assert [fixed.div_trunc(a, 0) for a in (5, 0, -5)] == [2**31 - 1, 0, -(2**31) + 1]
    assert [fixed.div_trunc(a, b) for a, b in ((-7, 2), (7, -2), (-7, -2), (7, 2))] == [-3, -3, 3, 3]


@given(int62, st.integers(2, 61))
def test_wrap(x: int, n: int) -> None:
    wrapped = fixed.wrap_bits(x, n)
    assert (wrapped - x) % 2**n == 0 and -(2 ** (n - 1)) <= wrapped < 2 ** (n - 1)
    assert fixed.wrap32(x) == fixed.wrap_bits(x, 32)


@given(int32, int32)
def test_saturating_sums(a: int, b: int) -> None:
    assert fixed.add_sat(a, b) == min(max(a + b, -(2**31)), 2**31 - 1)
    assert fixed.sub_sat(a, b) == min(max(a - b, -(2**31)), 2**31 - 1)


@given(st.integers(1, 2**62))
def test_norm_shift(x: int) -> None:
    assert 2**30 <= Fraction(x) * Fraction(2) ** fixed.norm_shift(x) < 2**31


@given(int32)
def test_sine_and_cosine(angle: int) -> None:
    """Within 2^-30, and exact at the quarter turns."""
    assert abs(fixed.sin_q(angle) - math.sin(angle * TURN) * 2**30) <= 1.0
    assert abs(fixed.cos_q(angle) - math.cos(angle * TURN) * 2**30) <= 1.0
    assert abs(fixed.sin_q(angle)) <= 2**30


def test_sine_at_quarter_turns() -> None:
    assert [fixed.sin_q(n << 30) for n in (-2, -1, 0, 1)] == [0, -(2**30), 0, 2**30]
    assert [fixed.cos_q(n << 30) for n in (-2, -1, 0, 1)] == [-(2**30), 0, 2**30, 0]


@given(int32, int32)
def test_atan2(y: int, x: int) -> None:
    """Within 2 bam (2^-28 rad), modulo a turn."""
    error = fixed.wrap32(fixed.atan2_q(y, x)) - math.atan2(y, x) / TURN
    assert abs((error + 2**31) % 2**32 - 2**31) <= 2.0 or (x == 0 and y == 0)
    assert fixed.atan2_q(0, 0) == 0


def test_keep32_flags() -> None:
    state = np.zeros(2, np.int64)
    assert fixed.keep32(2**31, state, 1) == 2**31 - 1 and state[1] == 1
    state[1] = 0
    assert fixed.keep32(-(2**31), state, 1) == -(2**31) and state[1] == 0


def test_checked_mode_raises_where_int64_would_wrap() -> None:
    peaks: dict[str, int] = {}
    mul_q = rebound(fixed.mul_q, peaks)
    assert mul_q(2**31, 2**31, 40) == 2**22
    with pytest.raises(RegisterOverflow, match="64 bits"):
        mul_q(2**32, 2**32, 40)
    with pytest.raises(RegisterOverflow, match="32 bits"):
        rebound(fixed.mul_wide, peaks)(1, 2**32, 8)
    assert peaks["mul_q"] == 2**31 and peaks["intermediate64"] >= 2**62


def operations(values: np.ndarray, out: np.ndarray) -> None:
    """Every operation on every pair of values."""
    n = 0
    for i in range(values.shape[0]):
        for j in range(values.shape[0]):
            a, b = values[i], values[j]
            out[n] = fixed.mul_q(a, b, 31) + fixed.mul_wide(a, b, 33) - fixed.div_trunc(a, b)
            out[n + 1] = fixed.add_sat(a, b) + fixed.sub_sat(a, b) + fixed.wrap32(a + b) + fixed.wrap_bits(a, 17)
            out[n + 2] = fixed.sin_q(a) - fixed.cos_q(b) + fixed.atan2_q(a, b)
            out[n + 3] = fixed.clip(a, -b, b) + fixed.shift_round(a, 3) + fixed.shift_round(a, -3)
            n += 4


def test_compiled_equals_python() -> None:
    edge = [-(2**31), -(2**31) + 1, -(2**30), -7, -1, 0, 1, 2, 7, 2**29, 2**30, 2**31 - 1]
    random = np.random.default_rng(3).integers(-(2**31), 2**31, 30).tolist()
    values = edge + random
    compiled, plain = np.zeros(4 * len(values) ** 2, np.int64), np.zeros(4 * len(values) ** 2, dtype=object)
    jit.numba.njit(operations)(np.array(values, np.int64), compiled)
    operations(np.array(values, dtype=object), plain)
    assert compiled.tolist() == plain.tolist()
