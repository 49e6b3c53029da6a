"""Gyroscopic torque of a satellite with wheels, as a law compensates it: both terms of the Euler equation, or neither.

    Gamma = w x (I w + h) - I (Omega x w_O),  w = Omega + w_O,  w_O = C_BO [0, -w0, 0]

Omega = body rate relative to the orbit (from Euler angles and rates), h = wheel momentum. With w x h alone, or without
the turn of the orbital frame, the two large parts that cancel in a satellite at rest would not cancel.
Float: rates rad/sample; fixed: turn36, torque and momentum Q28. Source: study of paper 004, section 3.1.
"""

from __future__ import annotations

import math

from firmware_sim.controllers.kinematics import IntTriple, Triple, rad_fixed
from firmware_sim.fixed import add_sat, cos_q, mul_q, sat32, sin_q
from firmware_sim.jit import callee


@callee
def gyro_float(inertia: Triple, ts: float, orbit: float, angles: Triple, rates: Triple, h: Triple) -> Triple:
    """Gamma, N m; inertia / T_s^2, T_s in s, w0 in rad/sample, angles rad, Euler rates rad/sample, h N m s."""
    om, wo = body_float(angles, rates), orbit_float(angles, orbit)
    wx, wy, wz = om[0] + wo[0], om[1] + wo[1], om[2] + wo[2]
    lx, ly, lz = inertia[0] * wx + h[0] / ts, inertia[1] * wy + h[1] / ts, inertia[2] * wz + h[2] / ts
    x = wy * lz - wz * ly - inertia[0] * (om[1] * wo[2] - om[2] * wo[1])
    y = wz * lx - wx * lz - inertia[1] * (om[2] * wo[0] - om[0] * wo[2])
    z = wx * ly - wy * lx - inertia[2] * (om[0] * wo[1] - om[1] * wo[0])
    return x, y, z


@callee
def body_float(angles: Triple, v: Triple) -> Triple:
    """Body rate, rad/sample, of the Euler rates v."""
    sf, cf, st, ct = math.sin(angles[0]), math.cos(angles[0]), math.sin(angles[1]), math.cos(angles[1])
    return v[0] - v[2] * st, v[1] * cf + v[2] * sf * ct, v[2] * cf * ct - v[1] * sf


@callee
def orbit_float(angles: Triple, rate: float) -> Triple:
    """Rate of the orbital frame in body axes, C_BO [0, -rate, 0]."""
    sf, cf, st = math.sin(angles[0]), math.cos(angles[0]), math.sin(angles[1])
    ct, sp, cp = math.cos(angles[1]), math.sin(angles[2]), math.cos(angles[2])
    return -rate * ct * sp, -rate * (sf * st * sp + cf * cp), -rate * (cf * st * sp - sf * cp)


@callee
def gyro_fixed(
    scale: IntTriple,
    shift: IntTriple,
    ts: int,
    ts_inv: int,
    orbit: int,
    angles: IntTriple,
    rates: IntTriple,
    h: IntTriple,
) -> IntTriple:
    """Gamma, N m Q28; torque = acceleration scale 2^-shift; T_s Q30, 1/T_s Q28, w0 turn36, h Q28."""
    om, wo = body_fixed(angles, rates), orbit_fixed(angles, orbit)
    wx, wy, wz = add_sat(om[0], wo[0]), add_sat(om[1], wo[1]), add_sat(om[2], wo[2])
    lx = add_sat(mul_q(sat32(mul_q(wx, scale[0], shift[0])), ts, 30), h[0])
    ly = add_sat(mul_q(sat32(mul_q(wy, scale[1], shift[1])), ts, 30), h[1])
    lz = add_sat(mul_q(sat32(mul_q(wz, scale[2], shift[2])), ts, 30), h[2])
    r, o = (rad_fixed(wx), rad_fixed(wy), rad_fixed(wz)), (rad_fixed(wo[0]), rad_fixed(wo[1]), rad_fixed(wo[2]))
    x = mul_q(sat32(mul_q(r[1], lz, 30) - mul_q(r[2], ly, 30)), ts_inv, 28)
    y = mul_q(sat32(mul_q(r[2], lx, 30) - mul_q(r[0], lz, 30)), ts_inv, 28)
    z = mul_q(sat32(mul_q(r[0], ly, 30) - mul_q(r[1], lx, 30)), ts_inv, 28)
    x -= mul_q(sat32(mul_q(om[1], o[2], 30) - mul_q(om[2], o[1], 30)), scale[0], shift[0])
    y -= mul_q(sat32(mul_q(om[2], o[0], 30) - mul_q(om[0], o[2], 30)), scale[1], shift[1])
    z -= mul_q(sat32(mul_q(om[0], o[1], 30) - mul_q(om[1], o[0], 30)), scale[2], shift[2])
    return sat32(x), sat32(y), sat32(z)


@callee
def body_fixed(angles: IntTriple, v: IntTriple) -> IntTriple:
    """Body rate, turn36, of the Euler rates v, turn36."""
    sf, cf, st, ct = sin_q(angles[0]), cos_q(angles[0]), sin_q(angles[1]), cos_q(angles[1])
    v3_ct = mul_q(v[2], ct, 30)
    y = sat32(mul_q(v[1], cf, 30) + mul_q(v3_ct, sf, 30))
    z = sat32(mul_q(v3_ct, cf, 30) - mul_q(v[1], sf, 30))
    return sat32(v[0] - mul_q(v[2], st, 30)), y, z


@callee
def orbit_fixed(angles: IntTriple, rate: int) -> IntTriple:
    """Rate of the orbital frame in body axes, turn36; rate turn36."""
    sf, cf, st = sin_q(angles[0]), cos_q(angles[0]), sin_q(angles[1])
    ct, sp, cp = cos_q(angles[1]), sin_q(angles[2]), cos_q(angles[2])
    st_sp = mul_q(st, sp, 30)
    x, y, z = mul_q(ct, sp, 30), mul_q(sf, st_sp, 30) + mul_q(cf, cp, 30), mul_q(cf, st_sp, 30) - mul_q(sf, cp, 30)
    return -mul_q(rate, x, 30), -mul_q(rate, y, 30), -mul_q(rate, z, 30)
