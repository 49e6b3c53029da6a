"""Words of the law state_space."""

from __future__ import annotations

from protocol.law_words import AUTOMATIC, ERROR_QUATERNION, READ_EULER, LawTable, array, error_word, flag, vector
from protocol.words import Word

ORDER = 8
A_MOST = 1000.0  # of an element of A: its products with a state, of 59 bits, come down to the state's scale
# LQG for J = 1, T_s 0.5 s, n = 1: states angle, rate, torque under way; cost angle^2 + 30 u^2
DEFAULT_A = (0.44866, 0.5, 0.125, *[0.0] * 5, -0.23829, 1.0, 0.5, *[0.0] * 5, -0.157, -0.63885, -0.2998)
DEFAULT_B = (0.55134, 0.23829)
DEFAULT_C = (0.157, 0.63885, 0.2998)

STATE_SPACE = LawTable(
    law_id=7,
    version=1,
    name="state_space",
    params=(
        error_word(ERROR_QUATERNION),
        flag("anti_windup", 0, "while the torque is at its limit, no state moves that would drive it on"),
        Word("state_bits", "", 0, 0, 30, 24, "fractional bits of the states: they reach 2^(31 - state_bits)"),
        Word("A_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of A"),
        Word("B_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of B"),
        Word("C_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of C"),
        Word("D_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of D"),
        Word("axis_gain_bits", "", 0, 0, 45, AUTOMATIC, "fractional bits of gain"),
        *vector("gain", "", "axis_gain_bits", -1e6, 1e6, (2.13, 3.04, 3.09), "what the output is multiplied with"),
        *array("A", "", "A_bits", -A_MOST, A_MOST, (ORDER, ORDER), "state to state of the next tick", DEFAULT_A),
        *array("B", "1/rad", "B_bits", -1e6, 1e6, (ORDER,), "error to state", DEFAULT_B),
        *array("C", "N m", "C_bits", -1e6, 1e6, (ORDER,), "state to output", DEFAULT_C),
        Word("D", "N m/rad", "D_bits", -1e6, 1e6, 0.0, "error to output"),
    ),
    telemetry=vector("error", "rad", 29, -4, 4, (0, 0, 0), "ym(k) - y(k)"),
    transport_delays=(0, 1, 2, 3, 4),
    period_s=(0.001, 10.0),
    reference_leads=(2, 1),
    needs=READ_EULER,
    has_model=False,
    arrays={"A": ("n", "n"), "B": ("n",), "C": ("n",)},
    sizes={"n": ORDER},
)
