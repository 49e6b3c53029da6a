"""mrac: the unified law of Landau and Lozano with least squares, per axis, as printed (d = 1) or repaired (d = 2).

Model y(k) = phi theta, theta = [a1 a2 b0 b1 d]; v(k): input that acts from t_k on; C2 = 1 + c1 q^-1 + c2 q^-2 =
(1 - c2_pole q^-1)^2; ym: reference with lead d. Measured y are unwrapped, ym is taken next to y. At tick k:

    identify    phi = [-y(k-1) -y(k-2) v(k-1) v(k-2) 1];  e = y(k) - phi theta;  rls.py;  b0 is limited
    printed     u = [C2 ym(k+1) - t0 y(k) - t1 y(k-1) - b1 u(k-1) - d] / b0,  t0 = c1 - a1,  t1 = c2 - a2
                and phi has u(k-1), u(k-2), the law's own commands: it takes them for what acted
    repaired    u = [C2 ym(k+2) - t0 y(k) - t1 y(k-1) - (b1c + b0c s1) v(k) - b1c s1 v(k-1) - (1 + s1) d] / b0c
                s1 = c1 - a1,  t0 = c2 - a2 - a1 s1,  t1 = -a2 s1,  b0c = (b0 + b1)/(1 + kappa),  b1c = kappa b0c
                v(k) = u(k-1), or what the laboratory reports as applied; the zero at -1 is not cancelled, but -kappa
    decouple    u is taken for I0 times an Euler acceleration; command = I0 INV(eta, rate, u / I0), eta = (ym(k+1) +
                ym(k+2))/2, rate = ym(k+2) - ym(k+1); all three are scaled when one is at its limit; v = I0 FWD(applied)

Without a reading y(k) = phi theta, and nothing is identified. theta starts at [-2 1 b b 0], b = T_s^2 / (2 I0), with b0
kept in [b/2, 2b]; printed: b0, b1 as printed, b0 >= 0.01. Identification starts at the fourth tick (then all of phi is
measured) and after a loss with the third reading in a row.
Fixed form: y rad Q28 (limited to +-8 rad), u, theta, G Q28, F Q20, F phi Q40.
Source: paper 004, eqs. of the unified method; study of paper 004, sections 1, 3.2 and 4 (there: MIN, MID).
"""

from __future__ import annotations

import math

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.compiled import (
    CompiledLaw,
    LawRefuses,
    ranges_of,
    torque_limits_fixed,
    word_of,
)
from firmware_sim.controllers.kinematics import (
    forward_fixed,
    forward_float,
    inverse_fixed,
    inverse_float,
    torque_scales_fixed,
    triple,
)
from firmware_sim.controllers.rls import identify_fixed, identify_float
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import INT32_MAX, clip, div_trunc, keep32, mul_q, sat32, shift_round, wrap32
from firmware_sim.guidance.reference import AHEAD, NEXT, NOW, PAST
from protocol.law_tables import AXES, Configuration
from protocol.laws.mrac import DESIGN_PRINTED, MRAC

STATE = (
    Field("theta", 15, "rad, N m", 28),
    Field("F", 75, "1", 20),
    Field("y", 3, "rad", 28),
    Field("y_before", 3, "rad", 28),
    Field("input", 3, "N m", 28),
    Field("input_before", 3, "N m", 28),
    Field("input_old", 3, "N m", 28),
    Field("command", 3, "N m", 28),
    Field("eta", 3, "turn", 32),
    Field("rate", 3, "turn/sample", 36),
    Field("phi", 5, "rad, N m", 28),
    Field("F_phi", 5, "1", 40, 64),
    Field("gain", 5, "1", 28),
    Field("steps", 1, "tick", 0),
    Field("arithmetic", 1, "", 0),
)
(THETA, F, Y, Y_BEFORE, INPUT, BEFORE, OLD, COMMAND, ETA, RATE, PHI, F_PHI, GAIN, STEPS, ARITHMETIC) = offsets(STATE)

# Parameters of both forms; mantissas and shifts of the fixed form as in kinematics.py.
PAR = (
    Field("printed", 1, "", 0),
    Field("c1", 1, "1", 28),
    Field("c2", 1, "1", 28),
    Field("kappa", 1, "1", 30),
    Field("kappa_inv", 1, "1", 30),
    Field("forgetting", 1, "1", 30),
    Field("forgetting_inv", 1, "1", 30),
    Field("trace_max", 1, "1", 20),
    Field("decouple", 1, "", 0),
    Field("identify", 1, "", 0),
    Field("torque_shift", 1, "bit", 0),
    Field("limit", 3, "N m", 28),
    Field("torque_of", 3, "N m Q28 per turn/sample^2 Q36", 0, shift="demand_shift"),
    Field("drive_of", 3, "turn/sample^2 Q36 per N m Q28", 0, shift="drive_shift"),
    Field("demand_shift", 3, "bit", 0),
    Field("drive_shift", 3, "bit", 0),
    Field("b0_min", 3, "rad/(N m)", 28),
    Field("b0_max", 3, "rad/(N m)", 28),
)
(PRINTED, C1, C2, KAPPA, KAPPA_INV, FORGETTING, FORGETTING_INV, TRACE_MAX, DECOUPLE, IDENTIFY, TORQUE_SHIFT, LIMIT,
 TORQUE_OF, DRIVE_OF, DEMAND_SHIFT, DRIVE_SHIFT, B0_MIN, B0_MAX) = offsets(PAR)  # fmt: skip

STEPS_MAX = 1000000
TURN = 2.0 * math.pi


# -- float reference ---------------------------------------------------------------------------------------------------


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick; par TORQUE_OF = I0 / T_s^2, DRIVE_OF = T_s^2 / I0."""
    out[0], out[1], out[2], out[3] = 0.0, 0.0, 0.0, 0.0
    fresh = inp[0] != 0.0
    if s[STEPS] == 0.0 and not fresh:
        out[3] = 32.0
        return
    _take_inputs_float(s, par, inp)
    learn = fresh and inp[1] >= 3.0 and s[STEPS] >= 3.0
    if par[IDENTIFY] != 0.0 and not learn:
        out[3] += 4.0
    for i in range(3):
        if s[STEPS] == 0.0:
            s[Y + i], s[Y_BEFORE + i] = inp[3 + i], inp[3 + i]
        model = _predict_float(s, par, i)
        y = _near_float(inp[3 + i], s[Y + i]) if fresh else model
        if par[IDENTIFY] != 0.0 and learn:
            identify_float(s, THETA + 5 * i, F + 25 * i, PHI, par[FORGETTING], par[TRACE_MAX], y - model)
            s[THETA + 5 * i + 2] = min(max(s[THETA + 5 * i + 2], par[B0_MIN + i]), par[B0_MAX + i])
        s[Y_BEFORE + i], s[Y + i] = s[Y + i], y
        out[i] = _control_float(s, par, ref, i)
    saturated = 0.0
    if par[DECOUPLE] != 0.0 and _decouple_float(s, par, ref, out):
        saturated = 1.0
    for i in range(3):
        s[COMMAND + i] = min(max(out[i], -par[LIMIT + i]), par[LIMIT + i])
        if s[COMMAND + i] != out[i]:
            saturated = 1.0
        out[i] = s[COMMAND + i]
    out[3] += saturated
    s[STEPS] = min(s[STEPS] + 1.0, 1e6)


@jit.callee
def _near_float(angle: float, centre: float) -> float:
    """angle plus the whole turns that bring it within half a turn of centre."""
    return angle + TURN * math.floor((centre - angle) / TURN + 0.5)


@jit.callee
def _take_inputs_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    """v(k), v(k-1), v(k-2); printed: u(k-1), u(k-2), u(k-3)."""
    known = par[PRINTED] == 0.0 and inp[2] != 0.0
    v = triple(inp, 13) if known else triple(s, COMMAND)
    if par[DECOUPLE] != 0.0:
        b = (v[0] * par[DRIVE_OF], v[1] * par[DRIVE_OF + 1], v[2] * par[DRIVE_OF + 2])
        a = forward_float(triple(s, ETA), triple(s, RATE), b)
        v = (a[0] * par[TORQUE_OF], a[1] * par[TORQUE_OF + 1], a[2] * par[TORQUE_OF + 2])
    for i in range(3):
        s[OLD + i], s[BEFORE + i], s[INPUT + i] = s[BEFORE + i], s[INPUT + i], v[i]


@jit.callee
def _predict_float(s: np.ndarray, par: np.ndarray, i: int) -> float:
    """phi, and phi theta."""
    late = 0 if par[PRINTED] != 0.0 else BEFORE - INPUT
    s[PHI], s[PHI + 1], s[PHI + 4] = -s[Y + i], -s[Y_BEFORE + i], 1.0
    s[PHI + 2], s[PHI + 3] = s[INPUT + late + i], s[BEFORE + late + i]
    model = 0.0
    for m in range(5):
        model += s[PHI + m] * s[THETA + 5 * i + m]
    return model


@jit.callee
def _control_float(s: np.ndarray, par: np.ndarray, ref: np.ndarray, i: int) -> float:
    t = THETA + 5 * i
    a1, a2, b0, b1, d, y = s[t], s[t + 1], s[t + 2], s[t + 3], s[t + 4], s[Y + i]
    if par[PRINTED] != 0.0:
        w0, w1, w2 = ref[NEXT + i], ref[NOW + i], ref[PAST + i]
        s1, t0, t1 = 0.0, par[C1] - a1, par[C2] - a2
    else:
        w0, w1, w2 = ref[AHEAD + i], ref[NEXT + i], ref[NOW + i]
        s1 = par[C1] - a1
        t0, t1 = par[C2] - a2 - a1 * s1, -a2 * s1
        b0 = (b0 + b1) * par[KAPPA_INV]
        b1 = par[KAPPA] * b0
    top = _near_float(w0, y) + par[C1] * _near_float(w1, y) + par[C2] * _near_float(w2, y)
    top -= t0 * y + t1 * s[Y_BEFORE + i] + (b1 + b0 * s1) * s[INPUT + i] + b1 * s1 * s[BEFORE + i] + (1.0 + s1) * d
    u: float = top / b0
    return u


@jit.callee
def _decouple_float(s: np.ndarray, par: np.ndarray, ref: np.ndarray, out: np.ndarray) -> bool:
    """out: from I0 times an Euler acceleration to torque; True if it had to be scaled down."""
    for i in range(3):
        out[i] *= par[DRIVE_OF + i]
        s[RATE + i] = ref[AHEAD + i] - ref[NEXT + i]
        s[ETA + i] = ref[NEXT + i] + 0.5 * s[RATE + i]
    body = inverse_float(triple(s, ETA), triple(s, RATE), triple(out, 0))
    scale = 1.0
    for i in range(3):
        out[i] = body[i] * par[TORQUE_OF + i]
        if abs(out[i]) > par[LIMIT + i]:
            scale = min(scale, par[LIMIT + i] / abs(out[i]))
    if scale < 1.0:
        for i in range(3):
            out[i] *= scale
    return scale < 1.0


# -- fixed form --------------------------------------------------------------------------------------------------------


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    out[0], out[1], out[2], out[3], s[ARITHMETIC] = 0, 0, 0, 0, 0
    fresh = inp[0] != 0
    if s[STEPS] == 0 and not fresh:
        out[3] = 32
        return
    _take_inputs_fixed(s, par, inp)
    learn = fresh and inp[1] >= 3 and s[STEPS] >= 3
    if par[IDENTIFY] != 0 and not learn:
        out[3] = 4
    for i in range(3):
        if s[STEPS] == 0:
            s[Y + i] = _rad_fixed(s, inp[3 + i], 0)
            s[Y_BEFORE + i] = s[Y + i]
        model = _predict_fixed(s, par, i)
        y = _rad_fixed(s, inp[3 + i], s[Y + i]) if fresh else model
        if par[IDENTIFY] != 0 and learn:
            _identify_fixed(s, par, i, sat32(y - model))
        s[Y_BEFORE + i], s[Y + i] = s[Y + i], y
        out[i] = _control_fixed(s, par, ref, i)
    saturated = 0
    if par[DECOUPLE] != 0 and _decouple_fixed(s, par, ref, out):
        saturated = 1
    for i in range(3):
        s[COMMAND + i] = clip(out[i], -par[LIMIT + i], par[LIMIT + i])
        if s[COMMAND + i] != out[i]:
            saturated = 1
        out[i] = sat32(shift_round(s[COMMAND + i], -par[TORQUE_SHIFT]))
    out[3] += saturated
    if s[ARITHMETIC] != 0:
        out[3] += 8
    s[STEPS] = min(s[STEPS] + 1, STEPS_MAX)


@jit.callee
def _rad_fixed(s: np.ndarray, angle: int, centre: int) -> int:
    """rad Q28 of an angle in bam, with the whole turns that bring it within half a turn of `centre` (rad Q28)."""
    turns = mul_q(centre, 2734261102, 30)  # unwrapped bam
    return keep32(mul_q(turns + wrap32(angle - turns), 843314857, 31), s, ARITHMETIC)


@jit.callee
def _take_inputs_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    if par[PRINTED] == 0 and inp[2] != 0:
        n = par[TORQUE_SHIFT]
        v = (sat32(shift_round(inp[13], n)), sat32(shift_round(inp[14], n)), sat32(shift_round(inp[15], n)))
    else:
        v = triple(s, COMMAND)
    if par[DECOUPLE] != 0:
        b = (_drive_fixed(par, 0, v[0]), _drive_fixed(par, 1, v[1]), _drive_fixed(par, 2, v[2]))
        a = forward_fixed(triple(s, ETA), triple(s, RATE), b)
        v = (_torque_fixed(par, 0, a[0]), _torque_fixed(par, 1, a[1]), _torque_fixed(par, 2, a[2]))
    for i in range(3):
        s[OLD + i], s[BEFORE + i], s[INPUT + i] = s[BEFORE + i], s[INPUT + i], v[i]


@jit.callee
def _drive_fixed(par: np.ndarray, i: int, torque: int) -> int:
    """Acceleration, turn36, of a torque Q28 on the inertia I0."""
    return sat32(mul_q(torque, par[DRIVE_OF + i], par[DRIVE_SHIFT + i]))


@jit.callee
def _torque_fixed(par: np.ndarray, i: int, acceleration: int) -> int:
    """The torque Q28 that gives the inertia I0 the acceleration, turn36."""
    return sat32(mul_q(acceleration, par[TORQUE_OF + i], par[DEMAND_SHIFT + i]))


@jit.callee
def _predict_fixed(s: np.ndarray, par: np.ndarray, i: int) -> int:
    late = 0 if par[PRINTED] != 0 else BEFORE - INPUT
    s[PHI], s[PHI + 1], s[PHI + 4] = sat32(-s[Y + i]), sat32(-s[Y_BEFORE + i]), 268435456
    s[PHI + 2], s[PHI + 3] = s[INPUT + late + i], s[BEFORE + late + i]
    model = 0
    for m in range(5):
        model += mul_q(s[PHI + m], s[THETA + 5 * i + m], 28)
    return keep32(model, s, ARITHMETIC)


@jit.callee
def _identify_fixed(s: np.ndarray, par: np.ndarray, i: int, e: int) -> None:
    theta, f = (THETA, THETA + 5, THETA + 10)[i], (F, F + 25, F + 50)[i]
    identify_fixed(s, theta, f, PHI, par[FORGETTING], par[FORGETTING_INV], par[TRACE_MAX], e, ARITHMETIC)
    s[theta + 2] = clip(s[theta + 2], par[B0_MIN + i], par[B0_MAX + i])


@jit.callee
def _control_fixed(s: np.ndarray, par: np.ndarray, ref: np.ndarray, i: int) -> int:
    a1, a2, b0, b1 = s[THETA + 5 * i], s[THETA + 5 * i + 1], s[THETA + 5 * i + 2], s[THETA + 5 * i + 3]
    y, c1, c2, d = s[Y + i], par[C1], par[C2], s[THETA + 5 * i + 4]
    if par[PRINTED] != 0:
        w0, w1, w2 = ref[NEXT + i], ref[NOW + i], ref[PAST + i]
        s1, t0, t1 = 0, sat32(c1 - a1), sat32(c2 - a2)
    else:
        w0, w1, w2 = ref[AHEAD + i], ref[NEXT + i], ref[NOW + i]
        s1 = sat32(c1 - a1)
        t0, t1 = sat32(c2 - a2 - mul_q(a1, s1, 28)), sat32(-mul_q(a2, s1, 28))
        b0 = sat32(mul_q(b0 + b1, par[KAPPA_INV], 30))
        b1 = mul_q(par[KAPPA], b0, 30)
    top = _rad_fixed(s, w0, y) + mul_q(c1, _rad_fixed(s, w1, y), 28) + mul_q(c2, _rad_fixed(s, w2, y), 28)
    top -= mul_q(t0, y, 28) + mul_q(t1, s[Y_BEFORE + i], 28) + d + mul_q(s1, d, 28)
    top -= mul_q(sat32(b1 + mul_q(b0, s1, 28)), s[INPUT + i], 28)
    top -= mul_q(sat32(mul_q(b1, s1, 28)), s[BEFORE + i], 28)
    return keep32(div_trunc(shift_round(clip(top, -8589934592, 8589934592), -28), b0), s, ARITHMETIC)


@jit.callee
def _decouple_fixed(s: np.ndarray, par: np.ndarray, ref: np.ndarray, out: np.ndarray) -> bool:
    for i in range(3):
        out[i] = _drive_fixed(par, i, out[i])
        step = wrap32(ref[AHEAD + i] - ref[NEXT + i])
        s[RATE + i] = keep32(shift_round(step, -4), s, ARITHMETIC)
        s[ETA + i] = wrap32(ref[NEXT + i] + shift_round(step, 1))
    body = inverse_fixed(triple(s, ETA), triple(s, RATE), triple(out, 0))
    scale = 1073741824
    for i in range(3):
        out[i] = _torque_fixed(par, i, body[i])
        if abs(out[i]) > par[LIMIT + i]:
            scale = min(scale, div_trunc(shift_round(par[LIMIT + i], -30), abs(out[i])))
    if scale < 1073741824:
        for i in range(3):
            out[i] = mul_q(out[i], scale, 30)
    return scale < 1073741824


# -- the law as the board sees it --------------------------------------------------------------------------------------


def nominal_fixed(mantissa: int, shift: int) -> int:
    """b = T_s^2 / (2 I0), Q28, from drive_fixed(), which counts in turns."""
    return shift_round(mul_q(mantissa, 1686629713, 30), shift - 21)


class Mrac(CompiledLaw):
    """The law `mrac` in the form of the configuration."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(MRAC.telemetry)
    WORDS = tuple((THETA + i, 2.0**-28) for i in range(15))
    functions = (step_float, step_fixed)
    compiled = (jit.compile(step_float), jit.compile(step_fixed))

    def initialise(self, state: np.ndarray) -> None:
        c = self.configuration
        one = 1.0 if self.is_float else 1 << 28
        for i, axis in enumerate(AXES):
            b = 0.5 * self.par[DRIVE_OF + i]
            if not self.is_float:
                b = nominal_fixed(int(self.par[DRIVE_OF + i]), int(self.par[DRIVE_SHIFT + i]))
            b0, b1 = b, b
            if c.params["design"] == DESIGN_PRINTED:
                names = (f"printed_b0_{axis}", f"printed_b1_{axis}")
                b0, b1 = (c.values[n] if self.is_float else shift_round(c.params[n], 2) for n in names)
            state[THETA + 5 * i : THETA + 5 * i + 5] = -2 * one, one, b0, b1, 0
            state[F + 25 * i : F + 25 * i + 25 : 6] = c.values["F0"] if self.is_float else c.params["F0"]

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v = configuration.values
        pole, ts2, printed = v["c2_pole"], (v["period_us"] * 1e-6) ** 2, v["design"] == DESIGN_PRINTED
        inertia = configuration.vector("inertia_kgm2")
        b = [ts2 / 2 / i for i in inertia]
        par = [float(printed), -2 * pole, pole * pole, v["kappa"], 1 / (1 + v["kappa"])]
        par += [v["forgetting"], 1 / v["forgetting"], v["trace_max"], v["decouple"], v["identify"], 0.0]
        par += [*configuration.vector("torque_limit"), *(i / ts2 for i in inertia), *(ts2 / i for i in inertia)]
        par += [0.0] * 6
        return par + ([0.01] * 3 + [100.0] * 3 if printed else [x / 2 for x in b] + [x * 2 for x in b])

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p, one = configuration.common, configuration.params, 1 << 30
        scales = torque_scales_fixed(common["period_us"], [p[f"inertia_kgm2_{axis}"] for axis in AXES])
        b = [nominal_fixed(scales[3 + i], scales[9 + i]) for i in range(3)]
        if max(b) > 2**30 - 1:
            raise LawRefuses("law mrac: expected T_s^2 / (2 inertia) of at most 4 in the fixed form")
        printed = int(p["design"] == DESIGN_PRINTED)
        par = [printed, -shift_round(p["c2_pole"], 1), mul_q(p["c2_pole"], p["c2_pole"], 32)]
        par += [p["kappa"], div_trunc(1 << 60, one + p["kappa"]), p["forgetting"], div_trunc(1 << 60, p["forgetting"])]
        par += [p["trace_max"], p["decouple"], p["identify"], common["torque_bits"] - 28, *torque_limits_fixed(common)]
        par += scales
        if printed:
            return [*par, 2684355, 2684355, 2684355, INT32_MAX, INT32_MAX, INT32_MAX]
        return par + [shift_round(x, 1) for x in b] + [shift_round(x, -1) for x in b]

    def telemetry(self) -> list[int]:
        """theta of the three axes, then the trace of each axis' covariance."""
        traces = [sum(self.state[F + 25 * i : F + 25 * i + 25 : 6].tolist()) for i in range(3)]
        words = [word_of(x, 2.0**-16) if self.is_float else shift_round(x, 4) for x in traces]
        limits = self.RANGES[len(self.WORDS) :]
        return super().telemetry() + [clip(word, *limit) for word, limit in zip(words, limits, strict=True)]
