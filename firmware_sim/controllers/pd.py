"""pd: the paper's proportional-derivative law, per axis.

    u(k) = kp e(k) - kd w(k)          limited to +-torque_limit
    error euler        e = wrap(ym(k) - y(k))
    error quaternion   e in body axes, attitude_error.py with the sign of ym - y
    rate difference    w = (y(k) - y(k-m)) / (m T_s), in the same sense as e
    rate sensed        w = the rate sensor's reading, rad/s

m = 1, or after lost readings the ticks since the last one. There is no model: without a reading the last command is
repeated, the derivative is frozen, and COMMAND says "repeated". Any transport delay, any period from 1 ms.
Fixed form: angles bam, errors and differences rad Q29, kd / T_s as mantissa and shift, u Q28.
Source: paper 004, comparison with a PD designed by root locus; study of paper 004, section 2; paper 000, experiments
1 and 2 (rate and body error).
"""

from __future__ import annotations

import math

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.attitude_error import error_fixed, error_float
from firmware_sim.controllers.compiled import CompiledLaw, ranges_of, torque_limits_fixed
from firmware_sim.controllers.kinematics import triple
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import clip, div_trunc, keep32, mul_q, norm_shift, sat32, shift_round, wrap32
from firmware_sim.guidance.reference import NOW
from protocol.law_tables import AXES, Configuration
from protocol.laws.pd import PD, RATE_SENSED

STATE = (
    Field("reading", 3, "turn", 32),
    Field("change", 3, "rad/sample Q29, or rad/s as sensed", 0),
    Field("command", 3, "N m", 28),
    Field("error", 3, "turn", 32),
    Field("gap", 1, "tick", 0),
    Field("arithmetic", 1, "", 0),
)
READING, CHANGE, COMMAND, ERROR, GAP, ARITHMETIC = offsets(STATE)
# Parameters of both forms; the shifts are the fixed form's. kd is kd / T_s, of a sensed rate kd.
PAR = (
    Field("kp", 3, "N m Q28 per rad Q29", 0, shift="kp_shift"),
    Field("kd", 3, "N m Q28 per rad/sample Q29", 0, shift="kd_shift"),
    Field("limit", 3, "N m", 28),
    Field("kp_shift", 1, "bit", 0),
    Field("kd_shift", 3, "bit", 0),
    Field("torque_shift", 1, "bit", 0),
    Field("rate_shift", 1, "bit", 0),
    Field("sensed", 1, "", 0),
    Field("kind", 1, "", 0),
    Field("sequence", 1, "", 0),
)
KP, KD, LIMIT, KP_SHIFT, KD_SHIFT, TORQUE_SHIFT, RATE_SHIFT, SENSED, KIND, SEQUENCE = offsets(PAR)
GAP_MAX = 1000000


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick; par KD = kd / T_s, or kd."""
    fresh = inp[0] != 0.0
    out[3] = 32.0 if s[GAP] == 0.0 and not fresh else 0.0
    if fresh:
        _take_reading_float(s, par, inp, ref)
    for i in range(3):
        if fresh:
            u = par[KP + i] * s[ERROR + i] - par[KD + i] * s[CHANGE + i]
            s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
            if s[COMMAND + i] != u:
                out[3] = 1.0
        out[i] = s[COMMAND + i]
    if fresh:
        s[GAP] = 1.0
    elif s[GAP] > 0.0:
        s[GAP] = min(s[GAP] + 1.0, 1e6)


@jit.callee
def _take_reading_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray) -> None:
    """Error and rate."""
    y = triple(inp, 3)
    error = error_float(par[KIND], par[SEQUENCE], triple(ref, NOW), y)
    change = error_float(par[KIND], par[SEQUENCE], y, triple(s, READING))
    for i in range(3):
        if par[SENSED] != 0.0:
            s[CHANGE + i] = inp[10 + i]
        elif s[GAP] > 0.0:
            s[CHANGE + i] = change[i] / s[GAP]
        s[READING + i] = y[i]
        s[ERROR + i] = error[i]


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    fresh = inp[0] != 0
    s[ARITHMETIC] = 0
    out[3] = 32 if s[GAP] == 0 and not fresh else 0
    error = (0, 0, 0)
    if fresh:
        error = _take_reading_fixed(s, par, inp, ref)
    for i in range(3):
        if fresh:
            u = mul_q(par[KP + i], error[i], par[KP_SHIFT]) - mul_q(par[KD + i], s[CHANGE + i], par[KD_SHIFT + i])
            u = keep32(u, s, ARITHMETIC)
            s[COMMAND + i] = clip(u, -par[LIMIT + i], par[LIMIT + i])
            if s[COMMAND + i] != u:
                out[3] = 1
        out[i] = sat32(shift_round(s[COMMAND + i], -par[TORQUE_SHIFT]))
    if s[ARITHMETIC] != 0:
        out[3] += 8
    if fresh:
        s[GAP] = 1
    elif s[GAP] > 0:
        s[GAP] = min(s[GAP] + 1, GAP_MAX)


@jit.callee
def _take_reading_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray) -> tuple[int, int, int]:
    """Error, rad Q29; for TELEMETRY in bam; and rate."""
    y, now = triple(inp, 3), triple(ref, NOW)
    error = error_fixed(par[KIND], par[SEQUENCE], now, y)
    change = error_fixed(par[KIND], par[SEQUENCE], y, triple(s, READING))
    for i in range(3):
        if par[SENSED] != 0:
            s[CHANGE + i] = sat32(shift_round(inp[10 + i], par[RATE_SHIFT]))
        elif s[GAP] > 0:
            s[CHANGE + i] = div_trunc(change[i], s[GAP])
        s[READING + i] = y[i]
        s[ERROR + i] = wrap32(now[i] - y[i] if par[KIND] == 0 else mul_q(error[i], 2734261102, 31))
    return error


def per_sample_fixed(gain: int, bits: int, period_us: int) -> tuple[int, int]:
    """(m, n): gain 2^-bits / T_s times a change in rad Q29 is a torque Q28, change m 2^-n; (0, 1) if negligible."""
    size = div_trunc(mul_q(abs(gain), 1000000 << 10, 0), period_us)
    s = norm_shift(size)
    n = bits + 10 + 1 + s
    if size == 0 or n > 62:
        return 0, 1
    mantissa = clip(shift_round(size, -s), 0, 2147483647)
    return (mantissa if gain > 0 else -mantissa), n


class Pd(CompiledLaw):
    """The law `pd` in the form of the configuration."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(PD.telemetry)
    WORDS = tuple((ERROR + i, math.pi / 2**31) for i in range(3))
    has_model = False
    functions = (step_float, step_fixed)
    compiled = (jit.compile(step_float), jit.compile(step_fixed))

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v, ts = configuration.values, configuration.values["period_us"] * 1e-6
        kp, kd, limit = (configuration.vector(name) for name in ("kp", "kd", "torque_limit"))
        per = 1.0 if v["rate"] == RATE_SENSED else ts
        return [*kp, *(k / per for k in kd), *limit, *[0.0] * 6, v["rate"], v["error"], v["attitude_sequence"]]

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p = configuration.common, configuration.params
        bits = p["kd_bits"] + common["rate_bits"] - 28  # of kd times a sensed rate beyond Q28
        kd = [(p[f"kd_{axis}"], max(bits, 0)) for axis in AXES]
        if p["rate"] != RATE_SENSED:
            kd = [per_sample_fixed(p[f"kd_{axis}"], p["kd_bits"], common["period_us"]) for axis in AXES]
        par = [*(p[f"kp_{axis}"] for axis in AXES), *(m for m, _ in kd), *torque_limits_fixed(common)]
        par += [p["kp_bits"] + 1, *(n for _, n in kd), common["torque_bits"] - 28, min(bits, 0)]
        return [*par, p["rate"], p["error"], common["attitude_sequence"]]
