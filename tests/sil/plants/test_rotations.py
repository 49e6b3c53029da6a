"""Quaternion, matrix and Euler angles agree with each other and with scipy, for both sequences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sil.rotations import body_rate_of_euler_rate, dcm_of_euler, dcm_of_q, euler_of_dcm, orbit_axes, q_of_dcm

TURN = st.floats(-math.pi + 1e-9, math.pi - 1e-9)
TILT = st.floats(-math.pi / 2 + 1e-3, math.pi / 2 - 1e-3)
SEQUENCES = pytest.mark.parametrize("sequence", [321, 123])


@SEQUENCES
@given(phi=TURN, theta=TILT, psi=TURN)
def test_angles_to_matrix_and_back(sequence: int, phi: float, theta: float, psi: float) -> None:
    euler, back = np.array([phi, theta, psi]), np.empty(3)
    euler_of_dcm(dcm_of_euler(euler, sequence), sequence, back)
    np.testing.assert_allclose(back, euler, rtol=0, atol=1e-11)


@SEQUENCES
@given(phi=TURN, theta=TILT, psi=TURN)
def test_matrix_to_quaternion_and_back(sequence: int, phi: float, theta: float, psi: float) -> None:
    C, back = dcm_of_euler(np.array([phi, theta, psi]), sequence), np.empty((3, 3))
    dcm_of_q(q_of_dcm(C), back)
    np.testing.assert_allclose(back, C, rtol=0, atol=1e-14)


@given(phi=TURN, theta=TILT, psi=TURN)
def test_321_is_yaw_first_and_123_is_intrinsic_roll_first(phi: float, theta: float, psi: float) -> None:
    """scipy's upper-case sequences are intrinsic and active: their transpose is C_BR."""
    euler = np.array([phi, theta, psi])
    yaw_first = Rotation.from_euler("ZYX", euler[::-1]).as_matrix().T
    roll_first = Rotation.from_euler("XYZ", euler).as_matrix().T
    np.testing.assert_allclose(dcm_of_euler(euler, 321), yaw_first, rtol=0, atol=1e-14)
    np.testing.assert_allclose(dcm_of_euler(euler, 123), roll_first, rtol=0, atol=1e-14)


@given(phi=TURN, theta=TILT, psi=TURN)
def test_quaternion_maps_body_to_reference(phi: float, theta: float, psi: float) -> None:
    C = dcm_of_euler(np.array([phi, theta, psi]), 321)
    np.testing.assert_allclose(Rotation.from_quat(np.roll(q_of_dcm(C), -1)).as_matrix(), C.T, rtol=0, atol=1e-14)


@SEQUENCES
def test_euler_rates_are_the_derivative_of_the_angles(sequence: int) -> None:
    euler, rate, dt = np.array([0.3, -0.7, 2.0]), np.array([0.01, -0.02, 0.03]), 1e-6
    before, after = (dcm_of_euler(euler + sign * dt / 2 * rate, sequence) for sign in (-1, 1))
    turn = (after - before) / dt @ dcm_of_euler(euler, sequence).T  # C' = -[w x] C
    w = body_rate_of_euler_rate(euler, rate, sequence)
    np.testing.assert_allclose(-np.array([turn[2, 1], turn[0, 2], turn[1, 0]]), w, rtol=0, atol=1e-9)


def test_orbital_axes_are_along_track_minus_normal_nadir() -> None:
    i, u, C = math.radians(97.8), 0.7, np.empty((3, 3))
    orbit_axes(u, math.cos(i), math.sin(i), C)
    r = np.array([math.cos(u), math.sin(u) * math.cos(i), math.sin(u) * math.sin(i)])
    v = np.array([-math.sin(u), math.cos(u) * math.cos(i), math.cos(u) * math.sin(i)])
    np.testing.assert_allclose(C, [v, -np.cross(r, v), -r], rtol=0, atol=1e-15)
    np.testing.assert_allclose(C @ C.T, np.eye(3), rtol=0, atol=1e-15)
