"""Sensors: rounding to the LSB, wrapping, saturation, and noise of the size that was asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.sensors.attitude import Attitude
from sil.sensors.quaternion import Quaternion
from sil.sensors.rate import Rate
from sil.signals import Motion, Vector

TURN_BAM = 2**32


def motion(euler: Vector | None = None, q: Vector | None = None, omega: Vector | None = None) -> Motion:
    zero = np.zeros(3)
    unit = np.array([1.0, 0.0, 0.0, 0.0])
    return Motion(
        0, unit if q is None else q, zero if omega is None else omega, zero, zero if euler is None else euler, zero
    )


@given(angle=st.floats(-math.pi, math.pi), bits=st.sampled_from([0, 8, 12, 16, 24, 32]))
def test_angle_is_rounded_to_its_lsb(angle: float, bits: int) -> None:
    values = Attitude(0.0, bits, 0).read(motion(euler=np.array([angle, 0.0, 0.0])), 0).values
    lsb = 2 ** (32 - (bits or 32))
    assert values[0] % lsb == 0
    away = (values[0] - angle / (2 * math.pi) * TURN_BAM + TURN_BAM / 2) % TURN_BAM - TURN_BAM / 2
    assert abs(away) <= lsb / 2 + 1e-5
    assert values[1:] == (0, 0)


def test_half_a_turn_is_the_most_negative_angle_on_the_wire() -> None:
    assert Attitude(0.0, 24, 0).read(motion(euler=np.array([math.pi, -math.pi, 0.0])), 0).values == (
        -(2**31),
        -(2**31),
        0,
    )


def test_ten_degrees_on_the_wire() -> None:
    angles = np.radians([10.0, -10.0, 90.0])
    assert Attitude(0.0, 0, 0).read(motion(euler=angles), 0).values == (119304647, -119304647, 2**30)


def test_attitude_noise_is_white_with_its_sigma() -> None:
    sensor = Attitude(0.02, 0, 5)
    noise = np.array([sensor.read(motion(), k).values for k in range(4096)]) * 360.0 / TURN_BAM
    np.testing.assert_allclose(noise.std(axis=0), 0.02, rtol=0.05)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=0.0015)
    assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.06
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.06


def test_quaternion_in_q30() -> None:
    q = np.array([0.5, -0.5, 0.5, -0.5])
    assert Quaternion(0.0, 0, 0).read(motion(q=q), 0).values == (2**29, -(2**29), 2**29, -(2**29))
    assert Quaternion(0.0, 31, 0).read(motion(), 0).values == (2**30, 0, 0, 0)


@pytest.mark.parametrize("bits", [8, 16, 24])
def test_quaternion_is_rounded_to_its_lsb(bits: int) -> None:
    q = np.array([0.8, 0.1, -0.2, 0.55])
    q /= np.linalg.norm(q)
    values = np.array(Quaternion(0.0, bits, 0).read(motion(q=q), 0).values)
    assert not (values % 2 ** (31 - bits)).any()
    np.testing.assert_allclose(values / 2**30, q, rtol=0, atol=2.0 / 2**bits / 2)


def test_quaternion_noise_is_a_small_turn_in_body_axes() -> None:
    sensor = Quaternion(0.02, 0, 5)
    read = np.array([sensor.read(motion(), k).values for k in range(4096)]) / 2**30
    np.testing.assert_allclose(np.linalg.norm(read, axis=1), 1.0, atol=3e-9)
    np.testing.assert_allclose(np.degrees(2 * read[:, 1:]).std(axis=0), 0.02, rtol=0.05)


def test_rate_is_scaled_rounded_and_saturates() -> None:
    omega = np.array([0.25, -100.0, 100.0])
    assert Rate(0.0, 0.0, 28, 0).read(motion(omega=omega), 0).values == (2**26, -(2**31 - 1), 2**31 - 1)
    stepped = Rate(0.0, 0.01, 28, 0).read(motion(omega=np.radians([0.014, 0.016, 0.0])), 0).values
    assert stepped == (round(math.radians(0.01) * 2**28), round(math.radians(0.02) * 2**28), 0)
