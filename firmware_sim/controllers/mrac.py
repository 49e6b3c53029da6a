"""mrac"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba.extending import register_jitable

from firmware_sim import jit
from firmware_sim.controllers.compiled import CompiledLaw, Field, Step, offsets
from firmware_sim.controllers.kinematics import forward_float, inverse_float
from firmware_sim.guidance.reference import AHEAD, NEXT, NOW, PAST
from protocol.law_tables import DESIGN_PRINTED, Configuration

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
    Field("steps", 1, "tick", 0),
)
THETA, F, Y1, Y2, Q0, Q1, Q2, COMMAND, ETA, RATE, STEPS = offsets(STATE)
DESIGN, C1, C2, KAPPA, FORGETTING, TRACE_MAX, DECOUPLE, IDENTIFY, TS2, LIMIT, I0, B0_MIN, B0_MAX = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 15, 18)
TURN = 2.0 * math.pi


@register_jitable
def near(angle: float, centre: float) -> float:
    """angle plus the whole turns that bring it within half a turn of centre."""
    return angle + TURN * math.floor((centre - angle) / TURN + 0.5)


@register_jitable
def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    out[:] = 0.0
    fresh = inp[0] != 0.0
    if s[STEPS] == 0.0:
        if not fresh:
            out[3] = 32.0
            return
        for i in range(3):
            s[Y1 + i] = s[Y2 + i] = inp[3 + i]
    printed = par[DESIGN] == 0.0
    # what acts now
    v, b, a, u = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        s[Q2 + i] = s[Q1 + i]
        s[Q1 + i] = s[Q0 + i]
        b[i] = s[COMMAND + i]
        if not printed and inp[2] != 0.0:
            b[i] = inp[13 + i]
        b[i] *= par[TS2] / par[I0 + i]
    if par[DECOUPLE] != 0.0:
        forward_float(s[ETA : ETA + 3], s[RATE : RATE + 3], b, a)
    else:
        a[:] = b
    for i in range(3):
        s[Q0 + i] = a[i] * par[I0 + i] / par[TS2]
    learn = par[IDENTIFY] != 0.0 and fresh and inp[1] >= 3.0 and s[STEPS] >= 3.0
    phi = np.empty(5)
    g = np.empty(5)
    saturated = False
    for i in range(3):
        th = s[THETA + 5 * i : THETA + 5 * i + 5]
        phi[0], phi[1], phi[4] = -s[Y1 + i], -s[Y2 + i], 1.0
        phi[2] = s[Q0 + i] if printed else s[Q1 + i]
        phi[3] = s[Q1 + i] if printed else s[Q2 + i]
        model = phi[0] * th[0] + phi[1] * th[1] + phi[2] * th[2] + phi[3] * th[3] + phi[4] * th[4]
        y = near(inp[3 + i], s[Y1 + i]) if fresh else model
        if learn:
            f = s[F + 25 * i : F + 25 * i + 25]
            trace = f[0] + f[6] + f[12] + f[18] + f[24]
            lam = 1.0 if trace >= par[TRACE_MAX] else par[FORGETTING]
            den = lam
            for m in range(5):
                g[m] = 0.0
                for n in range(5):
                    g[m] += f[5 * m + n] * phi[n]
                den += g[m] * phi[m]
            eps = y - model
            for m in range(5):
                th[m] += g[m] / den * eps
                for n in range(5):
                    f[5 * m + n] = (f[5 * m + n] - g[m] * g[n] / den) / lam
            th[2] = min(max(th[2], par[B0_MIN + i]), par[B0_MAX + i])
        s[Y2 + i] = s[Y1 + i]
        s[Y1 + i] = y
        a1, a2, b0, b1, d = th[0], th[1], th[2], th[3], th[4]
        if printed:
            w0, w1, w2 = near(ref[NEXT + i], y), near(ref[NOW + i], y), near(ref[PAST + i], y)
            s1, t0, t1 = 0.0, par[C1] - a1, par[C2] - a2
        else:
            w0, w1, w2 = near(ref[AHEAD + i], y), near(ref[NEXT + i], y), near(ref[NOW + i], y)
            s1 = par[C1] - a1
            t0, t1 = par[C2] - a2 - a1 * s1, -a2 * s1
            b0 = (b0 + b1) / (1.0 + par[KAPPA])
            b1 = par[KAPPA] * b0
        top = w0 + par[C1] * w1 + par[C2] * w2 - t0 * y - t1 * s[Y2 + i]
        top -= (b1 + b0 * s1) * s[Q0 + i] + b1 * s1 * s[Q1 + i] + (1.0 + s1) * d
        u[i] = top / b0
    if par[DECOUPLE] != 0.0:
        for i in range(3):
            a[i] = u[i] * par[TS2] / par[I0 + i]
            s[ETA + i] = 0.5 * (ref[NEXT + i] + ref[AHEAD + i])
            s[RATE + i] = ref[AHEAD + i] - ref[NEXT + i]
        inverse_float(s[ETA : ETA + 3], s[RATE : RATE + 3], a, b)
        k = 1.0
        for i in range(3):
            u[i] = b[i] * par[I0 + i] / par[TS2]
            if abs(u[i]) > par[LIMIT + i]:
                k = min(k, par[LIMIT + i] / abs(u[i]))
                out[3] = 1.0
        for i in range(3):
            u[i] *= k
    for i in range(3):
        s[COMMAND + i] = min(max(u[i], -par[LIMIT + i]), par[LIMIT + i])
        if s[COMMAND + i] != u[i]:
            out[3] = 1.0
        out[i] = s[COMMAND + i]
    s[STEPS] = min(s[STEPS] + 1.0, 1000.0)


@jit.compile
def _run_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    step_float(s, par, inp, ref, out)


class Mrac(CompiledLaw):
    STATE = STATE

    @staticmethod
    def float_par(configuration: Configuration) -> Sequence[float]:
        v = configuration.values
        pole = v["c2_pole"]
        ts2 = (v["period_us"] * 1e-6) ** 2
        inertia = configuration.vector("inertia_kgm2")
        b = [ts2 / 2 / i for i in inertia]
        printed = v["design"] == 0
        low = [0.01] * 3 if printed else [0.5 * x for x in b]
        high = [10.0] * 3 if printed else [2 * x for x in b]
        return [
            v["design"], -2 * pole, pole * pole, v["kappa"], v["forgetting"], v["trace_max"], v["decouple"],
            v["identify"], ts2, *configuration.vector("torque_limit"), *inertia, *low, *high,
        ]

    @staticmethod
    def float_step() -> Step:
        return _run_float

    def initialise(self, state):
        v = self.configuration.values
        ts2 = (v["period_us"] * 1e-6) ** 2
        for i, axis in enumerate("xyz"):
            b = ts2 / 2 / v[f"inertia_kgm2_{axis}"]
            b0, b1 = (v[f"printed_b0_{axis}"], v[f"printed_b1_{axis}"]) if v["design"] == 0 else (b, b)
            state[THETA + 5 * i : THETA + 5 * i + 5] = -2, 1, b0, b1, 0
            state[F + 25 * i : F + 25 * i + 25 : 6] = v["F0"]
