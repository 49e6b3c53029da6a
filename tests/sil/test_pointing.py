"""Quaternions for logs and pages are the rotations that the plant flies: sil.pointing against sil.rotations, scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sil.pointing import Orbit, continued, directions, inverse, orbit_of, q_columns, q_of_euler, q_of_orbit, times
from sil.rotations import dcm_of_euler, dcm_of_q, orbit_axes

TURN = st.floats(-math.pi, math.pi)
SEQUENCES = pytest.mark.parametrize("sequence", [321, 123])


def dcm(q: tuple[float, ...]) -> np.ndarray:
    C = np.empty((3, 3))
    dcm_of_q(np.array(q), C)
    return C


@SEQUENCES
@given(phi=TURN, theta=TURN, psi=TURN)
def test_angles_give_the_rotation_of_the_matrix(sequence: int, phi: float, theta: float, psi: float) -> None:
    angles = np.array([phi, theta, psi])
    np.testing.assert_allclose(dcm(q_of_euler(angles, sequence)), dcm_of_euler(angles, sequence), rtol=0, atol=1e-14)


@SEQUENCES
def test_a_column_of_angles_is_each_of_them_with_continuous_sign(sequence: int) -> None:
    angles = np.cumsum(np.random.default_rng(1).uniform(-20, 20, (500, 3)), axis=0)
    column = q_columns(angles, sequence)
    assert (np.einsum("ij,ij->i", column[1:], column[:-1]) > 0).all()
    for q, euler in zip(column, np.radians(angles), strict=True):
        one = q_of_euler(euler, sequence)
        assert np.allclose(q, one, atol=1e-14) or np.allclose(-q, one, atol=1e-14)
    assert np.isnan(q_columns(np.array([[0.0, np.nan, 0.0]]), sequence)).all()


@given(u=st.floats(-20, 20), tilt=TURN)
def test_the_orbital_frame_is_the_plants(u: float, tilt: float) -> None:
    """orbit_axes has C_ON; q_ON maps O to N, so its matrix C (v_O = C v_N) is the same."""
    C_ON = np.empty((3, 3))
    orbit_axes(u, math.cos(tilt), math.sin(tilt), C_ON)
    q_ON = q_of_orbit(math.cos(u / 2), math.sin(u / 2), tilt)
    np.testing.assert_allclose(dcm(q_ON), C_ON, rtol=0, atol=1e-14)


def test_directions_are_axes_of_the_orbital_frame() -> None:
    orbit, t_s, C_ON = Orbit(u0_deg=30.0), np.array([0.0, 1234.5, 1e5]), np.empty((3, 3))
    for t, nadir, velocity in zip(t_s, *directions(orbit, t_s), strict=True):
        orbit_axes(orbit.u_rad(float(t)), math.cos(orbit.tilt_rad), math.sin(orbit.tilt_rad), C_ON)
        np.testing.assert_allclose([velocity, nadir], C_ON[[0, 2]], rtol=0, atol=1e-14)


def test_products_and_inverses_are_those_of_scipy() -> None:
    p, q = (tuple(np.roll(r, 1)) for r in Rotation.random(2, random_state=1).as_quat())
    product = Rotation.from_quat(np.roll(p, -1)) * Rotation.from_quat(np.roll(q, -1))
    np.testing.assert_allclose(continued(times(p, q), np.roll(product.as_quat(), 1)), np.roll(product.as_quat(), 1))
    np.testing.assert_allclose(times(p, inverse(p)), (1, 0, 0, 0), atol=1e-15)


def test_a_log_without_an_orbit_has_that_of_paper_004() -> None:
    assert orbit_of({}) == Orbit()
    assert orbit_of({"plant": {"orbit": {"radius_m": 7e6, "unknown": 1}}}) == Orbit(radius_m=7e6)
