"""Words of the law mrac."""

from __future__ import annotations

import math

from protocol.law_words import AXES, INERTIA_WORDS, READ_EULER, LawTable, Variant, flag, vector
from protocol.words import Word

DESIGN_PRINTED, DESIGN_REPAIRED = 0, 1

_THETA = ("a1", "a2", "b0", "b1", "d")
MRAC = LawTable(
    law_id=2,
    version=1,
    name="mrac",
    params=(
        Word("design", "", 0, 0, 1, DESIGN_REPAIRED, "d = 1 as printed, or d = 2", ("printed", "repaired")),
        Word("c2_pole", "", 30, 0, 0.999, 0.8, "double pole of the regulation C2 (printed design: 0.001)"),
        Word("kappa", "", 30, 0, 1, 0.5, "repaired: the cancelled zero lies at -kappa"),
        Word("forgetting", "", 30, 0.9, 1, 0.998, "forgetting factor lambda of the identification"),
        Word("trace_max", "", 20, 1, math.inf, 100, "no forgetting while trace F is at or above this"),
        Word("F0", "", 20, 1e-4, 100, 1, "initial covariance, F0 times the identity"),
        flag("decouple", 0, "Euler decoupling along the reference (MID)"),
        flag("identify", 1, "recursive least squares on or off"),
        *INERTIA_WORDS,
        *vector("printed_b0", "rad/(N m)", 30, -1.99, 1.99, (0.307, 0.305, 0.302), "printed design: b0"),
        *vector("printed_b1", "rad/(N m)", 30, -1.99, 1.99, (0.0586, 0.0411, 0.0404), "printed design: b1"),
    ),
    telemetry=(
        *(Word(f"{name}_{axis}", "", 28, -8, 8, 0, f"identified {name}, {axis}") for axis in AXES for name in _THETA),
        *vector("trace", "", 16, 0, 32768, (5, 5, 5), "trace of the covariance F"),
    ),
    transport_delays=(0, 1),
    period_s=(0.2, 1.0),
    fixed_most_Nm=8.0,  # Q28
    reference_leads=(2, 1),
    needs=READ_EULER,
    variant_word="design",
    variants=(Variant((0, 1), (1,), {"c2_pole": 0.001}), Variant((1,), (2,))),
    finite_in_fixed=("trace_max",),  # F is int32 with 20 fractional bits
    only_321="decouple",
)
