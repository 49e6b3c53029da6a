"""Words of the law pd."""

from __future__ import annotations

from protocol.law_words import AUTOMATIC, ERROR_EULER, READ_EULER, READ_RATE, LawTable, Variant, error_word, vector
from protocol.words import INT32_MAX, Word

RATE_DIFFERENCE, RATE_SENSED = 0, 1

PD = LawTable(
    law_id=1,
    version=2,
    name="pd",
    params=(
        Word("kp_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of kp"),
        Word("kd_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of kd"),
        *vector("kp", "N m/rad", "kp_bits", -1e6, 1e6, (2.1087e-3, 3.0096e-3, 3.0591e-3), "attitude gain"),
        *vector("kd", "N m s/rad", "kd_bits", -1e6, 1e6, (0.03621, 0.05168, 0.05253), "rate gain"),
        Word("rate", "", 0, 0, 1, RATE_DIFFERENCE, "what kd acts on: change of the reading, or the rate sensor",
             ("difference", "sensed")),
        error_word(ERROR_EULER),
    ),
    telemetry=vector("error", "2^-32 turn", 0, -(2**31), INT32_MAX, (0, 0, 0), "ym(k) - y(k), or what error says"),
    transport_delays=(0, 1, 2, 3, 4),
    period_s=(0.001, 10.0),
    fixed_most_Nm=8.0,  # Q28
    reference_leads=(2, 1),
    needs=READ_EULER,
    has_model=False,
    variant_word="rate",
    variants=(
        Variant((0, 1, 2, 3, 4), (2, 1)),
        Variant((0, 1, 2, 3, 4), (2, 1), {}, READ_EULER | READ_RATE),
    ),
)  # fmt: skip
