"""Words of the law appc."""

from __future__ import annotations

from protocol.law_words import INERTIA_WORDS, READ_EULER, LawTable, flag, vector
from protocol.words import INT32_MAX, Word

APPC = LawTable(
    law_id=3,
    version=2,
    name="appc",
    params=(
        Word("controller_pole", "", 30, 0, 0.99, 0.7, "double pole of the state feedback"),
        Word("observer_pole", "", 30, 0, 0.99, 0.7, "triple pole of the observer"),
        flag("adapt", 1, "adapt the gain g of each axis"),
        flag("gyro", 0, "compensate the gyroscopic torque"),
        *INERTIA_WORDS,
        Word("orbit_rate_radps", "rad/s", 38, 0, 0.007, 1.0830778e-3, "orbital rate w0, used with gyro"),
        flag("recover_torque", 1, "after lost SAMPLEs, take from the wheels' momentum what torque acted"),
    ),
    telemetry=(
        *vector("g", "", 28, 0.6, 1.7, (1, 1, 1), "identified gain: inertia is inertia_kgm2 / g"),
        *vector("P", "", 34, 0, 0.1, (0.1, 0.1, 0.1), "variance of g"),
        *vector("innovation", "2^-32 turn", 0, -(2**31), INT32_MAX, (0, 0, 0), "reading minus prediction"),
        *vector("disturbance", "turn/sample^2", 36, -0.03125, 0.03125, (0, 0, 0), "estimated disturbance w"),
    ),
    transport_delays=(1,),
    period_s=(0.2, 1.0),
    fixed_most_Nm=8.0,  # Q28
    reference_leads=(2,),
    needs=READ_EULER,
    only_321="law_id",  # always: it predicts and steers in Euler angles 3-2-1
)
