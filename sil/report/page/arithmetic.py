"""Fixed-point health: ticks with the torque at its limit, saturating operations, how much of each register is used."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from protocol.frames import FLAG_ARITHMETIC, FLAG_IDENTIFICATION_PAUSED, FLAG_SATURATED, FLAG_WATCHDOG
from protocol.law_tables import COMMON, LAWS, TELEMETRY_COMMON, LawTable, Word, lsb_of
from sil.report.page.columns import spans
from sil.report.signals import controlled
from sil.runs import Array, Run
from sil.sinks.decoding import turns_of

_FLAGS = (
    ("torque at its limit", FLAG_SATURATED, "warn"),
    ("an operation saturates", FLAG_ARITHMETIC, "bad"),
    ("identification paused", FLAG_IDENTIFICATION_PAUSED, "calm"),
    ("watchdog: torque zero", FLAG_WATCHDOG, "bad"),
)
REGISTER_BITS = 31  # and a sign
_WRAPS = "2^-32 turn"  # binary angles use all of their register by design


def arithmetic(run: Run) -> dict[str, Any] | None:
    """None where no board computed."""
    if not controlled(run):
        return None
    commands = run.commands
    states = []
    for name, flag, kind in _FLAGS:
        mask = np.isin(run.tick, commands["tick"][(commands["flags"] & flag) != 0])
        times = spans(mask, run.t_s, run.period_s)
        states.append({"name": name, "kind": kind, "ticks": int(mask.sum()), "spans": times})
    return {
        "form": str((run.scenario.get("law") or {}).get("form") or ""),
        "ticks": len(run),
        "strips": [{"label": state["name"], "states": [state]} for state in states],
        "registers": registers(run),
    }


def registers(run: Run) -> list[list[Any]]:
    """[[word, unit, fractional bits, largest |value|, bits of 31 that it needs], ...] of COMMAND and TELEMETRY.

    The largest of the axes; the float form has none. Angles in turns are left out.
    """
    if (run.scenario.get("law") or {}).get("form") == "float":
        return []
    found: dict[str, list[Any]] = {}
    if len(run.commands):
        bits = run.config_words.get("torque_bits", 30)
        _note(found, "torque", "N m", bits, run.commands["torque_nm"], 2.0**-bits)
    for word in _words(run):
        if word.name in run.telemetry and word.q and not word.unit.startswith(_WRAPS):
            lsb = lsb_of(word, _named(run.config_words))
            name = word.name.rpartition("_")[0] if word.name[-2:] in ("_x", "_y", "_z") else word.name
            _note(found, name, run.units[word.name], -math.log2(lsb), run.telemetry[word.name], lsb * turns_of(word))
    return list(found.values())


def _note(found: dict[str, list[Any]], name: str, unit: str, bits: float, values: Array, lsb: float) -> None:
    """The larger of what is known of this word and these values."""
    finite = np.abs(values[np.isfinite(values)])
    peak = float(finite.max()) if finite.size else 0.0
    used = math.log2(peak / lsb + 1.0)
    if name not in found or used > found[name][4]:
        found[name] = [name, unit, round(bits, 2), peak, round(used, 1)]


def _words(run: Run) -> tuple[Word, ...]:
    table = _table(run)
    return (*TELEMETRY_COMMON, *(table.telemetry if table else ()))


def _table(run: Run) -> LawTable | None:
    law = run.meta.get("law")
    if not isinstance(law, Mapping) or "id" not in law:
        return None
    return LAWS.get((int(law["id"]), int(law.get("version", 0))))


def _named(words: Mapping[str, Any]) -> dict[str, int]:
    return {word.name: int(words.get(word.name, word.default)) for word in COMMON if word.name.endswith("_bits")}
