"""The observer of appc, both forms: propagated by its model, set right by torque that is known late, and by readings.

    propagate   alpha = FWD(y^, v^, (u(k-1) - Gamma) T_s^2 / I) + w^;  y^ += v^ + alpha/2;  v^ += alpha
                h^ -= u(k-1) T_s
    recover     at the first SAMPLE after m lost ones; each of m torques u(k-1), u(k-2) .. was a guess, the own command
                dU = (h^ - h(k)) / T_s        the sum of the torques that acted minus that of the guesses: h' = -u
                dv = FWD(y^, 0, dU T_s^2 / I);  v^ += dv;  y^ += m/2 dv;  u(k-1) += dU/m;  u(k-2) += dU/m if m > 1
    correct     e = y(k) - y^;  y^ += L1 e;  v^ += L2 e;  w^ += L3 e;  h^ = h(k)

With m = 1 dU is the error of the one guess; with more it is taken to be spread evenly over the gap.
Only differences of h count, so it does not matter where it started. A momentum at the end of its scale is not believed.
Torque that turns no wheel leaves no trace in h: where something else turns the body `recover_torque` has to be off.
The tables STATE and PAR of the law stand here; appc.py says what the letters mean.
Fixed form: y bam; v, w, accelerations turn36; u, h Q28; g Q28, P Q34.
"""

from __future__ import annotations

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.gyroscopic import gyro_fixed, gyro_float
from firmware_sim.controllers.kinematics import IntTriple, Triple, forward_fixed, forward_float, triple
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import add_sat, div_trunc, keep32, mul_q, sat32, shift_round, sub_sat, wrap32
from firmware_sim.guidance.reference import wrap_pi

STATE = (
    Field("y", 3, "turn", 32),
    Field("v", 3, "turn/sample", 36),
    Field("w", 3, "turn/sample^2", 36),
    Field("g", 3, "1", 28),
    Field("g_inverse", 3, "1", 28),
    Field("P", 3, "1", 34),
    Field("applied", 3, "N m", 28),
    Field("applied_before", 3, "N m", 28),
    Field("command", 3, "N m", 28),
    Field("reading", 3, "turn", 32),
    Field("reading_before", 3, "turn", 32),
    Field("innovation", 3, "turn", 32),
    Field("momentum", 3, "N m s", 28),
    Field("response", 9, "turn/sample^2", 36),
    Field("drive", 9, "turn/sample^2", 36),
    Field("steps", 1, "tick", 0),
    Field("gap", 1, "tick", 0),
    Field("restarted", 1, "", 0),
    Field("arithmetic", 1, "", 0),
)
(Y, V, W, G, G_INV, P, APPLIED, BEFORE, COMMAND, READING, READING_BEFORE, INNOVATION, H, RESPONSE, DRIVE, STEPS,
 GAP, RESTARTED, ARITHMETIC) = offsets(STATE)  # fmt: skip

# Parameters of both forms; mantissas and shifts of the fixed form as in kinematics.py.
PAR = (
    Field("ts", 1, "s", 30),
    Field("ts_inv", 1, "1/s", 28),
    Field("k1", 1, "1", 30),
    Field("k2", 1, "1", 30),
    Field("l1", 1, "1", 30),
    Field("l2", 1, "1", 30),
    Field("l3", 1, "1", 30),
    Field("adapt", 1, "", 0),
    Field("gyro", 1, "", 0),
    Field("recover", 1, "", 0),
    Field("orbit", 1, "turn/sample", 36),
    Field("torque_shift", 1, "bit", 0),
    Field("momentum_shift", 1, "bit", 0),
    Field("momentum_max", 1, "N m s", 28),
    Field("limit", 3, "N m", 28),
    Field("torque_of", 3, "N m Q28 per turn/sample^2 Q36", 0, shift="demand_shift"),
    Field("drive_of", 3, "turn/sample^2 Q36 per N m Q28", 0, shift="drive_shift"),
    Field("demand_shift", 3, "bit", 0),
    Field("drive_shift", 3, "bit", 0),
)
(TS, TS_INV, K1, K2, L1, L2, L3, ADAPT, GYRO, RECOVER, ORBIT, TORQUE_SHIFT, MOMENTUM_SHIFT, MOMENTUM_MAX, LIMIT,
 TORQUE_OF, DRIVE_OF, DEMAND_SHIFT, DRIVE_SHIFT) = offsets(PAR)  # fmt: skip


# -- float reference ---------------------------------------------------------------------------------------------------


@jit.callee
def acceleration_float(s: np.ndarray, par: np.ndarray) -> Triple:
    """alpha at (y^, v^) with the torque that acts now."""
    angles, rates = triple(s, Y), triple(s, V)
    gyro = (0.0, 0.0, 0.0)
    if par[GYRO] != 0.0:
        gyro = gyro_float(inertia_float(s, par), par[TS], par[ORBIT], angles, rates, triple(s, H))
    x = (s[APPLIED] - gyro[0]) * s[G] * par[DRIVE_OF]
    y = (s[APPLIED + 1] - gyro[1]) * s[G + 1] * par[DRIVE_OF + 1]
    z = (s[APPLIED + 2] - gyro[2]) * s[G + 2] * par[DRIVE_OF + 2]
    a = forward_float(angles, rates, (x, y, z))
    return a[0] + s[W], a[1] + s[W + 1], a[2] + s[W + 2]


@jit.callee
def inertia_float(s: np.ndarray, par: np.ndarray) -> Triple:
    """I / T_s^2."""
    return par[TORQUE_OF] / s[G], par[TORQUE_OF + 1] / s[G + 1], par[TORQUE_OF + 2] / s[G + 2]


@jit.callee
def propagate_float(s: np.ndarray, par: np.ndarray) -> None:
    alpha = acceleration_float(s, par)
    for i in range(3):
        s[Y + i] += s[V + i] + 0.5 * alpha[i]
        s[V + i] += alpha[i]
        s[H + i] -= s[APPLIED + i] * par[TS]
        s[INNOVATION + i] = 0.0
    s[GAP] = min(s[GAP] + 1.0, 1e6)


@jit.callee
def recover_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    """The prediction for t_k as it would be had the torque of the gap been known; GAP: ticks since a reading."""
    lost = s[GAP] - 1.0
    s[GAP] = 0.0
    if lost <= 0.0 or par[RECOVER] == 0.0 or inp[2] == 0.0:
        return
    x, y, z = _missed_float(s, par, inp, 0), _missed_float(s, par, inp, 1), _missed_float(s, par, inp, 2)
    body = (x * s[G] * par[DRIVE_OF], y * s[G + 1] * par[DRIVE_OF + 1], z * s[G + 2] * par[DRIVE_OF + 2])
    dv, torque = forward_float(triple(s, Y), (0.0, 0.0, 0.0), body), (x, y, z)
    for i in range(3):
        s[Y + i] += 0.5 * lost * dv[i]
        s[V + i] += dv[i]
        s[APPLIED + i] += torque[i] / lost
        if lost > 1.0:
            s[BEFORE + i] += torque[i] / lost


@jit.callee
def _missed_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, i: int) -> float:
    """dU of axis i, N m."""
    if abs(inp[16 + i]) >= par[MOMENTUM_MAX]:
        return 0.0
    missed: float = (s[H + i] - inp[16 + i]) * par[TS_INV]
    return missed


@jit.callee
def correct_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    for i in range(3):
        if s[STEPS] == 0.0:
            s[Y + i], s[READING + i], s[READING_BEFORE + i] = inp[3 + i], inp[3 + i], inp[3 + i]
        e = wrap_pi(inp[3 + i] - s[Y + i])
        s[INNOVATION + i] = e
        s[Y + i] += par[L1] * e
        s[V + i] += par[L2] * e
        s[W + i] += par[L3] * e
        s[H + i] = inp[16 + i]


# -- fixed form --------------------------------------------------------------------------------------------------------


@jit.callee
def drive_fixed(par: np.ndarray, i: int, torque: int) -> int:
    """Acceleration, turn36, of a torque Q28 on the inertia I0."""
    return sat32(mul_q(torque, par[DRIVE_OF + i], par[DRIVE_SHIFT + i]))


@jit.callee
def scale_fixed(s: np.ndarray, par: np.ndarray) -> IntTriple:
    """Per axis, torque Q28 of the inertia I0 / g = acceleration (turn36) times this 2^-DEMAND_SHIFT."""
    x, y = mul_q(par[TORQUE_OF], s[G_INV], 28), mul_q(par[TORQUE_OF + 1], s[G_INV + 1], 28)
    return x, y, mul_q(par[TORQUE_OF + 2], s[G_INV + 2], 28)


@jit.callee
def compensation_fixed(s: np.ndarray, par: np.ndarray, angles: IntTriple, rates: IntTriple, h: IntTriple) -> IntTriple:
    shift = triple(par, DEMAND_SHIFT)
    return gyro_fixed(scale_fixed(s, par), shift, par[TS], par[TS_INV], par[ORBIT], angles, rates, h)


@jit.callee
def acceleration_fixed(s: np.ndarray, par: np.ndarray) -> IntTriple:
    """alpha at (y^, v^) with the torque that acts now, turn36."""
    angles, rates = triple(s, Y), triple(s, V)
    gyro = (0, 0, 0)
    if par[GYRO] != 0:
        gyro = compensation_fixed(s, par, angles, rates, triple(s, H))
    x = sat32(mul_q(drive_fixed(par, 0, sub_sat(s[APPLIED], gyro[0])), s[G], 28))
    y = sat32(mul_q(drive_fixed(par, 1, sub_sat(s[APPLIED + 1], gyro[1])), s[G + 1], 28))
    z = sat32(mul_q(drive_fixed(par, 2, sub_sat(s[APPLIED + 2], gyro[2])), s[G + 2], 28))
    a = forward_fixed(angles, rates, (x, y, z))
    return add_sat(a[0], s[W]), add_sat(a[1], s[W + 1]), add_sat(a[2], s[W + 2])


@jit.callee
def moved_fixed(y: int, v: int, alpha: int) -> int:
    """y + v + alpha / 2: bam and turn36 to bam."""
    return wrap32(y + shift_round(shift_round(v, -1) + alpha, 5))


@jit.callee
def propagate_fixed(s: np.ndarray, par: np.ndarray) -> None:
    alpha = acceleration_fixed(s, par)
    for i in range(3):
        s[Y + i] = moved_fixed(s[Y + i], s[V + i], alpha[i])
        s[V + i] = keep32(s[V + i] + alpha[i], s, ARITHMETIC)
        s[H + i] = keep32(s[H + i] - mul_q(s[APPLIED + i], par[TS], 30), s, ARITHMETIC)
        s[INNOVATION + i] = 0
    s[GAP] = min(s[GAP] + 1, 1000000)


@jit.callee
def recover_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    """The prediction for t_k as it would be had the torque of the gap been known; GAP: ticks since a reading."""
    lost = s[GAP] - 1
    s[GAP] = 0
    if lost <= 0 or par[RECOVER] == 0 or inp[2] == 0:
        return
    torque = (_missed_fixed(s, par, inp, 0), _missed_fixed(s, par, inp, 1), _missed_fixed(s, par, inp, 2))
    x = sat32(mul_q(drive_fixed(par, 0, torque[0]), s[G], 28))
    y = sat32(mul_q(drive_fixed(par, 1, torque[1]), s[G + 1], 28))
    z = sat32(mul_q(drive_fixed(par, 2, torque[2]), s[G + 2], 28))
    dv = forward_fixed(triple(s, Y), (0, 0, 0), (x, y, z))
    for i in range(3):
        s[Y + i] = wrap32(s[Y + i] + mul_q(dv[i], lost, 5))
        s[V + i] = keep32(s[V + i] + dv[i], s, ARITHMETIC)
        share = div_trunc(torque[i], lost)
        s[APPLIED + i] = add_sat(s[APPLIED + i], share)
        if lost > 1:
            s[BEFORE + i] = add_sat(s[BEFORE + i], share)


@jit.callee
def _missed_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, i: int) -> int:
    """dU of axis i, Q28."""
    h = sat32(shift_round(inp[16 + i], par[MOMENTUM_SHIFT]))
    if h >= par[MOMENTUM_MAX] or h <= -par[MOMENTUM_MAX]:
        return 0
    return sat32(mul_q(sub_sat(s[H + i], h), par[TS_INV], 28))


@jit.callee
def correct_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    for i in range(3):
        if s[STEPS] == 0:
            s[Y + i], s[READING + i], s[READING_BEFORE + i] = inp[3 + i], inp[3 + i], inp[3 + i]
        e = wrap32(inp[3 + i] - s[Y + i])
        s[INNOVATION + i] = e
        s[Y + i] = wrap32(s[Y + i] + mul_q(par[L1], e, 30))
        s[V + i] = keep32(s[V + i] + mul_q(par[L2], e, 26), s, ARITHMETIC)
        s[W + i] = keep32(s[W + i] + mul_q(par[L3], e, 26), s, ARITHMETIC)
        s[H + i] = keep32(shift_round(inp[16 + i], par[MOMENTUM_SHIFT]), s, ARITHMETIC)
