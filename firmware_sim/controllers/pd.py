"""pd"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba.extending import register_jitable

from firmware_sim import jit
from firmware_sim.controllers.compiled import CompiledLaw, Field, Step, offsets
from firmware_sim.guidance.reference import NOW, wrap_pi
from protocol.law_tables import Configuration

STATE = (
    Field("reading", 3, "turn", 32),
    Field("rate", 3, "", 0),
    Field("command", 3, "N m", 28),
    Field("error", 3, "turn", 32),
    Field("gap", 1, "tick", 0),
)
READING, RATE, COMMAND, ERROR, GAP = offsets(STATE)
KP, KD, LIMIT = 0, 3, 6


@register_jitable
def step_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    out[:] = 0.0
    fresh = inp[0] != 0.0
    if s[GAP] == 0.0 and not fresh:
        out[3] = 32.0
        return
    if not fresh:
        s[GAP] = min(s[GAP] + 1.0, 1000.0)
        for i in range(3):
            out[i] = s[COMMAND + i]
        return
    for i in range(3):
        if s[GAP] > 0.0:
            s[RATE + i] = wrap_pi(inp[3 + i] - s[READING + i]) / s[GAP]
        s[READING + i] = inp[3 + i]
        s[ERROR + i] = wrap_pi(ref[NOW + i] - inp[3 + i])
        u = par[KP + i] * s[ERROR + i] - par[KD + i] * s[RATE + i]
        s[COMMAND + i] = min(max(u, -par[LIMIT + i]), par[LIMIT + i])
        if s[COMMAND + i] != u:
            out[3] = 1.0
        out[i] = s[COMMAND + i]
    s[GAP] = 1.0


@jit.compile
def _run_float(s: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    step_float(s, par, inp, ref, out)


class Pd(CompiledLaw):
    STATE = STATE
    has_model = False

    @staticmethod
    def float_par(configuration: Configuration) -> Sequence[float]:
        ts = configuration.values["period_us"] * 1e-6
        return [*configuration.vector("kp"), *(k / ts for k in configuration.vector("kd")), *configuration.vector("torque_limit")]

    @staticmethod
    def float_step() -> Step:
        return _run_float
