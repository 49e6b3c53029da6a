"""appc: adaptive pole placement with an observer; nothing is cancelled, one filtered gain g per axis is identified.

Angles eta = [phi, theta, psi]; y^, v^, w^: attitude, rate per sample and disturbance (rad, rad/sample, rad/sample^2);
u(k): torque that acts from t_k on, u(k) = command(k-1) unless the laboratory reports otherwise; I = I0 / g;
FWD, INV: kinematics.py; Gamma: gyroscopic torque at the same instant, 0 without `gyro`. At tick k:

    1 observe   y^, v^, w^ propagated from t_(k-1) with u(k-1), then corrected by y(k)          (appc_observer.py)
    2 adapt     z = y(k) - 2 y(k-1) + y(k-2);  x = INV(y^(k-1), v^(k-1), z);  c = (u(k-1) + u(k-2)) T_s^2 / (2 I0)
                both filtered; g from x = c g by recursive least squares                                 (gain.py)
    3 predict   y', v' for t_(k+1) as in 1, with u(k)
    4 place     nu = am - K1 (y' - ym(k+1)) - K2 (v' - vm(k+1)) - w^;  command = clip(I INV(y', v', nu) / T_s^2 + Gamma)
    Gamma       gyroscopic.py; h = wheel momentum as reported, without a SAMPLE propagated by -u T_s

Start: four ticks of zero torque while the observer settles; the reference waits at y^ and then leaves from y^ + v^ with
rate v^, so the first command does not jump. Adaptation begins at tick 25. Where a reading is lost y^ stands in for it
in z and the filters go on, so that the noise in z still cancels; g rests until three readings in a row came. What acted
meanwhile is recovered from the wheels' momentum at the next SAMPLE.
Gains: K1 = (1-pc)^2, K2 = (1-pc)(3+pc)/2 (double pole pc); L = 1-po^3, 1.5 (1-po)^2 (1+po), (1-po)^3 (triple pole po).
Fixed form: y bam; v, w, accelerations turn36; u, h Q28; g Q28, P Q34; the regression in rad Q35.
Source: study of paper 004, section 3.1 (there: BEST). Transport delay: exactly one sample. Needs Euler angles.
"""

from __future__ import annotations

import math

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.appc_observer import (
    ADAPT,
    APPLIED,
    ARITHMETIC,
    BEFORE,
    COMMAND,
    DEMAND_SHIFT,
    DRIVE,
    DRIVE_OF,
    G_INV,
    GYRO,
    INNOVATION,
    K1,
    K2,
    LIMIT,
    ORBIT,
    PAR,
    READING,
    READING_BEFORE,
    RESPONSE,
    RESTARTED,
    STATE,
    STEPS,
    TORQUE_SHIFT,
    TS,
    G,
    H,
    P,
    V,
    W,
    Y,
    acceleration_fixed,
    acceleration_float,
    compensation_fixed,
    correct_fixed,
    correct_float,
    drive_fixed,
    inertia_float,
    moved_fixed,
    propagate_fixed,
    propagate_float,
    recover_fixed,
    recover_float,
    scale_fixed,
)
from firmware_sim.controllers.compiled import CompiledLaw, ranges_of, torque_limits_fixed
from firmware_sim.controllers.gain import (
    learn_fixed,
    learn_float,
    second_differences_fixed,
    second_differences_float,
    washed_fixed,
    washed_float,
)
from firmware_sim.controllers.gyroscopic import gyro_float
from firmware_sim.controllers.kinematics import (
    IntTriple,
    Triple,
    inverse_fixed,
    inverse_float,
    torque_scales_fixed,
    triple,
)
from firmware_sim.fixed import INT32_MAX, add_sat, clip, div_trunc, keep32, mul_q, sat32, shift_round, sub_sat, wrap32
from firmware_sim.guidance.reference import ACCEL, NEXT, RATE_NEXT, restart_fixed, restart_float, wrap_pi
from protocol.law_tables import AXES, Configuration
from protocol.laws.appc import APPC

START_STEPS = 4
LEARN_FROM = 25
STEPS_MAX = 1000000


# -- float reference ---------------------------------------------------------------------------------------------------


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick; par TORQUE_OF = I0 / T_s^2, DRIVE_OF = T_s^2 / I0."""
    out[0], out[1], out[2], out[3], s[RESTARTED] = 0.0, 0.0, 0.0, 0.0, 0.0
    fresh = inp[0] != 0.0
    if s[STEPS] == 0.0 and not fresh:
        out[3] = 32.0
        return
    angles, rates = triple(s, Y), triple(s, V)
    if s[STEPS] > 0.0:
        propagate_float(s, par)
    if fresh:
        recover_float(s, par, inp)
        correct_float(s, par, inp)
    seen = triple(inp, 3) if fresh else triple(s, Y)
    if par[ADAPT] != 0.0:
        learn = fresh and inp[1] >= min(3.0, s[STEPS] + 1.0)
        if not learn:
            out[3] += 4.0
        _adapt_float(s, par, seen, angles, rates, learn)
    for i in range(3):
        s[BEFORE + i] = s[APPLIED + i]
        s[APPLIED + i] = inp[13 + i] if inp[2] != 0.0 else s[COMMAND + i]
        s[READING_BEFORE + i], s[READING + i] = s[READING + i], seen[i]
    if s[STEPS] < START_STEPS:
        last = s[STEPS] == START_STEPS - 1
        for i in range(3):
            restart_float(ref, i, s[Y + i] + (s[V + i] if last else 0.0), s[V + i] if last else 0.0)
            s[COMMAND + i] = 0.0
        s[RESTARTED] = 1.0
        out[3] += 32.0
    else:
        _place_float(s, par, ref, out)
    s[STEPS] = min(s[STEPS] + 1.0, 1e6)


@jit.callee
def _adapt_float(s: np.ndarray, par: np.ndarray, seen: Triple, angles: Triple, rates: Triple, learn: bool) -> None:
    z = second_differences_float(seen, triple(s, READING), triple(s, READING_BEFORE))
    response = inverse_float(angles, rates, z)
    for i in range(3):
        x = washed_float(s, RESPONSE, i, response[i])
        c = washed_float(s, DRIVE, i, 0.5 * (s[APPLIED + i] + s[BEFORE + i]) * par[DRIVE_OF + i])
        if learn and s[STEPS] >= LEARN_FROM:
            s[G + i], s[P + i] = learn_float(s[G + i], s[P + i], x, c)


@jit.callee
def _place_float(s: np.ndarray, par: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    alpha = acceleration_float(s, par)
    angles = (s[Y] + s[V] + 0.5 * alpha[0], s[Y + 1] + s[V + 1] + 0.5 * alpha[1], s[Y + 2] + s[V + 2] + 0.5 * alpha[2])
    rates = (s[V] + alpha[0], s[V + 1] + alpha[1], s[V + 2] + alpha[2])
    for i in range(3):
        e = wrap_pi(angles[i] - ref[NEXT + i])
        out[i] = ref[ACCEL + i] - par[K1] * e - par[K2] * (rates[i] - ref[RATE_NEXT + i]) - s[W + i]
    body, inertia = inverse_float(angles, rates, triple(out, 0)), inertia_float(s, par)
    gyro = (0.0, 0.0, 0.0)
    if par[GYRO] != 0.0:
        ts = par[TS]
        h = (s[H] - s[APPLIED] * ts, s[H + 1] - s[APPLIED + 1] * ts, s[H + 2] - s[APPLIED + 2] * ts)
        gyro = gyro_float(inertia, ts, par[ORBIT], angles, rates, h)
    saturated = 0.0
    for i in range(3):
        u = body[i] * inertia[i] + gyro[i]
        out[i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
        s[COMMAND + i] = out[i]
        if out[i] != u:
            saturated = 1.0
    out[3] += saturated


# -- fixed form --------------------------------------------------------------------------------------------------------


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    out[0], out[1], out[2], out[3], s[RESTARTED], s[ARITHMETIC] = 0, 0, 0, 0, 0, 0
    fresh = inp[0] != 0
    if s[STEPS] == 0 and not fresh:
        out[3] = 32
        return
    angles, rates = triple(s, Y), triple(s, V)
    if s[STEPS] > 0:
        propagate_fixed(s, par)
    if fresh:
        recover_fixed(s, par, inp)
        correct_fixed(s, par, inp)
    seen = triple(inp, 3) if fresh else triple(s, Y)
    if par[ADAPT] != 0:
        learn = fresh and inp[1] >= min(3, s[STEPS] + 1)
        if not learn:
            out[3] = 4
        _adapt_fixed(s, par, seen, angles, rates, learn)
    for i in range(3):
        s[BEFORE + i] = s[APPLIED + i]
        s[APPLIED + i] = sat32(shift_round(inp[13 + i], par[TORQUE_SHIFT])) if inp[2] != 0 else s[COMMAND + i]
        s[READING_BEFORE + i], s[READING + i] = s[READING + i], seen[i]
    if s[STEPS] < START_STEPS:
        last = s[STEPS] == START_STEPS - 1
        for i in range(3):
            rate = s[V + i] if last else 0
            restart_fixed(ref, i, wrap32(s[Y + i] + shift_round(rate, 4)), rate)
            s[COMMAND + i] = 0
        s[RESTARTED] = 1
        out[3] += 32
    else:
        _place_fixed(s, par, ref, out)
    if s[ARITHMETIC] != 0:
        out[3] += 8
    s[STEPS] = min(s[STEPS] + 1, STEPS_MAX)


@jit.callee
def _adapt_fixed(
    s: np.ndarray, par: np.ndarray, seen: IntTriple, angles: IntTriple, rates: IntTriple, learn: bool
) -> None:
    z = second_differences_fixed(seen, triple(s, READING), triple(s, READING_BEFORE))
    response = inverse_fixed(angles, rates, z)
    for i in range(3):
        drive = drive_fixed(par, i, s[APPLIED + i]) + drive_fixed(par, i, s[BEFORE + i])
        x = washed_fixed(s, RESPONSE, i, response[i])
        c = washed_fixed(s, DRIVE, i, shift_round(drive, 1))
        if learn and s[STEPS] >= LEARN_FROM:
            s[G + i], s[P + i] = learn_fixed(s[G + i], s[P + i], x, c)
            s[G_INV + i] = div_trunc(1 << 56, s[G + i])


@jit.callee
def _place_fixed(s: np.ndarray, par: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    alpha = acceleration_fixed(s, par)
    angles = (
        moved_fixed(s[Y], s[V], alpha[0]),
        moved_fixed(s[Y + 1], s[V + 1], alpha[1]),
        moved_fixed(s[Y + 2], s[V + 2], alpha[2]),
    )
    rates = (add_sat(s[V], alpha[0]), add_sat(s[V + 1], alpha[1]), add_sat(s[V + 2], alpha[2]))
    for i in range(3):
        e = mul_q(par[K1], wrap32(angles[i] - ref[NEXT + i]), 26)
        f = mul_q(par[K2], sub_sat(rates[i], ref[RATE_NEXT + i]), 30)
        out[i] = keep32(ref[ACCEL + i] - e - f - s[W + i], s, ARITHMETIC)
    body, scale = inverse_fixed(angles, rates, triple(out, 0)), scale_fixed(s, par)
    gyro = (0, 0, 0)
    if par[GYRO] != 0:
        hx = sat32(s[H] - mul_q(s[APPLIED], par[TS], 30))
        hy = sat32(s[H + 1] - mul_q(s[APPLIED + 1], par[TS], 30))
        hz = sat32(s[H + 2] - mul_q(s[APPLIED + 2], par[TS], 30))
        gyro = compensation_fixed(s, par, angles, rates, (hx, hy, hz))
    saturated = 0
    for i in range(3):
        u = keep32(mul_q(body[i], scale[i], par[DEMAND_SHIFT + i]) + gyro[i], s, ARITHMETIC)
        s[COMMAND + i] = clip(u, -par[LIMIT + i], par[LIMIT + i])
        if s[COMMAND + i] != u:
            saturated = 1
        out[i] = sat32(shift_round(s[COMMAND + i], -par[TORQUE_SHIFT]))
    out[3] += saturated


# -- the law as the board sees it --------------------------------------------------------------------------------------


class Appc(CompiledLaw):
    """The law `appc` in the form of the configuration."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(APPC.telemetry)
    WORDS = tuple(
        (field + i, lsb)
        for field, lsb in ((G, 2.0**-28), (P, 2.0**-34), (INNOVATION, math.pi / 2**31), (W, math.pi / 2**35))
        for i in range(3)
    )
    functions = (step_float, step_fixed)
    compiled = (jit.compile(step_float), jit.compile(step_fixed))

    @property
    def reference_restarted(self) -> bool:
        return bool(self.state[RESTARTED])

    def initialise(self, state: np.ndarray) -> None:
        one, p = (1.0, 0.1) if self.is_float else (1 << 28, 1717986918)
        state[G : G + 3] = state[G_INV : G_INV + 3] = one
        state[P : P + 3] = p

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v = configuration.values
        pc, po, ts = v["controller_pole"], v["observer_pole"], v["period_us"] * 1e-6
        gains = [(1 - pc) ** 2, (1 - pc) * (3 + pc) / 2, 1 - po**3, 1.5 * (1 - po) ** 2 * (1 + po), (1 - po) ** 3]
        inertia = configuration.vector("inertia_kgm2")
        par = [ts, 1 / ts, *gains, v["adapt"], v["gyro"], v["recover_torque"], v["orbit_rate_radps"] * ts, 0.0, 0.0]
        par += [INT32_MAX * 2.0 ** -v["momentum_bits"], *configuration.vector("torque_limit")]
        return [*par, *(i / ts**2 for i in inertia), *(ts**2 / i for i in inertia)] + [0.0] * 6

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p = configuration.common, configuration.params
        period_us, one = common["period_us"], 1 << 30
        ts, ts_inv = div_trunc(shift_round(period_us, -30), 1000000), div_trunc(1000000 << 28, period_us)
        pc, qc, qo = p["controller_pole"], one - p["controller_pole"], one - p["observer_pole"]
        qo2, po3 = mul_q(qo, qo, 30), mul_q(mul_q(p["observer_pole"], p["observer_pole"], 30), p["observer_pole"], 30)
        l2 = mul_q(mul_q(qo2, one + p["observer_pole"], 30), 3, 1)
        gains = [mul_q(qc, qc, 30), mul_q(qc, pc + (3 << 30), 31), one - po3, l2, mul_q(qo2, qo, 30)]
        orbit = mul_q(mul_q(p["orbit_rate_radps"], ts, 32), 2734261102, 34)
        flags = [p["adapt"], p["gyro"], p["recover_torque"]]
        shifts = [common["torque_bits"] - 28, common["momentum_bits"] - 28]
        limits = [sat32(shift_round(INT32_MAX, shifts[1])), *torque_limits_fixed(common)]
        scales = torque_scales_fixed(period_us, [p[f"inertia_kgm2_{axis}"] for axis in AXES])
        return [ts, ts_inv, *gains, *flags, orbit, *shifts, *limits, *scales]
