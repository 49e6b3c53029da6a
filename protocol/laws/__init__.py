"""The words of the control laws: one file each, one line here. The laws themselves are in firmware_sim/controllers/.

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
    "state_space": "protocol.laws.state_space:STATE_SPACE",
}
# Those that the C firmware has; to the others a board that runs it answers READY with status 2, unknown law.
IN_C = ("pd", "mrac", "appc", "state_space")


def tables() -> Iterator[LawTable]:
    """The table of every law."""
    for entry in LAWS.values():
        module, _, name = entry.partition(":")
        table: LawTable = getattr(import_module(module), name)
        yield table
