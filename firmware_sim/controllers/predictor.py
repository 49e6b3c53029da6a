"""predictor: PD on the state that a known delay hides, per axis a double integrator with a constant disturbance.

The readings of tick k are of t_k - delay_s, COMMAND(k) acts from t_(k+n) on. With the inertia J the law believes in:

    w' = (u + D) / J       u(t): the commands that were sent, each over the period in which it acts
    predict                from the last readings (angle y, rate estimate w) to t_(k+n):  turn, w_p
    u(k) = -J (wn^2 e + 2 zeta wn w_p) - D       limited to +-torque_limit, and kept as sent;  e = (y - ym(k)) + turn

y - ym by `error`, attitude_error.py; turn = integral of w. Rate and disturbance are estimated from one reading (or g
periods of T_s) to the next, w_r the rate reading, w_m what the last estimate says of it, p = observer_pole:

    w = w_m + (1 - p^2) (w_r - w_m)       D = D + (1 - p)^2 J / (g T_s) (w_r - w_m)

or, with `disturbance` off, D = 0. Without a reading nothing is estimated and the prediction reaches farther: at most
HISTORY commands back, before that the law takes it that none acted. What acts is what was sent, whatever a thruster
makes of it: a wrong inertia costs most here. No reference rate is fed forward. Float only.
Source: study of paper 000, section 4 (there a delay of whole samples; wn 1.6, zeta 0.9 by hand).
"""

from __future__ import annotations

import numpy as np

from firmware_sim import jit
from firmware_sim.controllers.attitude_error import error_float
from firmware_sim.controllers.compiled import CompiledLaw, LawRefuses, ranges_of
from firmware_sim.controllers.kinematics import triple
from firmware_sim.fields import Field, offsets
from firmware_sim.guidance.reference import NOW
from protocol.law_tables import Configuration
from protocol.laws.predictor import PREDICTOR

HISTORY = 256
MOST_DELAY = 250  # periods

STATE = (
    Field("reading", 3, "rad", 0),
    Field("rate", 3, "rad/s", 0),  # estimate at the time of that reading
    Field("disturbance", 3, "N m", 0),
    Field("sent", 3 * HISTORY, "N m", 0),  # u(k-1), u(k-2), ... axis after axis
    Field("error", 3, "rad", 0),
    Field("predicted_rate", 3, "rad/s", 0),
    Field("command", 3, "N m", 0),
    Field("gap", 1, "tick", 0),  # ticks since the last reading, this one not counted; 0 before the first
)
READING, RATE, DISTURBANCE, SENT, ERROR, PREDICTED, COMMAND, GAP = offsets(STATE)
PAR = (
    Field("inertia", 3, "kg m^2", 0),
    Field("stiffness", 1, "1/s^2", 0),
    Field("damping", 1, "1/s", 0),
    Field("rate_gain", 1, "", 0),
    Field("disturbance_gain", 1, "1/s", 0),
    Field("delay", 1, "periods", 0),
    Field("period", 1, "s", 0),
    Field("transport", 1, "tick", 0),
    Field("limit", 3, "N m", 0),
    Field("error_kind", 1, "", 0),
    Field("sequence", 1, "", 0),
)
INERTIA, STIFFNESS, DAMPING, RATE_GAIN, D_GAIN, DELAY, PERIOD, N, LIMIT, KIND, SEQUENCE = offsets(PAR)


def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """One tick."""
    fresh = inp[0] != 0.0
    out[0], out[1], out[2], out[3] = 0.0, 0.0, 0.0, 0.0
    if s[GAP] == 0.0 and not fresh:
        out[3] = 32.0
        return
    if fresh:
        _take_reading(s, par, inp)
    elif inp[2] != 0.0:  # the watchdog's zero instead of u(k-n)
        for i in range(3):
            s[SENT + HISTORY * i + max(int(par[N]), 1) - 1] = inp[13 + i]
    age = min(par[DELAY] + s[GAP], HISTORY - par[N])
    error = error_float(par[KIND], par[SEQUENCE], triple(s, READING), triple(ref, NOW))
    for i in range(3):
        turn, rate = _flown(s, par, i, age, -par[N])
        s[ERROR + i], s[PREDICTED + i] = error[i] + turn, rate
        wanted = par[STIFFNESS] * s[ERROR + i] + par[DAMPING] * rate
        u = -par[INERTIA + i] * wanted - s[DISTURBANCE + i]
        s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
        if s[COMMAND + i] != u:
            out[3] = 1.0
        out[i] = s[COMMAND + i]
        for j in range(HISTORY - 1, 0, -1):
            s[SENT + HISTORY * i + j] = s[SENT + HISTORY * i + j - 1]
        s[SENT + HISTORY * i] = s[COMMAND + i]
    s[GAP] = min(s[GAP] + 1.0, 1e6)


@jit.callee
def _take_reading(s: np.ndarray, par: np.ndarray, inp: np.ndarray) -> None:
    """Angle as it is; rate and disturbance by what the last estimate says of this rate. Then GAP = 0."""
    age = min(par[DELAY] + s[GAP], HISTORY - par[N])
    for i in range(3):
        s[READING + i] = inp[3 + i]
        if s[GAP] == 0.0:
            s[RATE + i] = inp[10 + i]
            continue
        _, rate = _flown(s, par, i, age, par[DELAY])
        innovation = inp[10 + i] - rate
        s[RATE + i] = rate + par[RATE_GAIN] * innovation
        s[DISTURBANCE + i] += par[D_GAIN] * par[INERTIA + i] * innovation / s[GAP]
    s[GAP] = 0.0


@jit.callee
def _flown(s: np.ndarray, par: np.ndarray, i: int, age: float, until: float) -> tuple[float, float]:
    """(turn, rate then) of axis i from t_k - age T_s to t_k - until T_s; u(k-1-j) acts from t_(k-1-j+n) on."""
    turn, rate = 0.0, s[RATE + i]
    for j in range(min(int(age + par[N]), HISTORY - 1), -1, -1):
        begin, end = min(age, j + 1.0 - par[N]), max(until, j - par[N])
        if begin > end:
            dt = (begin - end) * par[PERIOD]
            acceleration = (s[SENT + HISTORY * i + j] + s[DISTURBANCE + i]) / par[INERTIA + i]
            turn += dt * (rate + 0.5 * dt * acceleration)
            rate += dt * acceleration
    return turn, rate


class Predictor(CompiledLaw):
    """The law `predictor`; there is no fixed form."""

    STATE, PAR = STATE, PAR
    RANGES = ranges_of(PREDICTOR.telemetry)
    WORDS = (
        *((ERROR + i, 2.0**-28) for i in range(3)),
        *((PREDICTED + i, 2.0**-24) for i in range(3)),
        *((DISTURBANCE + i, 2.0**-24) for i in range(3)),
    )
    functions = (step_float, step_float)
    compiled = (jit.compile(step_float), jit.compile(step_float))

    @staticmethod
    def float_par(configuration: Configuration) -> list[float]:
        v, common = configuration.values, configuration.common
        period, pole, wn = common["period_us"] * 1e-6, v["observer_pole"], v["wn_radps"]
        delay = v["delay_s"] / period
        delay = round(delay) if abs(delay - round(delay)) < 1e-4 else delay  # a word holds 2^-24 s
        if delay > MOST_DELAY:
            most = f"at most {MOST_DELAY} periods ({MOST_DELAY * period:g} s)"
            raise LawRefuses(f"law predictor: expected delay_s {most}, got {v['delay_s']:g}")
        gains = [wn * wn, 2.0 * v["zeta"] * wn, 1.0 - pole * pole, v["disturbance"] * (1.0 - pole) ** 2 / period]
        times = [float(delay), period, float(common["transport_delay_ticks"])]
        limits, kinds = configuration.vector("torque_limit"), [v["error"], v["attitude_sequence"]]
        return [*configuration.vector("inertia_kgm2"), *gains, *times, *limits, *kinds]

    @staticmethod
    def fixed_par(configuration: Configuration) -> list[int]:
        raise AssertionError("refused before, by its table")
