"""How many frames had which fate, and why: the link's side of summary.json, counted while the log is sealed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sil.sinks.journal import Direction, Fate

FATES = tuple(fate.name.lower() for fate in Fate)


def fates(counted: Mapping[tuple[int, int, str, bool], int]) -> dict[str, dict[str, Any]]:
    """counted: SealReport.fates. `up` and `down`: {frames, delivered, late, ..., copies, causes}.

    Every frame has one fate, so these add up to `frames`; `copies` are further ones, of duplicates, and counted apart.
    causes: {fate: {cause: frames}} of what was not delivered clean.
    """
    return {direction.name.lower(): _one_way(counted, direction) for direction in Direction}


def _one_way(counted: Mapping[tuple[int, int, str, bool], int], direction: Direction) -> dict[str, Any]:
    counts: dict[str, Any] = {"frames": 0, **dict.fromkeys(FATES, 0), "copies": 0}
    causes: dict[str, dict[str, int]] = {}
    for (way, fate, cause, further), count in sorted(counted.items()):
        if way != direction:
            continue
        if further:
            counts["copies"] += count
            continue
        counts["frames"] += count
        counts[FATES[fate]] += count
        if cause:
            causes.setdefault(FATES[fate], {})[cause] = count
    return {**counts, "causes": causes}


def sentence(way: str, counts: Mapping[str, Any]) -> str:
    """`up: 1200 frames, 1100 delivered, 35 late (jitter 35), 65 dropped (burst 9, drop 56), 3 further copies`; "" where
    nothing happened to any of them."""
    if counts["delivered"] == counts["frames"] and not counts["copies"] and not counts["causes"]:
        return ""
    told = [f"{counts['frames']} frames"]
    for fate in FATES:
        if counts[fate]:
            causes = ", ".join(f"{cause} {count}" for cause, count in counts["causes"].get(fate, {}).items())
            told.append(f"{counts[fate]} {fate.replace('_', ' ')}" + (f" ({causes})" if causes else ""))
    if counts["copies"]:
        told.append(f"{counts['copies']} further copies")
    return f"{way}: {', '.join(told)}"
