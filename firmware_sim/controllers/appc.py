"""appc: adaptive pole placement with an observer, a model in body axes and one filtered gain per axis.

(float form for now)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba.extending import register_jitable

from firmware_sim import jit
from firmware_sim.controllers.compiled import CompiledLaw, Field, Step, offsets
from firmware_sim.controllers.kinematics import forward_float, inverse_float
from firmware_sim.guidance.reference import ACCEL, NEXT, RATE_NEXT, restart_float, wrap_pi
from protocol.law_tables import Configuration

STATE = (
    Field("y", 3, "turn", 32),
    Field("v", 3, "turn/sample", 36),
    Field("w", 3, "turn/sample^2", 36),
    Field("g", 3, "1", 28),
    Field("P", 3, "1", 34),
    Field("applied", 3, "N m", 28),
    Field("applied_before", 3, "N m", 28),
    Field("command", 3, "N m", 28),
    Field("reading", 3, "turn", 32),
    Field("reading_before", 3, "turn", 32),
    Field("innovation", 3, "turn", 32),
    Field("h", 3, "N m s", 28),
    Field("response", 9, "turn/sample^2", 36),
    Field("drive", 9, "turn/sample^2", 36),
    Field("steps", 1, "tick", 0),
    Field("restarted", 1, "", 0),
)
Y, V, W, G, P, APPLIED, BEFORE, COMMAND, READING, READING_BEFORE, INNOVATION, H, RESPONSE, DRIVE, STEPS, RESTARTED = offsets(STATE)
TS, K1, K2, L1, L2, L3, LIMIT, I0, ADAPT, GYRO, W0 = 0, 1, 2, 3, 4, 5, 6, 9, 12, 13, 14

START_STEPS = 4


@register_jitable
def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    out[:] = 0.0
    s[RESTARTED] = 0.0
    fresh = inp[0] != 0.0
    if s[STEPS] == 0.0:
        if not fresh:
            out[3] = 32.0
            return
        for i in range(3):
            s[Y + i] = s[READING + i] = s[READING_BEFORE + i] = inp[3 + i]
    ts2 = par[TS] * par[TS]
    h, gy, b, a, eta, v = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        eta[i] = s[Y + i]
        v[i] = s[V + i]
    # observer
    if s[STEPS] > 0.0:
        for i in range(3):
            h[i] = s[H + i]
            gy[i] = 0.0
        if par[GYRO] != 0.0:
            _gyro_float(s, par, eta, v, h, gy)
        for i in range(3):
            b[i] = (s[APPLIED + i] - gy[i]) * s[G + i] / par[I0 + i] * ts2
        forward_float(eta, v, b, a)
        for i in range(3):
            alpha = a[i] + s[W + i]
            s[Y + i] += s[V + i] + 0.5 * alpha
            s[V + i] += alpha
        for i in range(3):
            s[H + i] -= s[APPLIED + i] * par[TS]
    if fresh:
        for i in range(3):
            e = wrap_pi(inp[3 + i] - s[Y + i])
            s[INNOVATION + i] = e
            s[Y + i] += par[L1] * e
            s[V + i] += par[L2] * e
            s[W + i] += par[L3] * e
            s[H + i] = inp[16 + i]
    # adaptation
    if par[ADAPT] != 0.0 and fresh and inp[1] >= min(3.0, s[STEPS] + 1.0):
        for i in range(3):
            b[i] = wrap_pi(inp[3 + i] - s[READING + i]) - wrap_pi(s[READING + i] - s[READING_BEFORE + i])
        inverse_float(eta, v, b, a)
        for i in range(3):
            ph = 0.5 * (s[APPLIED + i] + s[BEFORE + i]) * ts2 / par[I0 + i]
            z = _washed_float(s, RESPONSE + 3 * i, a[i])
            ph = _washed_float(s, DRIVE + 3 * i, ph)
            if abs(ph) > 1e-4 and s[STEPS] > 24.0:
                p = min(s[P + i] + 1e-6, 0.1)
                gain = p * ph / (1e-7 + ph * ph * p)
                g = s[G + i] + gain * (z - ph * s[G + i])
                s[P + i] = p - gain * ph * p
                s[G + i] = min(max(g, 0.6), 1.7)
    # what acts now
    for i in range(3):
        s[BEFORE + i] = s[APPLIED + i]
        s[APPLIED + i] = inp[13 + i] if inp[2] != 0.0 else s[COMMAND + i]
        if fresh:
            s[READING_BEFORE + i] = s[READING + i]
            s[READING + i] = inp[3 + i]
    # prediction
    for i in range(3):
        eta[i] = s[Y + i]
        v[i] = s[V + i]
        h[i] = s[H + i]
        gy[i] = 0.0
    if par[GYRO] != 0.0:
        _gyro_float(s, par, eta, v, h, gy)
    for i in range(3):
        b[i] = (s[APPLIED + i] - gy[i]) * s[G + i] / par[I0 + i] * ts2
    forward_float(eta, v, b, a)
    for i in range(3):
        alpha = a[i] + s[W + i]
        eta[i] += v[i] + 0.5 * alpha
        v[i] += alpha
    if s[STEPS] < START_STEPS:
        for i in range(3):
            if s[STEPS] < START_STEPS - 1:
                restart_float(ref, i, s[Y + i], 0.0)
            else:
                restart_float(ref, i, s[Y + i] + s[V + i], s[V + i])
        s[RESTARTED] = 1.0
        s[STEPS] += 1.0
        for i in range(3):
            s[COMMAND + i] = 0.0
        out[3] = 32.0
        return
    s[STEPS] = min(s[STEPS] + 1.0, 1000.0)
    for i in range(3):
        e1 = wrap_pi(eta[i] - ref[NEXT + i])
        e2 = v[i] - ref[RATE_NEXT + i]
        a[i] = ref[ACCEL + i] - par[K1] * e1 - par[K2] * e2 - s[W + i]
    inverse_float(eta, v, a, b)
    for i in range(3):
        a[i] = b[i] * par[I0 + i] / s[G + i] / ts2
    if par[GYRO] != 0.0:
        for i in range(3):
            h[i] = s[H + i] - s[APPLIED + i] * par[TS]
        _gyro_float(s, par, eta, v, h, gy)
        for i in range(3):
            a[i] += gy[i]
    for i in range(3):
        u = min(max(a[i], -par[LIMIT + i]), par[LIMIT + i])
        if u != a[i]:
            out[3] = 1.0
        s[COMMAND + i] = u
        out[i] = u


@register_jitable
def _washed_float(s: np.ndarray, first: int, x: float) -> float:
    s[first] += 0.2 * (x - s[first])
    s[first + 1] += 0.2 * (s[first] - s[first + 1])
    s[first + 2] += 0.03 * (s[first + 1] - s[first + 2])
    return s[first + 1] - s[first + 2]


@register_jitable
def _gyro_float(
    s: np.ndarray, par: np.ndarray, eta: np.ndarray, v: np.ndarray, h: np.ndarray, u: np.ndarray
) -> None:
    sf, cf, st, ct = math.sin(eta[0]), math.cos(eta[0]), math.sin(eta[1]), math.cos(eta[1])
    sp, cp = math.sin(eta[2]), math.cos(eta[2])
    ts = par[TS]
    om = np.empty(3)
    om[0] = (v[0] - v[2] * st) / ts
    om[1] = (v[1] * cf + v[2] * sf * ct) / ts
    om[2] = (-v[1] * sf + v[2] * cf * ct) / ts
    # C [0, -w0, 0]
    wr = np.empty(3)
    wr[0] = -par[W0] * ct * sp
    wr[1] = -par[W0] * (sf * st * sp + cf * cp)
    wr[2] = -par[W0] * (cf * st * sp - sf * cp)
    L = np.empty(3)
    for i in range(3):
        L[i] = par[I0 + i] / s[G + i] * (om[i] + wr[i]) + h[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        wj, wk = om[j] + wr[j], om[k] + wr[k]
        u[i] = wj * L[k] - wk * L[j] - par[I0 + i] / s[G + i] * (om[j] * wr[k] - om[k] * wr[j])


@jit.compile
def _run_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    step_float(s, par, inp, ref, out)


class Appc(CompiledLaw):
    STATE = STATE

    @staticmethod
    def float_par(configuration: Configuration) -> Sequence[float]:
        v = configuration.values
        pc, po = v["controller_pole"], v["observer_pole"]
        # error poly of [y,v,w] current estimator with triple pole
        l1 = 1 - po**3
        l3 = (1 - po) ** 3
        l2 = 1.5 * (1 - po) ** 2 * (1 + po)
        return [
            v["period_us"] * 1e-6, (1 - pc) ** 2, (1 - pc) * (3 + pc) / 2, l1, l2, l3,
            *configuration.vector("torque_limit"), *configuration.vector("inertia_kgm2"),
            v["adapt"], v["gyro"], v["orbit_rate_radps"],
        ]

    @staticmethod
    def float_step() -> Step:
        return _run_float

    def initialise(self, state):
        state[G : G + 3] = 1
        state[P : P + 3] = 0.1
