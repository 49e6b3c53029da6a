"""Wheel limits: torque, and momentum that never passes its limit at the end of a period."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sil.actuators.wheels import Wheels

NUMBERS = st.floats(-10.0, 10.0)


def limit(command: float, h: float, torque_max: float = 0.1, momentum_max: float = 0.3, period_s: float = 0.5) -> float:
    wheels = Wheels((torque_max,) * 3, (momentum_max,) * 3)
    return float(wheels.limit(np.array([command, 0.0, 0.0]), np.array([h, 0.0, 0.0]), period_s)[0])


def test_torque_is_clipped_on_each_axis() -> None:
    wheels = Wheels((0.1, 0.2, math.inf), (math.inf,) * 3)
    applied = wheels.limit(np.array([1.0, -1.0, 1.0]), np.zeros(3), 0.5)
    np.testing.assert_array_equal(applied, [0.1, -0.2, 1.0])


def test_at_the_limit_only_torque_that_unloads_is_given() -> None:
    assert limit(-0.05, h=0.3) == 0.0  # h' = +0.05 would drive it up
    assert limit(0.05, h=0.3) == 0.05
    assert limit(0.05, h=-0.3) == 0.0


def test_the_last_bit_of_momentum_is_still_used() -> None:
    assert math.isclose(limit(-0.1, h=0.28), -0.04)


def test_beyond_the_limit_nothing_is_forced() -> None:
    """Wheels that start too fast may keep their speed: the limit takes torque away, it does not command any."""
    assert limit(0.0, h=0.5) == 0.0
    assert limit(-0.1, h=0.5) == 0.0
    assert limit(0.1, h=0.5) == 0.1


@given(command=NUMBERS, h=st.floats(-0.3, 0.3), torque_max=st.floats(0.01, 5), period_s=st.floats(0.01, 10))
def test_momentum_never_passes_its_limit(command: float, h: float, torque_max: float, period_s: float) -> None:
    applied = limit(command, h, torque_max, 0.3, period_s)
    assert abs(applied) <= torque_max
    assert abs(h - applied * period_s) <= 0.3 * (1 + 1e-12)
    assert applied * command >= 0
    assert abs(applied) <= abs(command)


@given(command=NUMBERS, h=NUMBERS)
def test_without_limits_the_command_acts(command: float, h: float) -> None:
    assert limit(command, h, math.inf, math.inf) == command
