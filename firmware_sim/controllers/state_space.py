"""state_space: any discrete compensator of order n <= 8, the same on each axis, times a gain per axis.

    e(k) = ym(k) - y(k), rad                       by `error`, attitude_error.py with the sign of ym - y
    u(k) = gain (C x(k) + D e(k)), N m             limited to +-torque_limit
    x(k+1) = A x(k) + B e(k),  x(0) = 0

A, B, C, D are for one T_s. n is found in the numbers: an index whose row and column of A are zero, and its B and C, is
no state. A torque at its limit does not reach the states: they run on, as in a linear simulation, and an integrator
winds up. With `anti_windup` the states of an axis at its limit stay what they are, if the next ones would have its
torque (for the same error) driven further out; what brings it back is always let through.
There is no model: without a reading the last command is repeated, the states stay, and COMMAND says "repeated".

Fixed form: e Q29; x 64 bits, 16 of them below state_bits, held to +-2^(31 - state_bits) (then flag arithmetic); A - I,
B and, per axis, gain C and gain D with 28 bits, so that a row of products is summed exactly and rounded once; torque in
the wire's LSB. Source: paper 000, controllers LQG and LS; study of paper 000, sections 1.1 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.attitude_error import error_fixed, error_float
from firmware_sim.controllers.compiled import CompiledLaw, LawRefuses, ranges_of
from firmware_sim.controllers.kinematics import triple
from firmware_sim.fields import Field, offsets
from firmware_sim.fixed import INT32_MAX, clip, mul_q, norm_shift, shift_round
from firmware_sim.guidance.reference import NOW
from protocol.law_tables import AXES, Configuration
from protocol.laws.state_space import ORDER, STATE_SPACE

STATE = (
    Field("x", 24, "1", 0, 64),  # state_bits + 16 fractional bits; axis after axis
    Field("error", 3, "rad", 29),
    Field("command", 3, "N m", 0),  # the wire's LSB
    Field("next", 8, "1", 0, 64),  # of one axis, while it is stepped: as x
    Field("high", 8, "1", 0),  # its x in state_bits
    Field("started", 1, "", 0),
    Field("arithmetic", 1, "", 0),
)
X, ERROR, COMMAND, NEXT, HIGH, STARTED, ARITHMETIC = offsets(STATE)
# Parameters of both forms, those of the fixed form with 28 bits; C and D times the gain of each axis.
PAR = (
    Field("A", 64, "state Q(state_bits + 16) per state Q(state_bits), less I", 0, shift="A_shift"),
    Field("B", 8, "state Q(state_bits + 16) per rad Q29", 0, shift="B_shift"),
    Field("C", 24, "torque LSB per state Q(state_bits)", 0, shift="C_shift"),
    Field("D", 3, "torque LSB per rad Q29", 0, shift="D_shift"),
    Field("limit", 3, "N m", 0),
    Field("A_shift", 1, "bit", 0),
    Field("B_shift", 1, "bit", 0),
    Field("C_shift", 3, "bit", 0),
    Field("D_shift", 3, "bit", 0),
    Field("order", 1, "", 0),
    Field("anti_windup", 1, "", 0),
    Field("error_kind", 1, "", 0),
    Field("sequence", 1, "", 0),
)
A, B, C, D, LIMIT, A_SHIFT, B_SHIFT, C_SHIFT, D_SHIFT, N, ANTI_WINDUP, KIND, SEQUENCE = offsets(PAR)
BITS = 28  # of a coefficient
BELOW = 16  # bits of a state below those that are multiplied
STATE_MAX = 140737488289792  # (2^31 - 1) 2^BELOW
SHIFT_MAX = 62


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick; par A = A - I."""
    fresh = inp[0] != 0.0
    out[3] = 32.0 if s[STARTED] == 0.0 and not fresh else 0.0
    if fresh:
        s[STARTED] = 1.0
        s[ERROR], s[ERROR + 1], s[ERROR + 2] = error_float(par[KIND], par[SEQUENCE], triple(ref, NOW), triple(inp, 3))
        for i in range(3):
            if _axis_float(s, par, i):
                out[3] = 1.0
    for i in range(3):
        out[i] = s[COMMAND + i]


@jit.callee
def _axis_float(s: np.ndarray, par: np.ndarray, i: int) -> bool:
    """Output, then the next states; True at the limit."""
    n, x, c, e = int(par[N]), X + ORDER * i, C + ORDER * i, s[ERROR + i]
    now, later = 0.0, 0.0
    for j in range(n):
        now += par[c + j] * s[x + j]
    u = now + par[D + i] * e
    s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
    for j in range(n):
        row = par[B + j] * e
        for m in range(n):
            row += par[A + ORDER * j + m] * s[x + m]
        s[NEXT + j] = s[x + j] + row
        later += par[c + j] * s[NEXT + j]
    limited = s[COMMAND + i] != u
    outwards = later > now if u > 0.0 else later < now
    if not (par[ANTI_WINDUP] != 0.0 and limited and outwards):
        for j in range(n):
            s[x + j] = s[NEXT + j]
    return bool(limited)


def step_fixed(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick, in integers."""
    fresh = inp[0] != 0
    s[ARITHMETIC] = 0
    out[3] = 32 if s[STARTED] == 0 and not fresh else 0
    if fresh:
        s[STARTED] = 1
        s[ERROR], s[ERROR + 1], s[ERROR + 2] = error_fixed(par[KIND], par[SEQUENCE], triple(ref, NOW), triple(inp, 3))
        for i in range(3):
            if _axis_fixed(s, par, i):
                out[3] = 1
    for i in range(3):
        out[i] = s[COMMAND + i]
    if s[ARITHMETIC] != 0:
        out[3] += 8


@jit.callee
def _axis_fixed(s: np.ndarray, par: np.ndarray, i: int) -> bool:
    n, x, c, e = par[N], (X, X + 8, X + 16)[i], (C, C + 8, C + 16)[i], s[ERROR + i]
    now, later, a = 0, 0, A
    for j in range(n):
        s[HIGH + j] = shift_round(s[x + j], BELOW)
        now += mul_q(par[c + j], s[HIGH + j], 0)
    u = shift_round(now, par[C_SHIFT + i]) + mul_q(par[D + i], e, par[D_SHIFT + i])
    s[COMMAND + i] = clip(u, -par[LIMIT + i], par[LIMIT + i])
    for j in range(n):
        row = 0
        for m in range(n):
            row += mul_q(par[a + m], s[HIGH + m], 0)
        a += ORDER
        s[NEXT + j] = _kept(s, s[x + j] + shift_round(row, par[A_SHIFT]) + mul_q(par[B + j], e, par[B_SHIFT]))
        later += mul_q(par[c + j], shift_round(s[NEXT + j], BELOW), 0)
    limited = s[COMMAND + i] != u
    outwards = later > now if u > 0 else later < now
    if not (par[ANTI_WINDUP] != 0 and limited and outwards):
        for j in range(n):
            s[x + j] = s[NEXT + j]
    return bool(limited)


@jit.callee
def _kept(s: np.ndarray, x: int) -> int:
    """A state within its range; what is beyond is said."""
    if x < -STATE_MAX or x > STATE_MAX:
        s[ARITHMETIC] = 1
    return clip(x, -STATE_MAX, STATE_MAX)


# -- the law as the board sees it --------------------------------------------------------------------------------------


def mantissas(numbers: Sequence[int], bits: int) -> tuple[list[int], int]:
    """The numbers with BITS bits for the largest of them, and the fractional bits they then have; were: `bits`."""
    peak = max(abs(number) for number in numbers)
    s = norm_shift(peak) + BITS - 31
    return [shift_round(number, -s) for number in numbers], bits + s


def order_of(params: Mapping[str, int]) -> int:
    """The last index that has a number other than zero."""
    for n in range(ORDER, 0, -1):
        names = [f"A_{n}_{j}" for j in range(1, ORDER + 1)] + [f"A_{j}_{n}" for j in range(1, ORDER + 1)]
        if any(params[name] != 0 for name in (*names, f"B_{n}", f"C_{n}")):
            return n
    return 0


def identity_less(params: Mapping[str, int], n: int) -> list[int]:
    """A - I with A_bits, 64 numbers, zero beyond the order n."""
    one = shift_round(1, -params["A_bits"])
    return [
        params[f"A_{j}_{m}"] - (one if j == m else 0) if j <= n and m <= n else 0
        for j in range(1, ORDER + 1)
        for m in range(1, ORDER + 1)
    ]


def shifted(name: str, numbers: Sequence[int], bits: int, product_bits: int) -> tuple[list[int], int]:
    """Mantissas, and the shift that takes their products with `product_bits` more bits to the scale of the sum.

    Raises LawRefuses where they are so large that nothing else would be left of that scale.
    """
    values, bits_now = mantissas(numbers, bits)
    shift = bits_now + product_bits
    if not any(numbers) or shift > SHIFT_MAX:
        return [0] * len(numbers), 1
    if shift < 0:
        most = 2.0 ** (BITS - 1 + product_bits)
        raise LawRefuses(f"law state_space: expected {name} below {most:g} in the fixed form, or other bits")
    return values, shift


class StateSpace(CompiledLaw):
    """The law `state_space` in the form of the configuration."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(STATE_SPACE.telemetry)
    WORDS = tuple((ERROR + i, 2.0**-29) for i in range(3))
    has_model = False
    functions = (step_float, step_fixed)
    compiled = (jit.compile(step_float), jit.compile(step_fixed))

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v, common = configuration.values, configuration.common
        n, gain = order_of(configuration.params), configuration.vector("gain")
        scale = 2.0 ** -configuration.params["A_bits"]
        a = [number * scale for number in identity_less(configuration.params, n)]
        b, c = ([v[f"{name}_{j}"] for j in range(1, ORDER + 1)] for name in "BC")
        kinds = [v["anti_windup"], v["error"], float(common["attitude_sequence"])]
        limits = configuration.vector("torque_limit")
        return [
            *a,
            *b,
            *(g * each for g in gain for each in c),
            *(g * v["D"] for g in gain),
            *limits,
            *[0.0] * 8,
            n,
            *kinds,
        ]

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        common, p = configuration.common, configuration.params
        n, states, torque = order_of(p), p["state_bits"], common["torque_bits"]
        a, a_shift = shifted("A", identity_less(p, n), p["A_bits"], -BELOW)
        b, b_shift = shifted("B", [p[f"B_{j}"] for j in range(1, ORDER + 1)], p["B_bits"], 29 - states - BELOW)
        c: list[int] = []
        d: list[int] = []
        c_shift: list[int] = []
        d_shift: list[int] = []
        for axis in AXES:
            gain, more = p[f"gain_{axis}"], p["axis_gain_bits"]
            row = [mul_q(p[f"C_{j}"], gain, 0) for j in range(1, ORDER + 1)]
            values, shift = shifted("C times gain", row, p["C_bits"] + more, states - torque)
            c, c_shift = [*c, *values], [*c_shift, shift]
            values, shift = shifted("D times gain", [mul_q(p["D"], gain, 0)], p["D_bits"] + more, 29 - torque)
            d, d_shift = [*d, *values], [*d_shift, shift]
        limits = [clip(common[f"torque_limit_{axis}"], 0, INT32_MAX) for axis in AXES]
        kinds = [p["anti_windup"], p["error"], common["attitude_sequence"]]
        return [*a, *b, *c, *d, *limits, a_shift, b_shift, *c_shift, *d_shift, n, *kinds]
