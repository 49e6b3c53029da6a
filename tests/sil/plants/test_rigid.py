"""The rigid plant against its own physics: conservation laws, linearised frequencies, another integrator, its order."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from sil.plants.rigid import Parameters, Rigid, Sine
from sil.signals import Vector

SECOND = 1_000_000_000
FULL_INERTIA = np.array([[2.13, 0.05, -0.02], [0.05, 3.04, 0.11], [-0.02, 0.11, 3.09]])
TUMBLING = Parameters(
    inertia_kgm2=FULL_INERTIA,
    inertia_includes_wheels=True,
    wheel_inertia_kgm2=np.array([0.002, 0.003, 0.001]),
    wheel_speed_radps=np.array([50.0, -30.0, 20.0]),
    gravity_gradient=False,
    attitude_deg=np.array([20.0, -35.0, 50.0]),
    rate_kind="body_inertial",
    rate_degps=np.array([3.0, -2.0, 1.5]),
    step_s=0.01,
)


def fly(parameters: Parameters, duration_s: float, torque_B: Vector | None = None, period_s: float = 0.5) -> Rigid:
    plant, period_ns = Rigid(parameters), round(period_s * SECOND)
    for k in range(round(duration_s / period_s)):
        plant.advance(np.zeros(3) if torque_B is None else torque_B, k * period_ns, period_ns)
    return plant


def rotation_of(q: Vector) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


def total_momentum_N(plant: Rigid, parameters: Parameters) -> Vector:
    J = parameters.inertia_kgm2 - np.diag(parameters.wheel_inertia_kgm2)
    momentum: Vector = rotation_of(plant.state[:4]).apply(J @ plant.state[4:7] + plant.state[7:10])
    return momentum


@pytest.mark.parametrize("torque", [np.zeros(3), np.array([1e-3, -2e-3, 5e-4])])
def test_wheels_cannot_change_the_total_momentum(torque: Vector) -> None:
    """Wheel torques are internal: J w + h in inertial axes stays, whatever they do."""
    start = total_momentum_N(Rigid(TUMBLING), TUMBLING)
    end = total_momentum_N(fly(TUMBLING, 300.0, torque), TUMBLING)
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-12)


def test_rotational_energy_stays_without_torque() -> None:
    J = FULL_INERTIA - np.diag(TUMBLING.wheel_inertia_kgm2)
    start, end = (state[4:7] for state in (Rigid(TUMBLING).state, fly(TUMBLING, 300.0).state))
    assert end @ J @ end == pytest.approx(start @ J @ start, rel=1e-11)


def test_wheel_momentum_is_minus_the_integral_of_the_torque() -> None:
    torque = np.array([1e-3, -2e-3, 5e-4])
    plant = fly(TUMBLING, 100.0, torque)
    np.testing.assert_allclose(plant.state[7:10], Rigid(TUMBLING).state[7:10] - 100.0 * torque, rtol=0, atol=1e-14)


def test_axisymmetric_body_precesses_at_the_known_rate() -> None:
    """Torque-free, I = (A, A, C): w_x + i w_y turns at (C - A) / A * w_z."""
    body = Parameters(
        inertia_kgm2=np.diag([2.0, 2.0, 3.0]), gravity_gradient=False, rate_kind="body_inertial",
        rate_degps=np.array([1.0, 0.0, 5.0]), step_s=0.01,
    )  # fmt: skip
    w = fly(body, 100.0).state[4:7]
    turned = 0.5 * math.radians(5.0) * 100.0
    expected = math.radians(1.0) * np.array([math.cos(turned), math.sin(turned)])
    np.testing.assert_allclose(w[:2], expected, rtol=0, atol=1e-10)


def test_orbital_frame_is_an_equilibrium() -> None:
    """Principal axes along the orbital frame, Euler rates zero: gravity gradient and gyroscopic torque balance."""
    still = Parameters(inertia_kgm2=np.diag([4.0, 5.0, 2.0]), step_s=1.0)
    motion = fly(still, 6000.0, period_s=10.0).motion(6000 * SECOND)
    assert np.abs(motion.euler_rad).max() < 1e-9
    assert np.abs(motion.rate_rel).max() < 1e-12


@pytest.mark.parametrize(
    ("axis", "factor", "pair"), [(0, 4.0, (1, 2)), (1, 3.0, (0, 2)), (2, 1.0, (1, 0))], ids=["roll", "pitch", "yaw"]
)
def test_small_angles_feel_the_linearised_torque_of_the_paper(axis: int, factor: float, pair: tuple[int, int]) -> None:
    """T_x = I_x phi'' + 4 w0^2 (I_y - I_z) phi; pitch 3 w0^2 (I_x - I_z); yaw w0^2 (I_y - I_x)."""
    inertia = np.array([2.13, 3.04, 3.09])
    attitude, w0 = np.zeros(3), Parameters().orbit_rate_radps
    attitude[axis] = 0.01
    plant = Rigid(Parameters(inertia_kgm2=np.diag(inertia), attitude_deg=attitude, step_s=0.1))
    plant.advance(np.zeros(3), 0, 10 * SECOND)
    moved = plant.motion(10 * SECOND).euler_rad[axis] - math.radians(0.01)
    expected = -factor * w0**2 * (inertia[pair[0]] - inertia[pair[1]]) / inertia[axis] * math.radians(0.01)
    assert moved * 2.0 / 10.0**2 == pytest.approx(expected, rel=1e-3)


def test_pitch_libration_period() -> None:
    """theta'' = -3 w0^2 (I_x - I_z) / I_y theta: zero after a quarter period, -theta0 after half."""
    body = Parameters(inertia_kgm2=np.diag([4.0, 5.0, 2.0]), attitude_deg=np.array([0.0, 0.01, 0.0]), step_s=1.0)
    period_s = 2.0 * math.pi / (body.orbit_rate_radps * math.sqrt(3.0 * 2.0 / 5.0))
    plant, half_ns = Rigid(body), round(period_s / 2 * SECOND)
    plant.advance(np.zeros(3), 0, half_ns // 2)
    assert abs(plant.motion(half_ns // 2).euler_rad[1]) < 1e-9
    plant.advance(np.zeros(3), half_ns // 2, half_ns - half_ns // 2)
    assert plant.motion(half_ns).euler_rad[1] == pytest.approx(-math.radians(0.01), rel=1e-6)


def test_error_falls_with_the_fourth_power_of_the_step() -> None:
    """Free tumble, fast enough for the truncation error to stand out."""
    fast = replace(TUMBLING, rate_degps=np.array([30.0, -20.0, 15.0]))
    truth = fly(replace(fast, step_s=0.0025), 20.0).state
    errors = [np.abs(fly(replace(fast, step_s=step), 20.0).state - truth).max() for step in (0.1, 0.05, 0.025)]
    for coarse, fine in pairwise(errors):
        assert 14.0 < coarse / fine < 18.0


def test_agrees_with_another_integrator_sample_by_sample() -> None:
    """Everything switched on, against DOP853 on another form of the equations (I w + Js Omega, positions in N)."""
    p = replace(
        TUMBLING, gravity_gradient=True, u0_deg=40.0, inclination_deg=50.0,
        disturbance_Nm=np.array([1e-4, -2e-4, 3e-4]),
        sines=(Sine((1e-3, 0.0, -2e-3), 90.0, 30.0), Sine((0.0, 5e-4, 0.0), 7.0)),
    )  # fmt: skip
    Js, J = np.diag(p.wheel_inertia_kgm2), p.inertia_kgm2 - np.diag(p.wheel_inertia_kgm2)
    node, tilt = np.array([1.0, 0.0, 0.0]), math.radians(p.inclination_deg)
    ahead = np.array([0.0, math.cos(tilt), math.sin(tilt)])

    def rates(t: float, x: Vector, torque: Vector) -> Vector:
        q, w, speed = x[:4], x[4:7], x[7:10]
        u = math.radians(p.u0_deg) + p.orbit_rate_radps * t
        r_B = rotation_of(q).inv().apply(p.orbit_radius_m * (math.cos(u) * node + math.sin(u) * ahead))
        gravity = 3.0 * p.mu / p.orbit_radius_m**5 * np.cross(r_B, p.inertia_kgm2 @ r_B)
        outside = p.disturbance_Nm + gravity
        for sine in p.sines:
            phase = 2.0 * math.pi * t / sine.period_s + math.radians(sine.phase_deg)
            outside = outside + np.array(sine.amplitude_Nm) * math.sin(phase)
        turn = -np.cross(w, p.inertia_kgm2 @ w + Js @ speed)
        dw = np.linalg.solve(J, turn + torque + outside)
        dq = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        return np.concatenate([dq, dw, np.linalg.solve(Js, -torque) - dw])

    plant, generator = Rigid(p), np.random.default_rng(4)
    start = plant.state
    x = np.concatenate([start[:7], start[7:10] / p.wheel_inertia_kgm2 - start[4:7]])
    for k in range(60):
        torque = generator.uniform(-5e-3, 5e-3, 3)
        plant.advance(torque, k * SECOND // 2, SECOND // 2)
        x = solve_ivp(rates, (0.5 * k, 0.5 * k + 0.5), x, "DOP853", rtol=1e-12, atol=1e-13, args=(torque,)).y[:, -1]
        np.testing.assert_allclose(plant.state[:7], x[:7], rtol=0, atol=2e-11)
        np.testing.assert_allclose(plant.state[7:10], p.wheel_inertia_kgm2 * (x[7:10] + x[4:7]), rtol=0, atol=1e-11)


@pytest.mark.parametrize("sequence", [321, 123])
@pytest.mark.parametrize("frame", ["lvlh", "inertial"])
def test_initial_attitude_and_euler_rates_come_back(sequence: int, frame: str) -> None:
    attitude, rate = np.array([10.0, -20.0, 130.0]), np.array([0.3, -0.2, 0.5])
    p = Parameters(
        attitude_deg=attitude, rate_degps=rate, initial_frame=frame, frame=frame, sequence=sequence, u0_deg=77.0
    )
    plant = Rigid(p)
    np.testing.assert_allclose(np.degrees(plant.motion(0).euler_rad), attitude, rtol=0, atol=1e-12)
    plant.advance(np.zeros(3), 0, SECOND // 1000)
    moved = np.degrees(plant.motion(SECOND // 1000).euler_rad) - attitude
    np.testing.assert_allclose(moved / 1e-3, rate, rtol=0, atol=1e-4)


@pytest.mark.parametrize("kind", ["body_relative", "body_inertial"])
def test_initial_body_rates(kind: str) -> None:
    rate = np.array([0.3, -0.2, 0.5])
    motion = Rigid(Parameters(attitude_deg=np.array([5.0, 6.0, 7.0]), rate_kind=kind, rate_degps=rate)).motion(0)
    found = motion.rate_rel if kind == "body_relative" else motion.omega_BN_B
    np.testing.assert_allclose(np.degrees(found), rate, rtol=0, atol=1e-14)
    assert not np.allclose(motion.rate_rel, motion.omega_BN_B, atol=1e-4)


def test_initial_quaternion_is_relative_to_its_frame() -> None:
    q = np.array([0.5, -0.5, 0.5, 0.5])
    inertial = Rigid(Parameters(q=q, initial_frame="inertial")).motion(0)
    np.testing.assert_allclose(inertial.q_BN, q, atol=1e-15)
    orbital = Rigid(Parameters(q=np.array([1.0, 0.0, 0.0, 0.0]), u0_deg=33.0)).motion(0)
    np.testing.assert_allclose(orbital.euler_rad, 0.0, atol=1e-15)


def test_step_is_lowered_to_a_whole_fraction_of_the_period() -> None:
    """0.3 s into a period of 0.5 s gives two steps of 0.25 s."""
    odd, even = (fly(replace(TUMBLING, step_s=step), 5.0).state for step in (0.3, 0.25))
    np.testing.assert_array_equal(odd, even)
