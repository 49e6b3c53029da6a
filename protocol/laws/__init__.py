"""The words of the control laws of firmware_sim/controllers/: a file for each or for a family, a line for each here.

In the order of their ids, which the tables of the firmware and of SPEC.md keep.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from protocol.law_words import LawTable

LAWS: dict[str, str] = {
    "pd": "protocol.laws.pd:PD",
    "mrac": "protocol.laws.mrac:MRAC",
    "appc": "protocol.laws.appc:APPC",
    "fvsc": "protocol.laws.fvsc:FVSC",
    "vsc": "protocol.laws.fvsc:VSC",
    "ifvsc": "protocol.laws.fvsc:IFVSC",
    "state_space": "protocol.laws.state_space:STATE_SPACE",
    "predictor": "protocol.laws.predictor:PREDICTOR",
}
# Those that the C firmware has; to the others a board that runs it answers READY with status 2, unknown law.
IN_C = ("pd", "mrac", "appc", "fvsc", "vsc", "ifvsc", "state_space")


def tables() -> Iterator[LawTable]:
    """The table of every law."""
    for entry in LAWS.values():
        module, _, name = entry.partition(":")
        table: LawTable = getattr(import_module(module), name)
        yield table
