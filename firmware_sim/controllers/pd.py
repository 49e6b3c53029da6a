"""pd: the paper's proportional-derivative law, per axis.

    u(k) = kp wrap(ym(k) - y(k)) - kd (y(k) - y(k-m)) / (m T_s)          limited to +-torque_limit

m = 1, or after lost readings the ticks since the last one. There is no model: without a reading the last command is
repeated, the derivative is frozen, and COMMAND says "repeated". Any transport delay, any period.
Fixed form: y bam, differences rad Q29, kd / T_s as mantissa and shift, u Q28.
Source: paper 004, comparison with a PD designed by root locus; study of paper 004, section 2.
"""

from __future__ import annotations

import math

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.compiled import CompiledLaw, ranges_of, torque_limits_fixed
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import clip, div_trunc, keep32, mul_q, norm_shift, sat32, shift_round, wrap32
from firmware_sim.guidance.reference import NOW, wrap_pi
from protocol.law_tables import AXES, Configuration
from protocol.laws.pd import PD

STATE = (
    Field("reading", 3, "turn", 32),
    Field("change", 3, "rad/sample", 29),
    Field("command", 3, "N m", 28),
    Field("error", 3, "turn", 32),
    Field("gap", 1, "tick", 0),
    Field("arithmetic", 1, "", 0),
)
READING, CHANGE, COMMAND, ERROR, GAP, ARITHMETIC = offsets(STATE)
# Parameters of both forms; the shifts are the fixed form's. kd is kd / T_s.
PAR = (
    Field("kp", 3, "N m Q28 per rad Q29", 0, shift="kp_shift"),
    Field("kd", 3, "N m Q28 per rad/sample Q29", 0, shift="kd_shift"),
    Field("limit", 3, "N m", 28),
    Field("kp_shift", 1, "bit", 0),
    Field("kd_shift", 3, "bit", 0),
    Field("torque_shift", 1, "bit", 0),
)
KP, KD, LIMIT, KP_SHIFT, KD_SHIFT, TORQUE_SHIFT = offsets(PAR)
GAP_MAX = 1000000


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick; par KD = kd / T_s."""
    fresh = inp[0] != 0.0
    out[3] = 32.0 if s[GAP] == 0.0 and not fresh else 0.0
    for i in range(3):
        if fresh:
            if s[GAP] > 0.0:
                s[CHANGE + i] = wrap_pi(inp[3 + i] - s[READING + i]) / s[GAP]
            s[READING + i] = inp[3 + i]
            s[ERROR + i] = wrap_pi(ref[NOW + i] - inp[3 + i])
            u = par[KP + i] * s[ERROR + i] - par[KD + i] * s[CHANGE + i]
            s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
            if s[COMMAND + i] != u:
                out[3] = 1.0
        out[i] = s[COMMAND + i]
    if fresh:
        s[GAP] = 1.0
    elif s[GAP] > 0.0:
        s[GAP] = min(s[GAP] + 1.0, 1e6)


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    fresh = inp[0] != 0
    s[ARITHMETIC] = 0
    out[3] = 32 if s[GAP] == 0 and not fresh else 0
    for i in range(3):
        if fresh:
            if s[GAP] > 0:
                change = mul_q(wrap32(inp[3 + i] - s[READING + i]), 1686629713, 31)
                s[CHANGE + i] = div_trunc(change, s[GAP])
            s[READING + i] = inp[3 + i]
            s[ERROR + i] = wrap32(ref[NOW + i] - inp[3 + i])
            error = mul_q(s[ERROR + i], 1686629713, 31)
            u = mul_q(par[KP + i], error, par[KP_SHIFT]) - mul_q(par[KD + i], s[CHANGE + i], par[KD_SHIFT + i])
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
        ts = configuration.values["period_us"] * 1e-6
        kp, kd, limit = (configuration.vector(name) for name in ("kp", "kd", "torque_limit"))
        return [*kp, *(k / ts for k in kd), *limit, 0.0, 0.0, 0.0, 0.0, 0.0]

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p = configuration.common, configuration.params
        kd = [per_sample_fixed(p[f"kd_{axis}"], p["kd_bits"], common["period_us"]) for axis in AXES]
        par = [*(p[f"kp_{axis}"] for axis in AXES), *(m for m, _ in kd), *torque_limits_fixed(common)]
        return [*par, p["kp_bits"] + 1, *(n for _, n in kd), common["torque_bits"] - 28]
