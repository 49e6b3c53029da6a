"""fvsc, vsc, ifvsc: variable structure per axis, with a fuzzy gain, without it (f = -e), or with an integral beside it.

    e      = attitude error, measured minus reference ym(k), rad (attitude_error.py)
    S      = e (m e + w),  w: sensed body rate, or the change of e, (e(k) - e(k-m)) / (m T_s)
    v      = Ks sgn(S) f(e) - Kr rate - Ki I          V; sgn(0) = +1; rate: always the sensed one
    u      = ka v                                     N m, limited to +-torque_limit
    I(k+1) = I(k) + T_s e(k), within +-integral_limit; held while u is at its limit and e would drive it further

fvsc, ifvsc: f = -sgn(e) L h(min(|e| / E, 1)), h of fuzzy.py by closed form or table; vsc: f = -e. fvsc and vsc: Ki = 0.
sgn(S) is sgn(e) sgn(m e + w) and never computed from the square: in 16 bits a quarter of the signs would be wrong.
Without a reading the last command is repeated, and integral and change of the error stand still. On a sampled loop the
switching is as slow as the loop: a slide becomes chatter, and the effort several times a PD's.
Fixed form: e rad Q29, S's factor rad/s Q30, m Q24, gains and v Q20, I Q40 (its sum), f Q15, u in the wire's LSB.
Source: paper 000, experiments 1 to 3; study of paper 000, sections 3 and 3.1.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.attitude_error import error_fixed, error_float
from firmware_sim.controllers.compiled import CompiledLaw, ranges_of
from firmware_sim.controllers.fuzzy import closed_fixed, closed_float, table_fixed, table_float
from firmware_sim.controllers.kinematics import triple
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import clip, div_trunc, keep32, mul_q, sat32, shift_round
from firmware_sim.guidance.reference import NOW, wrap_pi
from protocol.law_tables import AXES, Configuration
from protocol.laws.fvsc import DEFAULT_TABLE, ENTRIES, FVSC, IFVSC, VSC

STATE = (
    Field("sum", 3, "rad s", 40, 64),
    Field("error", 3, "rad", 29),
    Field("switching", 3, "V", 20),
    Field("sign", 3, "", 0),
    Field("integral", 3, "rad s", 20),
    Field("command", 3, "N m in the wire's LSB", 0),
    Field("gap", 1, "tick", 0),
    Field("arithmetic", 1, "", 0),
)
SUM, ERROR, SWITCHING, SIGN, INTEGRAL, COMMAND, GAP, ARITHMETIC = offsets(STATE)
# Parameters of both forms; the shifts are the fixed form's. ks is Ks L where the gain is fuzzy.
PAR = (
    Field("ka", 3, "the wire's LSB per V Q20", 0, shift="ka_shift"),
    Field("limit", 3, "N m in the wire's LSB", 0),
    Field("ka_shift", 1, "bit", 0),
    Field("ks", 1, "V", 20),
    Field("kr", 1, "V s/rad", 20),
    Field("m", 1, "1/s", 24),
    Field("ki", 1, "V/(rad s)", 20),
    Field("integral_limit", 1, "rad s", 20),
    Field("ts", 1, "s", 24),
    Field("period_us", 1, "us", 0),
    Field("rate_bits", 1, "bit", 0),
    Field("difference", 1, "", 0),
    Field("kind", 1, "", 0),
    Field("sequence", 1, "", 0),
    Field("gain", 1, "", 0),
    Field("inverse_E", 1, "1/rad", 21),
    Field("table", ENTRIES, "1", 15),
)
(KA, LIMIT, KA_SHIFT, KS, KR, M, KI, INTEGRAL_LIMIT, TS, PERIOD_US, RATE_BITS, DIFFERENCE, KIND, SEQUENCE, GAIN,
 INVERSE_E, TABLE) = offsets(PAR)  # fmt: skip
CLOSED, FROM_TABLE, LINEAR = 0, 1, 2  # values of `gain`
GAP_MAX = 1000000


# -- float reference ---------------------------------------------------------------------------------------------------


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick."""
    fresh = inp[0] != 0.0
    out[3] = 32.0 if s[GAP] == 0.0 and not fresh else 0.0
    if fresh:
        error = error_float(par[KIND], par[SEQUENCE], triple(inp, 3), triple(ref, NOW))
        for i in range(3):
            _control_float(s, par, i, error[i], inp[10 + i], out)
        s[GAP] = 1.0
    elif s[GAP] > 0.0:
        s[GAP] = min(s[GAP] + 1.0, 1e6)
    for i in range(3):
        out[i] = s[COMMAND + i]


@jit.callee
def _control_float(s: np.ndarray, par: np.ndarray, i: int, e: float, rate: float, out: np.ndarray) -> None:
    """The command of axis i."""
    w = rate
    if par[DIFFERENCE] != 0.0:
        change = wrap_pi(e - s[ERROR + i]) if par[KIND] == 0.0 else e - s[ERROR + i]
        w = change / (s[GAP] * par[TS]) if s[GAP] > 0.0 else 0.0
    s[SIGN + i] = sign_float(e, par[M] * e + w)
    s[ERROR + i] = e
    s[SWITCHING + i] = par[KS] * s[SIGN + i] * _f_float(par, e)
    u = par[KA + i] * (s[SWITCHING + i] - par[KR] * rate - par[KI] * s[INTEGRAL + i])
    s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
    if s[COMMAND + i] != u:
        out[3] = 1.0
    if s[COMMAND + i] == u or u * e > 0.0:
        s[INTEGRAL + i] += par[TS] * e
        s[INTEGRAL + i] = min(max(s[INTEGRAL + i], -par[INTEGRAL_LIMIT]), par[INTEGRAL_LIMIT])
        s[SUM + i] = s[INTEGRAL + i]


@jit.callee
def sign_float(e: float, sigma: float) -> float:
    """sgn(e sigma), +1 for zero."""
    return 1.0 if e == 0.0 or sigma == 0.0 or (e > 0.0) == (sigma > 0.0) else -1.0


@jit.callee
def _f_float(par: np.ndarray, e: float) -> float:
    """f(e), in units of L where it is fuzzy."""
    if par[GAIN] == 2.0:
        return -e
    a = min(abs(e) * par[INVERSE_E], 1.0)
    f = closed_float(a) if par[GAIN] == 0.0 else table_float(par, TABLE, a)
    return -f if e > 0.0 else f


# -- fixed form --------------------------------------------------------------------------------------------------------


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    fresh = inp[0] != 0
    s[ARITHMETIC] = 0
    out[3] = 32 if s[GAP] == 0 and not fresh else 0
    if fresh:
        error = error_fixed(par[KIND], par[SEQUENCE], triple(inp, 3), triple(ref, NOW))
        for i in range(3):
            _control_fixed(s, par, i, error[i], inp[10 + i], out)
        s[GAP] = 1
    elif s[GAP] > 0:
        s[GAP] = min(s[GAP] + 1, GAP_MAX)
    for i in range(3):
        out[i] = s[COMMAND + i]
    if s[ARITHMETIC] != 0:
        out[3] += 8


@jit.callee
def _control_fixed(s: np.ndarray, par: np.ndarray, i: int, e: int, rate: int, out: np.ndarray) -> None:
    w = shift_round(rate, par[RATE_BITS] - 30)
    if par[DIFFERENCE] != 0:
        w = _change_fixed(par, e - s[ERROR + i], s[GAP])
    s[SIGN + i] = sign_fixed(e, mul_q(par[M], e, 23) + w)
    s[ERROR + i] = e
    f = _f_fixed(par, e)
    s[SWITCHING + i] = keep32(f if s[SIGN + i] > 0 else -f, s, ARITHMETIC)
    v = s[SWITCHING + i] - mul_q(par[KR], rate, par[RATE_BITS]) - mul_q(par[KI], s[INTEGRAL + i], 20)
    u = mul_q(par[KA + i], keep32(v, s, ARITHMETIC), par[KA_SHIFT])
    s[COMMAND + i] = clip(u, -par[LIMIT + i], par[LIMIT + i])
    if s[COMMAND + i] != u:
        out[3] = 1
    if s[COMMAND + i] == u or (u > 0) == (e > 0):
        limit = shift_round(par[INTEGRAL_LIMIT], -20)
        s[SUM + i] = clip(s[SUM + i] + mul_q(par[TS], e, 13), -limit, limit)
        s[INTEGRAL + i] = sat32(shift_round(s[SUM + i], 20))


@jit.callee
def _change_fixed(par: np.ndarray, change: int, gap: int) -> int:
    """rad/s Q30 of a change of the error, rad Q29, in so many ticks; zero before the first."""
    if par[KIND] == 0:  # the short way round
        change = change - 3373259426 if change > 1686629713 else change + 3373259426 if change < -1686629713 else change
    return div_trunc(mul_q(change, 2000000, 0), mul_q(par[PERIOD_US], gap, 0)) if gap > 0 else 0


@jit.callee
def sign_fixed(e: int, sigma: int) -> int:
    """sgn(e sigma), +1 for zero, from the signs alone."""
    return 1 if e == 0 or sigma == 0 or (e > 0) == (sigma > 0) else -1


@jit.callee
def _f_fixed(par: np.ndarray, e: int) -> int:
    """Ks f(e), V Q20."""
    if par[GAIN] == 2:
        return -mul_q(par[KS], e, 29)
    a = min(mul_q(abs(e), par[INVERSE_E], 35), 32768)
    f = closed_fixed(a) if par[GAIN] == 0 else table_fixed(par, TABLE, a)
    f = mul_q(par[KS], f, 15)
    return -f if e > 0 else f


# -- the laws as the board sees them -----------------------------------------------------------------------------------


class Fvsc(CompiledLaw):
    """The law `fvsc` in the form of the configuration."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(FVSC.telemetry)
    WORDS: ClassVar[tuple[tuple[int, float], ...]] = (
        *((ERROR + i, 2.0**-29) for i in range(3)),
        *((SWITCHING + i, 2.0**-20) for i in range(3)),
        *((SIGN + i, 1.0) for i in range(3)),
    )
    has_model = False
    functions = (step_float, step_fixed)
    compiled = (jit.compile(step_float), jit.compile(step_fixed))

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v, c = configuration.values, configuration
        par = [*c.vector("ka"), *c.vector("torque_limit"), 0.0, v["Ks"] * v.get("L", 1.0), v["Kr"], v["m"]]
        par += [v.get("Ki", 0.0), v.get("integral_limit", 10.0), v["period_us"] * 1e-6, v["period_us"], 0.0]
        par += [v["rate_in_S"], v["error"], v["attitude_sequence"], v.get("inference", LINEAR)]
        par += [1 / v.get("E", math.inf)]
        return [*par, *(v.get(f"f_table_{i}", default) for i, default in enumerate(DEFAULT_TABLE, 1))]

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p = configuration.common, configuration.params
        fuzzy = "E" in p
        par = [*(p[f"ka_{axis}"] for axis in AXES), *(common[f"torque_limit_{axis}"] for axis in AXES)]
        par += [p["ka_bits"] + 20 - common["torque_bits"], mul_q(p["Ks"], p["L"], 20) if fuzzy else p["Ks"]]
        par += [p["Kr"], p["m"], p.get("Ki", 0), p.get("integral_limit", 10 << 20)]
        par += [div_trunc(shift_round(common["period_us"], -24), 1000000), common["period_us"], common["rate_bits"]]
        par += [p["rate_in_S"], p["error"], common["attitude_sequence"], p.get("inference", LINEAR)]
        par += [div_trunc(1 << 49, p["E"]) if fuzzy else 0]
        return [*par, *(p[f"f_table_{i}"] if fuzzy else 0 for i in range(1, ENTRIES + 1))]


class Vsc(Fvsc):
    """The law `vsc`."""

    RANGES = ranges_of(VSC.telemetry)


class Ifvsc(Fvsc):
    """The law `ifvsc`."""

    RANGES = ranges_of(IFVSC.telemetry)
    WORDS = (*Fvsc.WORDS, *((INTEGRAL + i, 2.0**-20) for i in range(3)))
