"""What the firmware costs: instructions per step, stack, code and memory, against limits and a baseline."""

from __future__ import annotations

# What a law in C is measured with, and what is set in it; a law of many sizes with its largest.
SCENARIOS = {"pd": "pd-root-locus", "appc": "appc-rs232", "mrac": "mrac-rs232", "fvsc": "fvsc-rs232",
             "state_space": "pd-root-locus"}  # fmt: skip
_LQG = [[0.44866, 0.5, 0.125], [-0.23829, 1.0, 0.5], [-0.157, -0.63885, -0.2998]]
_ORDER_8 = [[*row, *[0.0] * 5] for row in _LQG] + [[0.0] * n + [0.5] + [0.0] * (7 - n) for n in range(3, 8)]
SETS = {
    "state_space": (
        "law.name=state_space",
        f"law.params.A={_ORDER_8}",
        "law.params.B=[0.55134, 0.23829, 0, 0, 0, 0, 0, 1]",
        "law.params.C=[0.157, 0.63885, 0.2998, 0, 0, 0, 0, 0]",
    )
}
