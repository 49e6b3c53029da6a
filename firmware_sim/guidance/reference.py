"""Reference model: set-point r(k) in, reference ym(k) .. ym(k+2) out, per axis, in float and in integers.

Critically damped, double pole p = exp(-wn T_s), lead d (r(k) first shows in ym(k+d)). With m = k + d - 1, per axis:

    am = k1 wrap(r(k) - ym(m)) - k2 vm(m)             limited to +-accel_limit, vm + am to +-rate_limit
    ym(m+1) = ym(m) + vm(m) + half am,  vm(m+1) = vm(m) + am
    zoh:   half = 1/2, k1 = (1-p)^2, k2 = (1-p)(3+p)/2: ym(k+d) = D r / (1 - p q^-1)^2, D = (1-p)^2 (1 + q^-1)/2
    paper: half = 1,   k1 = (1-p)^2, k2 = 1 - p^2:      the same with D = (1-p)^2
    none:  no model and no lead: ym(k) = ym(k-1) + wrap(r(k) - ym(k-1)), the last term limited to +-rate_limit if there
           is one (so ym turns at that rate and stops on r), without one ym = r(k). ym(k+1), ym(k+2) are what follows
           if r stays, the rates what lies between them. accel_limit limits nothing here

Start at the first reading y: ym up to m is y and, with zoh, r(k-1) = r(k), that is vm(m) = 2 ((1-p)/(1+p))^2 (r - y);
with none ym(k-1) is y.
Units: rad and samples, or bam (positions) and 2^-36 turn (rates, accelerations); the recursion itself runs on 2^-48
turn so that a slow model does not stick. Positions are modulo one turn.
Source: study of paper 004, sections 0 and 3.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from firmware_sim import jit
from firmware_sim.fields import Field, offsets, size
from firmware_sim.fixed import INT32_MAX, clip, div_trunc, mul_q, mul_wide, sat32, shift_round, wrap32, wrap_bits
from protocol.law_tables import COMMON, REFERENCE_NONE, REFERENCE_PAPER, REFERENCE_ZOH, dequantise

# Layout of `state`; the first seven are for the laws, three axes each.
STATE = (
    Field("past", 3, "turn", 32),  # ym(k-1)
    Field("now", 3, "turn", 32),  # ym(k)
    Field("next", 3, "turn", 32),  # ym(k+1)
    Field("ahead", 3, "turn", 32),  # ym(k+2); with lead 1 it is extrapolated
    Field("rate_now", 3, "turn/sample", 36),  # vm(k)
    Field("rate_next", 3, "turn/sample", 36),  # vm(k+1)
    Field("accel", 3, "turn/sample^2", 36),  # am that r(k) brought
    Field("head", 3, "turn", 48, 64),  # ym at k + lead
    Field("head_rate", 3, "turn/sample", 48, 64),  # vm at k + lead
    Field("started", 1, "", 0),
    Field("saturated", 1, "", 0),
    Field("lead", 1, "tick", 0),
)
PAST, NOW, NEXT, AHEAD, RATE_NOW, RATE_NEXT, ACCEL, HEAD, HEAD_RATE, STARTED, SATURATED, LEAD = offsets(STATE)
SIZE = size(STATE)
# Layout of the parameters.
PAR = (
    Field("kind", 1, "", 0),
    Field("k1", 1, "1", 46, 64),
    Field("k2", 1, "1", 30),
    Field("start", 1, "1", 46, 64),
    Field("accel_max", 1, "turn/sample^2", 48, 64),
    Field("rate_max", 1, "turn/sample", 48, 64),
)
KIND, K1, K2, START, ACCEL_MAX, RATE_MAX = offsets(PAR)

RATE_LIMIT_48 = 1 << 46  # a quarter turn per sample: the largest rate the integers carry
HALF_TURN_48 = 1 << 47  # limits no step of an angle


@jit.callee
def restart_fixed(state: np.ndarray, i: int, position: int, rate: int) -> None:
    """Axis i begins anew: it stays at `position` (bam) up to t_(k+lead) and goes on from there at `rate` (turn36)."""
    for field in (PAST, NOW, NEXT, AHEAD):
        state[field + i] = position
    for field in (RATE_NOW, RATE_NEXT, ACCEL):
        state[field + i] = 0
    state[HEAD + i] = shift_round(position, -16)
    state[HEAD_RATE + i] = shift_round(rate, -12)


@jit.callee
def restart_float(state: np.ndarray, i: int, position: float, rate: float) -> None:
    """As restart_fixed(), in rad."""
    for field in (PAST, NOW, NEXT, AHEAD, HEAD):
        state[field + i] = position
    for field in (RATE_NOW, RATE_NEXT, ACCEL):
        state[field + i] = 0.0
    state[HEAD_RATE + i] = rate


@jit.callee
def wrap_pi(angle: float) -> float:
    """angle modulo a turn, in [-pi, pi]; exact for angles that are there already."""
    if -math.pi <= angle <= math.pi:
        return angle
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


def advance_fixed(state: np.ndarray, par: np.ndarray, inp: np.ndarray) -> bool:
    """One tick; inp[0] fresh, inp[3:6] euler, inp[19:22] set-point. True if the reference started in this tick."""
    started = False
    if state[STARTED] == 0:
        if inp[0] == 0:
            return False
        for i in range(3):
            restart_fixed(state, i, inp[3 + i], 0)
            rate = mul_wide(par[START], wrap32(inp[19 + i] - inp[3 + i]), 30)
            state[HEAD_RATE + i] = clip(rate, -par[RATE_MAX], par[RATE_MAX])
        state[STARTED] = 1
        started = True
    for i in range(3):
        if par[KIND] == REFERENCE_NONE:
            _follow_axis_fixed(state, par[RATE_MAX], shift_round(inp[19 + i], -16), i)
        else:
            _advance_axis_fixed(state, par, inp, i)
    return started


@jit.callee
def _turned_fixed(position: int, goal: int, most: int) -> int:
    """`position` turned towards `goal`, the short way, by no more than `most`; all 2^-48 turn."""
    return wrap_bits(position + clip(wrap_bits(goal - position, 48), -most, most), 48)


@jit.callee
def _follow_axis_fixed(state: np.ndarray, most: int, goal: int, i: int) -> None:
    """The set-point itself, turned by no more than `most` per sample (2^-48 turn)."""
    now = _turned_fixed(state[HEAD + i], goal, most)
    later = _turned_fixed(now, goal, most)
    last = _turned_fixed(later, goal, most)
    state[PAST + i], state[HEAD + i], state[HEAD_RATE + i] = state[NOW + i], now, 0
    state[NOW + i] = wrap32(shift_round(now, 16))
    state[NEXT + i] = wrap32(shift_round(later, 16))
    state[AHEAD + i] = wrap32(shift_round(last, 16))
    state[RATE_NOW + i] = sat32(shift_round(wrap_bits(later - now, 48), 12))
    state[RATE_NEXT + i] = sat32(shift_round(wrap_bits(last - later, 48), 12))
    state[ACCEL + i] = 0


@jit.callee
def _advance_axis_fixed(state: np.ndarray, par: np.ndarray, inp: np.ndarray, i: int) -> None:
    position, rate = state[HEAD + i], state[HEAD_RATE + i]
    error = wrap32(inp[19 + i] - shift_round(position, 16))
    wanted = mul_wide(par[K1], error, 30) - mul_wide(rate, par[K2], 30)
    accel = clip(wanted, -par[ACCEL_MAX], par[ACCEL_MAX])
    rate_new = clip(rate + accel, -par[RATE_MAX], par[RATE_MAX])
    if rate_new == RATE_LIMIT_48 or rate_new == -RATE_LIMIT_48:
        state[SATURATED] = 1
    accel = rate_new - rate
    half = accel if par[KIND] == REFERENCE_PAPER else shift_round(accel, 1)
    position = wrap_bits(position + rate + half, 48)
    state[HEAD + i], state[HEAD_RATE + i] = position, rate_new
    head = wrap32(shift_round(position, 16))
    state[ACCEL + i] = sat32(shift_round(accel, 12))
    state[PAST + i] = state[NOW + i]
    if state[LEAD] == 2:
        state[NOW + i], state[NEXT + i], state[AHEAD + i] = state[NEXT + i], state[AHEAD + i], head
        state[RATE_NOW + i], state[RATE_NEXT + i] = state[RATE_NEXT + i], sat32(shift_round(rate, 12))
    else:
        state[NOW + i], state[NEXT + i] = state[NEXT + i], head
        state[AHEAD + i] = wrap32(shift_round(position + rate_new, 16))
        state[RATE_NOW + i], state[RATE_NEXT + i] = sat32(shift_round(rate, 12)), sat32(shift_round(rate_new, 12))


def advance_float(state: np.ndarray, par: np.ndarray, inp: np.ndarray) -> bool:
    """As advance_fixed(), in rad."""
    started = False
    if state[STARTED] == 0.0:
        if inp[0] == 0.0:
            return False
        for i in range(3):
            restart_float(state, i, inp[3 + i], 0.0)
            rate = par[START] * wrap_pi(inp[19 + i] - inp[3 + i])
            state[HEAD_RATE + i] = min(max(rate, -par[RATE_MAX]), par[RATE_MAX])
        state[STARTED] = 1.0
        started = True
    for i in range(3):
        if par[KIND] == REFERENCE_NONE:
            _follow_axis_float(state, par[RATE_MAX], inp[19 + i], i)
        else:
            _advance_axis_float(state, par, inp, i)
    return started


@jit.callee
def _follow_axis_float(state: np.ndarray, most: float, goal: float, i: int) -> None:
    """As _follow_axis_fixed(), in rad; where the set-point is reached, ym is that number and no other."""
    step = wrap_pi(goal - state[HEAD + i])
    now = goal if abs(step) <= most else state[HEAD + i] + min(max(step, -most), most)
    step_now = min(max(wrap_pi(goal - now), -most), most)
    step_next = min(max(wrap_pi(goal - now - step_now), -most), most)
    state[PAST + i], state[HEAD + i], state[HEAD_RATE + i] = state[NOW + i], now, 0.0
    state[NOW + i], state[NEXT + i], state[AHEAD + i] = now, now + step_now, now + step_now + step_next
    state[RATE_NOW + i], state[RATE_NEXT + i], state[ACCEL + i] = step_now, step_next, 0.0


@jit.callee
def _advance_axis_float(state: np.ndarray, par: np.ndarray, inp: np.ndarray, i: int) -> None:
    position, rate = state[HEAD + i], state[HEAD_RATE + i]
    wanted = par[K1] * wrap_pi(inp[19 + i] - position) - par[K2] * rate
    accel = min(max(wanted, -par[ACCEL_MAX]), par[ACCEL_MAX])
    rate_new = min(max(rate + accel, -par[RATE_MAX]), par[RATE_MAX])
    accel = rate_new - rate
    position = position + rate + (accel if par[KIND] == REFERENCE_PAPER else 0.5 * accel)
    state[HEAD + i], state[HEAD_RATE + i], state[ACCEL + i] = position, rate_new, accel
    state[PAST + i] = state[NOW + i]
    if state[LEAD] == 2.0:
        state[NOW + i], state[NEXT + i], state[AHEAD + i] = state[NEXT + i], state[AHEAD + i], position
        state[RATE_NOW + i], state[RATE_NEXT + i] = state[RATE_NEXT + i], rate
    else:
        state[NOW + i], state[NEXT + i], state[AHEAD + i] = state[NEXT + i], position, position + rate_new
        state[RATE_NOW + i], state[RATE_NEXT + i] = rate, rate_new


def words_fixed(state: np.ndarray, words: np.ndarray) -> None:
    """`words`: reference[3] in bam, reference_rate[3] in bam/sample, from the state in its own units."""
    for i in range(3):
        words[i] = wrap32(state[NOW + i])
        words[3 + i] = sat32(shift_round(state[RATE_NOW + i], 4))


def words_float(state: np.ndarray, words: np.ndarray) -> None:
    """The same from radians."""
    for i in range(3):
        words[i] = wrap32(int(np.rint(state[NOW + i] * 2147483648.0 / math.pi)))
        rate = int(np.rint(state[RATE_NOW + i] * 34359738368.0 / math.pi))
        words[3 + i] = sat32(shift_round(rate, 4))


_run_fixed, _run_float = jit.compile(advance_fixed), jit.compile(advance_float)
_words_fixed, _words_float = jit.compile(words_fixed), jit.compile(words_float)


def parameters_fixed(common: Mapping[str, int]) -> list[int]:
    """Parameter words from CONFIG: k1 Q46, k2 Q30, start Q46, limits in 2^-48 turn.

    The rate is at most 1/4 turn per sample, of the set-point itself 1/2 turn.
    """
    p = common["reference_pole"]
    one_minus, one_plus = (1 << 30) - p, (1 << 30) + p
    zoh = common["reference_kind"] == REFERENCE_ZOH
    k1 = mul_q(one_minus, one_minus, 14)
    k2 = mul_q(one_minus, one_plus + (1 << 31), 31) if zoh else mul_q(one_minus, one_plus, 30)
    ratio = div_trunc(shift_round(one_minus, -31), one_plus)
    start = mul_q(ratio, ratio, 15) if zoh else 0
    accel = shift_round(common["accel_limit"] or INT32_MAX, -16)
    rate = clip(shift_round(common["rate_limit"] or INT32_MAX, -16), 0, RATE_LIMIT_48)
    if common["reference_kind"] == REFERENCE_NONE:
        rate = shift_round(common["rate_limit"], -16) if common["rate_limit"] else HALF_TURN_48
    return [common["reference_kind"], k1, k2, start, accel, rate]


def parameters_float(common: Mapping[str, int]) -> list[float]:
    """The same from the same words, as floats in rad and samples."""
    pole = next(word for word in COMMON if word.name == "reference_pole")
    return float_parameters(
        common["reference_kind"],
        dequantise(pole, common["reference_pole"], common),
        (common["accel_limit"] or INT32_MAX) * 2.0 * math.pi / 2**32,
        common["rate_limit"] * 2.0 * math.pi / 2**32 or math.pi,
    )


def float_parameters(kind: int, p: float, accel_max: float = math.pi, rate_max: float = math.pi) -> list[float]:
    """Parameters of the float form for the pole p; limits in rad per sample (squared)."""
    zoh = kind == REFERENCE_ZOH
    k2 = (1 - p) * (3 + p) / 2 if zoh else 1 - p * p
    start = 2 * ((1 - p) / (1 + p)) ** 2 if zoh else 0.0
    return [float(kind), (1 - p) ** 2, k2, start, accel_max, rate_max]


class Reference:
    """The board's reference model; `state` is what the laws read (see the layout above)."""

    def __init__(self, common: Mapping[str, int], is_float: bool) -> None:
        self._float = is_float
        dtype = np.float64 if is_float else np.int64
        self.par = np.array(parameters_float(common) if is_float else parameters_fixed(common), dtype)
        self.state = np.zeros(SIZE, dtype)
        self.state[LEAD] = common["reference_lead"]
        self._run = _run_float if is_float else _run_fixed
        self._words_of, self._words = _words_float if is_float else _words_fixed, np.zeros(6, np.int64)

    def advance(self, inp: np.ndarray) -> bool:
        """One tick, before the law's step; True if the reference started at this tick's reading (its first)."""
        return bool(self._run(self.state, self.par, inp))

    def words(self) -> tuple[int, ...]:
        """reference[3] in bam and reference_rate[3] in bam/sample, for TELEMETRY."""
        self._words_of(self.state, self._words)
        return tuple(self._words.tolist())
