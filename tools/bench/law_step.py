"""Time of one law step on the board, Python wrapper included: best and median of many short rounds.

    python -m tools.bench.law_step
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from firmware_sim.controllers import LAWS, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration

ROUNDS, STEPS = 200, 20


def step_times_us(name: str, form: str) -> list[float]:
    """us per step of law `name`, one figure per round of STEPS steps."""
    configuration = parse_configuration(config_words(law_by_name(name), {"form": form}))
    dtype = np.float64 if form == "float" else np.int64
    law, reference = new_law(name, configuration), Reference(configuration.common, form == "float")
    inp, out = np.zeros(inputs.SIZE, dtype), np.zeros(4, dtype)
    inp[inputs.FRESH], inp[inputs.GOOD_RUN], inp[inputs.APPLIED_KNOWN] = 1, 100, 1
    rounds = []
    for _ in range(ROUNDS):
        reference.advance(inp)
        began = time.perf_counter()
        for _ in range(STEPS):
            law.step(inp, reference.state, out)
        rounds.append((time.perf_counter() - began) / STEPS * 1e6)
    return rounds


def main() -> None:
    """Print the table."""
    print(f"{'law':8}{'form':8}{'best us':>10}{'median us':>12}")
    for name in LAWS:
        for form in ("float", "fixed"):
            times = step_times_us(name, form)
            print(f"{name:8}{form:8}{min(times):10.2f}{statistics.median(times):12.2f}")


if __name__ == "__main__":
    main()
