"""Time of one law step on the board, Python wrapper included: python -m firmware_sim.law_bench [--json] [--rounds N].

`sil bench law` runs it, since the laboratory does not import the board. Per law and form: the median of many short
rounds, and beside it, alternating, the same for a compiled function that takes the same arguments and does nothing:
what calling compiled code from Python costs here.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

import numba
import numpy as np

from firmware_sim.controllers import LAWS, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration

STEPS = 20  # of a round


def main() -> None:
    """Print the table, or a JSON list of one object per law and form."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200, help=f"rounds of {STEPS} steps")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = [law_times(name, form, options.rounds) for name in LAWS for form in forms_of(name)]
    if options.json:
        print(json.dumps(rows))
        return
    print(f"{'law':12}{'form':8}{'step us':>10}{'empty us':>10}{'best us':>10}")
    for row in rows:
        print(f"{row['law']:12}{row['form']:8}{row['step_us']:10.2f}{row['empty_us']:10.2f}{row['best_us']:10.2f}")


def forms_of(name: str) -> tuple[str, ...]:
    """The forms that a law has."""
    return ("float",) if law_by_name(name).float_only else ("float", "fixed")


def law_times(name: str, form: str, rounds: int) -> dict[str, Any]:
    """law, form; step_us and empty_us: medians over the rounds; best_us: the best round's step."""
    configuration = parse_configuration(config_words(law_by_name(name), {"form": form}))
    dtype = np.float64 if form == "float" else np.int64
    law, reference = new_law(name, configuration), Reference(configuration.common, form == "float")
    ticks = _inputs(configuration.common, dtype)
    out, state, par = (np.zeros(size, dtype) for size in (4, 100, 50))
    empty = numba.njit(_nothing)

    def bare(inp: np.ndarray) -> None:
        empty(state, par, inp, reference.state, out)

    def step(inp: np.ndarray) -> None:
        law.step(inp, reference.state, out)

    bare(ticks[0])
    law.warm_up(ticks[0], reference.state, out)
    steps, empties = [], []
    for _ in range(rounds):
        reference.advance(ticks[0])
        steps.append(_round_us(step, ticks))
        empties.append(_round_us(bare, ticks))
    return {
        "law": name,
        "form": form,
        "step_us": statistics.median(steps),
        "empty_us": statistics.median(empties),
        "best_us": min(steps),
    }


def _nothing(state: np.ndarray, par: np.ndarray, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
    """Compiled, it is the price of a call."""


def _inputs(common: Mapping[str, int], dtype: type) -> list[np.ndarray]:
    """What a law is given in STEPS ticks: every reading there, angles and torque moving, so that it identifies."""
    ticks = []
    for k in range(STEPS):
        inp = np.zeros(inputs.SIZE)
        phase = 2.0 * math.pi * k / STEPS
        inp[inputs.FRESH], inp[inputs.GOOD_RUN], inp[inputs.APPLIED_KNOWN], inp[inputs.TICK] = 1, 100, 1, k
        inp[inputs.EULER] = [0.1 * math.sin(phase + axis) for axis in range(3)]
        inp[inputs.APPLIED] = [-0.02 * math.sin(phase + axis) for axis in range(3)]
        ticks.append(inp if dtype is np.float64 else np.rint(inp / inputs.si_scale(common)).astype(dtype))
    return ticks


def _round_us(call: Callable[[np.ndarray], None], ticks: list[np.ndarray]) -> float:
    began = time.perf_counter()
    for inp in ticks:
        call(inp)
    return (time.perf_counter() - began) / len(ticks) * 1e6


if __name__ == "__main__":
    main()
