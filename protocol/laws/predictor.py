"""Words of the law predictor."""

from __future__ import annotations

from protocol.law_words import AUTOMATIC, ERROR_QUATERNION, READ_EULER, READ_RATE, LawTable, error_word, flag, vector
from protocol.words import Word

INERTIA = (2.13, 3.04, 3.09)

PREDICTOR = LawTable(
    law_id=8,
    version=1,
    name="predictor",
    params=(
        error_word(ERROR_QUATERNION),
        Word("delay_s", "s", 24, 0, 60, 0, "how old a reading is when it comes, at most 250 periods"),
        Word("wn_radps", "rad/s", 24, 1e-4, 100, 0.5, "natural frequency of the loop without delay"),
        Word("zeta", "", 24, 0, 10, 0.9, "its damping"),
        Word("observer_pole", "", 30, 0, 0.999, 0.8, "double pole of the estimates; 0: the rate as it is read"),
        flag("disturbance", 1, "estimate a constant torque from outside, and give its opposite"),
        Word("inertia_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of inertia_kgm2"),
        *vector("inertia_kgm2", "kg m^2", "inertia_bits", 1e-6, 1e6, INERTIA, "principal inertia the law believes in"),
    ),
    telemetry=(
        *vector("error", "rad", 28, -7, 7, (0, 0, 0), "predicted attitude less ym(k)"),
        *vector("rate", "rad/s", 24, -100, 100, (0, 0, 0), "predicted rate"),
        *vector("disturbance", "N m", 24, -100, 100, (0, 0, 0), "estimated disturbance"),
    ),
    transport_delays=(0, 1, 2, 3, 4),
    period_s=(0.001, 10.0),
    reference_leads=(2, 1),
    needs=READ_EULER | READ_RATE,
    float_only=True,
)
