"""What the firmware costs: instructions per step, stack, code and memory, against limits and a baseline."""

from __future__ import annotations

SCENARIOS = {"pd": "pd-root-locus", "appc": "appc-rs232", "mrac": "mrac-rs232"}  # what a law in C is measured with
