"""The control laws: a file for each or for a family, a line for each here; float and fixed form side by side."""

from __future__ import annotations

import importlib
from typing import Protocol

import numpy as np

from firmware_sim.controllers.compiled import LawRefuses
from protocol.law_tables import Configuration

__all__ = ["LAWS", "SUPPORT", "Law", "LawRefuses", "new_law", "user_law"]

LAWS: dict[str, str] = {
    "pd": "firmware_sim.controllers.pd:Pd",
    "mrac": "firmware_sim.controllers.mrac:Mrac",
    "appc": "firmware_sim.controllers.appc:Appc",
    "fvsc": "firmware_sim.controllers.fvsc:Fvsc",
    "vsc": "firmware_sim.controllers.fvsc:Vsc",
    "ifvsc": "firmware_sim.controllers.fvsc:Ifvsc",
    "state_space": "firmware_sim.controllers.state_space:StateSpace",
    "predictor": "firmware_sim.controllers.predictor:Predictor",
}
# Files of this folder that are not laws.
SUPPORT = (
    "appc_observer",
    "attitude_error",
    "compiled",
    "fuzzy",
    "gain",
    "gyroscopic",
    "inputs",
    "kinematics",
    "rls",
    "user",
)


class Law(Protocol):
    """One control law in one arithmetic. Arrays are int64 in the fixed form and float64 in the float form."""

    has_model: bool  # without a reading: propagates its model, else repeats its last command
    reference_restarted: bool  # the last step() began the reference anew (bumpless start)

    def step(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """One tick: `inp` and `out` as in inputs.py, `ref` the state of guidance.reference after its advance()."""

    def warm_up(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """Compile what step() needs, without a trace in the law or the arguments."""

    def telemetry(self) -> list[int]:
        """The law's TELEMETRY words, in the order of its table."""


def new_law(name: str, configuration: Configuration) -> Law:
    """The law registered as `name` in the form of the configuration; raises LawRefuses."""
    module, _, attribute = LAWS[name].partition(":")
    law: Law = getattr(importlib.import_module(module), attribute)(configuration)
    return law


def user_law(cls: type, configuration: Configuration) -> Law:
    """A user's own class as a law (float form)."""
    from firmware_sim.controllers.user import UserLaw

    return UserLaw(cls, configuration)
