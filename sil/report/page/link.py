"""The link's health: how many frames had which fate and why, when commands were missing, what the board did instead."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from sil.link_counts import FATES, fates
from sil.report.page.columns import spans
from sil.report.signals import controlled
from sil.runs import Array, Run
from sil.sinks.journal import Direction, Fate

_WAYS = {"up": "SAMPLE and CONFIG, to the board", "down": "COMMAND, TELEMETRY and EVENT, from the board"}
_COUNTERS = {
    "missed": "commands missed",
    "late": "commands late",
    "real_misses": "missed on the clock only",
    "overruns": "board busy",
    "restarts": "restarts nobody asked for",
    "crc_errors": "CRC errors",
    "discarded_bytes": "bytes discarded",
    "duplicates": "frames twice",
    "sequence_gaps": "gaps in the numbers",
    "strangers": "datagrams of strangers",
    "strays": "frames of no tick",
}
_ACTS = (("held", 2, "warn"), ("zero", 0, "bad"))
_USED = (("propagated", 2, "warn"), ("repeated", 3, "warn"), ("restarted", 4, "bad"), ("reused", 5, "bad"))


def link(run: Run) -> dict[str, Any] | None:
    """None where there was no board to talk to."""
    if not controlled(run):
        return None
    counted = run.summary.get("fates") or _counted(run)
    counters = run.summary.get("link") or {}
    return {
        "fates": list(FATES),
        "ways": [_way(way, about, counted.get(way) or {}) for way, about in _WAYS.items()],
        "counters": [[_COUNTERS[name], count] for name, count in counters.items() if name in _COUNTERS],
        "strips": strips(run),
    }


def _way(way: str, about: str, counts: Mapping[str, Any]) -> dict[str, Any]:
    causes = counts.get("causes") or {}
    return {
        "way": way,
        "about": about,
        "frames": counts.get("frames", 0),
        "copies": counts.get("copies", 0),
        "counts": [counts.get(fate, 0) for fate in FATES],
        "causes": [
            [fate.replace("_", " "), cause, n] for fate, by_cause in causes.items() for cause, n in by_cause.items()
        ],
    }


def _counted(run: Run) -> dict[str, Any]:
    """From the frames themselves, where no summary tells."""
    tally: Counter[tuple[int, int, str, bool]] = Counter()
    for row in run.packets:
        tally[Direction[row.direction.upper()], Fate[row.fate.upper()], row.cause, row.copy > 0] += 1
    return fates(tally)


def strips(run: Run) -> list[dict[str, Any]]:
    """States over time, only what is not as it should be: [{label, states: [{name, kind, ticks, spans}]}]."""
    truth, down = run.truth, run.commands
    frames = (("SAMPLE, to the board", run.samples), ("COMMAND, from the board", down))
    made = [_strip(run, label, rows["tick"], rows["fate"], _fate_states()) for label, rows in frames]
    made.append(_strip(run, "the board steps on", down["tick"], down["used"], _USED))
    made.append(_strip(run, "torque that acts", truth["tick"], truth["source"], _ACTS))
    return made


def _fate_states() -> tuple[tuple[str, int, str], ...]:
    kinds = {Fate.LATE: "warn", Fate.DROPPED: "bad", Fate.CORRUPTED: "odd", Fate.IN_FLIGHT: "calm"}
    return tuple((fate.name.lower().replace("_", " "), int(fate), kind) for fate, kind in kinds.items())


def _strip(
    run: Run, label: str, ticks: Array, values: Array, states: tuple[tuple[str, int, str], ...]
) -> dict[str, Any]:
    found = []
    for name, number, kind in states:
        mask = np.isin(run.tick, ticks[values == number])
        if mask.any():
            times = spans(mask, run.t_s, run.period_s)
            found.append({"name": name, "kind": kind, "ticks": int(mask.sum()), "spans": times})
    return {"label": label, "states": found}


def between(run: Run, begins: int, ends: int, of_kind: bool = False) -> list[list[float]]:
    """[[from, to], ...] in s from an event to the next one that ends it, or to the end of the run.

    of_kind: the one that ends it has the same two numbers. What lasts from the first tick to the last is left out.
    """
    over = float(run.t_s[-1]) + run.period_s
    found = []
    for start in (event for event in run.events if event.code == begins):
        stops = (
            event.t_s
            for event in run.events
            if event.code == ends and event.t_s > start.t_s and (not of_kind or event[4:6] == start[4:6])
        )
        found.append([start.t_s, min(stops, default=over)])
    return [span for span in found if span != [float(run.t_s[0]), over]]
