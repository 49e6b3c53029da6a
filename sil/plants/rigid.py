"""Rigid satellite with three reaction wheels along the body axes, or with thrusters, on a circular orbit.

State: q_BN (4, scalar first), omega_BN_B (3, rad/s), h (3, N m s, absolute wheel momentum about the body axes).

    q'   = 1/2 q (x) (0, w)                                  w = omega_BN_B
    J w' = T + T_dist + T_gg - w x (J w + h)                 J = I - Js if the inertia includes the wheels, else I
    h'   = -T (wheels), 0 (thrusters: T is from outside)     T = torque on the body, held by the caller
    T_gg = 3 w0^2 c3 x (I c3)                                c3 = nadir in body axes, w0 = sqrt(mu / radius^3)
    T_dist = constant + sum_i amplitude_i sin(2 pi t / period_i + phase_i)      body axes, t = simulation time

h starts at Js (Omega + w), Omega = wheel speed relative to the body; without wheel inertia it starts at 0 and is just
the integral of -T. With w x (J w + h) = w x (I w + Js Omega) this is the gyrostat of the usual textbooks.
Integration: RK4 with fixed step period / ceil(period / step_s); h is linear in time and therefore exact; the quaternion
is renormalised after each step. float64, no fast-math.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numba.extending import register_jitable

from sil import jit
from sil.rotations import body_rate_of_euler_rate, dcm_of_euler, dcm_of_q, euler_of_dcm, orbit_axes, q_of_dcm
from sil.signals import Motion, Vector

if TYPE_CHECKING:
    from sil.scenario import Scenario

MU_EARTH = 3.986004418e14  # m^3/s^2

# Layout of the parameter array that compiled code reads; the sines (5 numbers each) follow.
J, J_INV, I_GG, T_CONST, SINES = 0, 9, 18, 35, 38
GG, W0, COS_I, SIN_I, U0, FRAME_O, SEQUENCE, WHEELS = range(27, 35)
STATE = 10  # q 0-3, w 4-6, h 7-9


@dataclass(frozen=True)
class Sine:
    """One sinusoidal disturbance torque in body axes."""

    amplitude_Nm: tuple[float, float, float]
    period_s: float
    phase_deg: float = 0.0


@dataclass(frozen=True)
class Parameters:
    """What the rigid satellite needs to know, in the units of the names; defaults: satellite and orbit of paper 004."""

    inertia_kgm2: Vector = field(default_factory=lambda: np.diag([2.13, 3.04, 3.09]))  # (3,3)
    inertia_includes_wheels: bool = False
    wheels: bool = True  # they take up the torque; False: it is from outside, and h stays
    wheel_inertia_kgm2: Vector = field(default_factory=lambda: np.zeros(3))  # (3,) spin inertia, 0: momentum only
    wheel_speed_radps: Vector = field(default_factory=lambda: np.zeros(3))  # (3,) initial, relative to the body
    step_s: float = 0.05
    gravity_gradient: bool = True
    disturbance_Nm: Vector = field(default_factory=lambda: np.zeros(3))  # (3,) constant, body axes
    sines: tuple[Sine, ...] = ()
    orbit_radius_m: float = 6978137.0
    mu: float = MU_EARTH
    inclination_deg: float = 97.8
    u0_deg: float = 0.0
    initial_frame: str = "lvlh"  # lvlh | inertial: what attitude_deg, q and the rates are relative to
    attitude_deg: Vector = field(default_factory=lambda: np.zeros(3))
    q: Vector | None = None  # (4,) scalar first, instead of attitude_deg
    rate_kind: str = "euler"  # euler | body_relative | body_inertial
    rate_degps: Vector = field(default_factory=lambda: np.zeros(3))
    sequence: int = 321  # of attitude_deg and of Motion.euler_rad
    frame: str = "lvlh"  # of Motion.euler_rad and Motion.rate_rel

    @property
    def orbit_rate_radps(self) -> float:
        """w0 in rad/s; the orbital frame turns with omega_ON_O = [0, -w0, 0]."""
        return math.sqrt(self.mu / self.orbit_radius_m**3)


class Rigid:
    """The plant `rigid`; `state` is the array [q_BN, omega_BN_B, h] that advance() moves on."""

    def __init__(self, parameters: Parameters) -> None:
        self._step_s = parameters.step_s
        self._par = _pack(parameters)
        self.state = _initial_state(parameters)
        # Compile (or load) now, on a copy, so that the first tick takes no longer than the others.
        _advance(self.state.copy(), np.zeros(3), self._par, 0.0, 0.0, 1)
        self.motion(0)

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> Rigid:
        """The satellite a scenario describes."""
        return cls(parameters_of(scenario))

    def motion(self, t_ns: int) -> Motion:
        """Truth now; t_ns must be the instant the state was integrated to (it places the orbital frame)."""
        out = np.empty(STATE + 6)
        _motion(self.state, self._par, t_ns * 1e-9, out)
        return Motion(t_ns, out[0:4], out[4:7], out[7:10], out[10:13], out[13:16])

    def advance(self, torque_B: Vector, t_ns: int, period_ns: int) -> None:
        """From t_ns to t_ns + period_ns; `torque_B` (3,) N m on the body throughout; wheels get its negative."""
        period_s = period_ns * 1e-9
        steps = max(1, math.ceil(period_s / self._step_s * (1 - 1e-12)))
        _advance(self.state, torque_B, self._par, t_ns * 1e-9, period_s / steps, steps)


def parameters_of(scenario: Scenario) -> Parameters:
    """The sections plant, actuators and attitude as numbers."""
    plant, wheels, start = scenario.plant, scenario.actuators.wheels, scenario.plant.initial
    return Parameters(
        inertia_kgm2=np.array(plant.inertia_kgm2),
        inertia_includes_wheels=plant.inertia_includes_wheels,
        wheels=scenario.actuators.kind == "wheels",
        wheel_inertia_kgm2=np.array(wheels.inertia_kgm2),
        wheel_speed_radps=np.array(wheels.initial_speed_radps),
        step_s=plant.step_s,
        gravity_gradient=plant.gravity_gradient,
        disturbance_Nm=np.array(plant.disturbance_Nm.constant_Nm),
        sines=tuple(Sine(s.amplitude_Nm, s.period_s, s.phase_deg) for s in plant.disturbance_Nm.sine),
        orbit_radius_m=plant.orbit.radius_m,
        mu=plant.orbit.mu,
        inclination_deg=plant.orbit.inclination_deg,
        u0_deg=plant.orbit.u0_deg,
        initial_frame=start.frame,
        attitude_deg=np.array(start.attitude_deg),
        q=None if start.q is None else np.array(start.q),
        rate_kind=start.rate_kind,
        rate_degps=np.array(start.rate_degps),
        sequence=int(scenario.attitude.sequence),
        frame=scenario.attitude.frame,
    )


def _pack(p: Parameters) -> Vector:
    inertia = p.inertia_kgm2 - np.diag(p.wheel_inertia_kgm2) if p.inertia_includes_wheels else p.inertia_kgm2
    tilt, w0 = math.radians(p.inclination_deg), p.orbit_rate_radps
    head = np.zeros(SINES)
    head[J:J_INV], head[J_INV:I_GG] = inertia.ravel(), np.linalg.inv(inertia).ravel()
    head[I_GG:GG] = p.inertia_kgm2.ravel()
    head[GG], head[W0] = (3.0 * w0 * w0 if p.gravity_gradient else 0.0), w0
    head[COS_I], head[SIN_I], head[U0] = math.cos(tilt), math.sin(tilt), math.radians(p.u0_deg)
    head[FRAME_O], head[SEQUENCE] = float(p.frame == "lvlh"), p.sequence
    head[WHEELS] = float(p.wheels)
    head[T_CONST:SINES] = p.disturbance_Nm
    tail = [(*s.amplitude_Nm, 2.0 * math.pi / s.period_s, math.radians(s.phase_deg)) for s in p.sines]
    return np.concatenate([head, np.array(tail, dtype=np.float64).ravel()])


def _initial_state(p: Parameters) -> Vector:
    """[q_BN, omega_BN_B, h] at t = 0 from attitude and rates relative to `initial_frame` (R)."""
    C_RN, omega_RN_R = np.eye(3), np.zeros(3)
    if p.initial_frame == "lvlh":
        tilt = math.radians(p.inclination_deg)
        orbit_axes(math.radians(p.u0_deg), math.cos(tilt), math.sin(tilt), C_RN)
        omega_RN_R = np.array([0.0, -p.orbit_rate_radps, 0.0])
    C_BR, euler = np.empty((3, 3)), np.radians(p.attitude_deg)
    if p.q is None:
        C_BR = dcm_of_euler(euler, p.sequence)
    else:
        dcm_of_q(p.q / np.linalg.norm(p.q), C_BR)
        euler_of_dcm(C_BR, p.sequence, euler)
    rate = np.radians(p.rate_degps)
    if p.rate_kind == "euler":
        rate = body_rate_of_euler_rate(euler, rate, p.sequence)
    omega = rate if p.rate_kind == "body_inertial" else rate + C_BR @ omega_RN_R
    q_BN = p.q / np.linalg.norm(p.q) if p.q is not None and p.initial_frame == "inertial" else q_of_dcm(C_BR @ C_RN)
    return np.concatenate([q_BN, omega, p.wheel_inertia_kgm2 * (p.wheel_speed_radps + omega)])


@register_jitable
def _derivative(x: Vector, torque: Vector, par: Vector, t0: float, t: float, h0: Vector, out: Vector) -> None:
    """out (7,) <- [q', w'] at x = [q, w], t s after t0; h0 (3,) is the wheel momentum at t0."""
    s, qx, qy, qz, wx, wy, wz = x[0], x[1], x[2], x[3], x[4], x[5], x[6]
    out[0] = 0.5 * (-qx * wx - qy * wy - qz * wz)
    out[1] = 0.5 * (s * wx + qy * wz - qz * wy)
    out[2] = 0.5 * (s * wy + qz * wx - qx * wz)
    out[3] = 0.5 * (s * wz + qx * wy - qy * wx)
    taken = par[WHEELS]
    Hx = par[0] * wx + par[1] * wy + par[2] * wz + h0[0] - taken * torque[0] * t
    Hy = par[3] * wx + par[4] * wy + par[5] * wz + h0[1] - taken * torque[1] * t
    Hz = par[6] * wx + par[7] * wy + par[8] * wz + h0[2] - taken * torque[2] * t
    Tx = torque[0] + par[T_CONST] - (wy * Hz - wz * Hy)
    Ty = torque[1] + par[T_CONST + 1] - (wz * Hx - wx * Hz)
    Tz = torque[2] + par[T_CONST + 2] - (wx * Hy - wy * Hx)
    for i in range(SINES, par.shape[0], 5):
        wave = math.sin(par[i + 3] * (t0 + t) + par[i + 4])
        Tx += par[i] * wave
        Ty += par[i + 1] * wave
        Tz += par[i + 2] * wave
    if par[GG] != 0.0:
        u = par[U0] + par[W0] * (t0 + t)
        nx, ny, nz = -math.cos(u), -math.sin(u) * par[COS_I], -math.sin(u) * par[SIN_I]  # nadir in N
        cx = (s * s + qx * qx - qy * qy - qz * qz) * nx + 2.0 * ((qx * qy + s * qz) * ny + (qx * qz - s * qy) * nz)
        cy = (s * s - qx * qx + qy * qy - qz * qz) * ny + 2.0 * ((qx * qy - s * qz) * nx + (qy * qz + s * qx) * nz)
        cz = (s * s - qx * qx - qy * qy + qz * qz) * nz + 2.0 * ((qx * qz + s * qy) * nx + (qy * qz - s * qx) * ny)
        Ix = par[I_GG] * cx + par[I_GG + 1] * cy + par[I_GG + 2] * cz
        Iy = par[I_GG + 3] * cx + par[I_GG + 4] * cy + par[I_GG + 5] * cz
        Iz = par[I_GG + 6] * cx + par[I_GG + 7] * cy + par[I_GG + 8] * cz
        Tx += par[GG] * (cy * Iz - cz * Iy)
        Ty += par[GG] * (cz * Ix - cx * Iz)
        Tz += par[GG] * (cx * Iy - cy * Ix)
    for i in range(3):
        out[4 + i] = par[J_INV + 3 * i] * Tx + par[J_INV + 3 * i + 1] * Ty + par[J_INV + 3 * i + 2] * Tz


@jit.compile
def _advance(state: Vector, torque: Vector, par: Vector, t0: float, step: float, steps: int) -> None:
    """`steps` RK4 steps of `step` s in place; the momentum is start - torque * elapsed, so it carries no error."""
    x, k1, k2, k3, k4 = np.empty(7), np.empty(7), np.empty(7), np.empty(7), np.empty(7)
    h0 = state[7:10].copy()
    for n in range(steps):
        t = n * step
        _derivative(state, torque, par, t0, t, h0, k1)
        for i in range(7):
            x[i] = state[i] + 0.5 * step * k1[i]
        _derivative(x, torque, par, t0, t + 0.5 * step, h0, k2)
        for i in range(7):
            x[i] = state[i] + 0.5 * step * k2[i]
        _derivative(x, torque, par, t0, t + 0.5 * step, h0, k3)
        for i in range(7):
            x[i] = state[i] + step * k3[i]
        _derivative(x, torque, par, t0, t + step, h0, k4)
        for i in range(7):
            state[i] += step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        length = math.sqrt(state[0] ** 2 + state[1] ** 2 + state[2] ** 2 + state[3] ** 2)
        for i in range(4):
            state[i] /= length
    for i in range(3):
        state[7 + i] = h0[i] - par[WHEELS] * torque[i] * (steps * step)


@jit.compile
def _motion(state: Vector, par: Vector, t_s: float, out: Vector) -> None:
    """out (16,) <- q_BN, omega_BN_B, h, Euler angles, rate relative to the reference frame R."""
    for i in range(STATE):
        out[i] = state[i]
    C_BR = np.empty((3, 3))
    dcm_of_q(state, C_BR)
    if par[FRAME_O] != 0.0:
        C_BN, C_ON = C_BR.copy(), np.empty((3, 3))
        orbit_axes(par[U0] + par[W0] * t_s, par[COS_I], par[SIN_I], C_ON)
        for i in range(3):
            for j in range(3):
                C_BR[i, j] = C_BN[i, 0] * C_ON[j, 0] + C_BN[i, 1] * C_ON[j, 1] + C_BN[i, 2] * C_ON[j, 2]
    euler_of_dcm(C_BR, int(par[SEQUENCE]), out[10:13])
    for i in range(3):
        out[13 + i] = state[4 + i] + par[FRAME_O] * par[W0] * C_BR[i, 1]
