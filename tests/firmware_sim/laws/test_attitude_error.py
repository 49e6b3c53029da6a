"""The attitude error: against rotation matrices, fixed against float, large angles, the seam at 180 degrees."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim.checked import rebound
from firmware_sim.controllers import attitude_error
from firmware_sim.controllers.attitude_error import error_fixed, error_float, quaternion_float
from sil.rotations import dcm_of_euler

EULER, QUATERNION = 0, 1
SEQUENCES = (321, 123)
BAM = 2.0 * math.pi / 2**32
Q29 = 2.0**-29
TOLERANCE = 2e-8  # rad: what sixteen roundings of 2^-30 can come to
bams = st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3)
sequences = st.sampled_from((0, 1))


def rad(angles: tuple[int, int, int]) -> tuple[float, float, float]:
    x, y, z = (angle * BAM for angle in angles)
    return x, y, z


def scalar(sequence: int, y: tuple[int, int, int], r: tuple[int, int, int]) -> float:
    return float(np.dot(quaternion_float(sequence, rad(y)), quaternion_float(sequence, rad(r))))


@given(sequence=sequences, y=bams, r=bams)
def test_the_body_error_is_that_of_the_rotation_matrices(sequence: int, y: tuple, r: tuple) -> None:
    turn = dcm_of_euler(np.array(rad(y)), SEQUENCES[sequence]) @ dcm_of_euler(np.array(rad(r)), SEQUENCES[sequence]).T
    w = 0.5 * math.sqrt(max(1.0 + np.trace(turn), 0.0))
    if w < 0.01:
        return  # half a turn away: no way is the shorter one
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (4.0 * w)
    assert error_float(QUATERNION, sequence, rad(y), rad(r)) == pytest.approx(-2.0 * vector, abs=1e-9 / w)


@settings(max_examples=300)
@given(kind=st.sampled_from((EULER, QUATERNION)), sequence=sequences, y=bams, r=bams)
def test_the_fixed_form_is_the_float_one(kind: int, sequence: int, y: tuple, r: tuple) -> None:
    if kind == QUATERNION and abs(scalar(sequence, y, r)) < 1e-7:
        return
    expected = np.array(error_float(kind, sequence, rad(y), rad(r)))
    got = np.array(error_fixed(kind, sequence, y, r)) * Q29
    seam = kind == EULER and np.abs(np.abs(expected) - math.pi) < 1e-8
    assert (np.abs(got - expected) < TOLERANCE)[~np.broadcast_to(seam, 3)].all()


@given(sequence=sequences, y=bams, step=st.tuples(*[st.integers(-(2**16), 2**16)] * 3))
def test_small_errors_keep_their_digits_at_any_attitude(sequence: int, y: tuple, step: tuple) -> None:
    """Up to 5 mdeg off at whatever attitude: no more than the rounding of the products is lost."""
    r = tuple((a + b + 2**31) % 2**32 - 2**31 for a, b in zip(y, step, strict=True))
    expected = error_float(QUATERNION, sequence, rad(y), rad(r))
    assert np.array(error_fixed(QUATERNION, sequence, y, r)) * Q29 == pytest.approx(expected, abs=TOLERANCE)
    assert np.abs(expected).max() < 3 * 2**16 * BAM


@given(kind=st.sampled_from((EULER, QUATERNION)), sequence=sequences, y=bams, r=bams)
def test_no_intermediate_leaves_its_register(kind: int, sequence: int, y: tuple, r: tuple) -> None:
    checked = rebound(error_fixed, {})
    error = checked(kind, sequence, y, r)
    assert error == error_fixed(kind, sequence, y, r)
    assert all(-(2**31) <= x < 2**31 for x in error)


@pytest.mark.parametrize("kind", [EULER, QUATERNION])
@pytest.mark.parametrize("sequence", [0, 1])
def test_the_short_way_over_the_seam(kind: int, sequence: int) -> None:
    """179 degrees of yaw against -179: two degrees, not 358."""
    y, r = (0, 0, round(179 / 360 * 2**32)), (0, 0, -round(179 / 360 * 2**32))
    two = -math.radians(2.0) if kind == EULER else -2.0 * math.sin(math.radians(1.0))
    assert error_float(kind, sequence, rad(y), rad(r)) == pytest.approx((0, 0, two), abs=1e-9)
    assert np.array(error_fixed(kind, sequence, y, r)) * Q29 == pytest.approx((0, 0, two), abs=1e-8)


def test_sign_is_measured_minus_reference_in_body_axes() -> None:
    """At 90 degrees of yaw a roll too large is a turn about the body's minus y in 1-2-3, about its x in 3-2-1."""
    quarter, small = 2**30, 2**20
    assert attitude_error.error_fixed(EULER, 0, (small, 0, 0), (0, 0, 0))[0] > 0
    assert attitude_error.error_fixed(QUATERNION, 0, (small, 0, 0), (0, 0, 0))[0] > 0
    in_123 = attitude_error.error_fixed(QUATERNION, 1, (small, 0, quarter), (0, 0, quarter))
    assert abs(in_123[0]) < 10 and in_123[1] < -1000  # x is turned by the yaw that follows it
    in_321 = attitude_error.error_fixed(QUATERNION, 0, (small, 0, quarter), (0, 0, quarter))
    assert in_321[0] > 1000 and abs(in_321[1]) < 10  # x comes last: it is the body's own
