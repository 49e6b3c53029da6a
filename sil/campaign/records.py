"""What became of one point, as a line of results.jsonl and as a row of results.csv."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sil.scenario_metrics import METRICS
from sil.trouble import EXIT_LINK, EXIT_USAGE

XYZ = ("x", "y", "z", "max")


class Record(NamedTuple):
    """One finished point. metrics: `rms_error_deg.roll` and so on, None where there is no number."""

    point: int
    verdict: str  # as in summary.json of a run; invalid: the scenario refuses it
    exit_code: int  # what `sil run` would have returned
    reason: str
    metrics: dict[str, float | None]
    sha256: str = ""
    wall_s: float = 0.0
    run_dir: str = ""  # where the run was kept

    def line(self) -> str:
        """One line of results.jsonl."""
        return json.dumps(self._asdict(), allow_nan=False) + "\n"


def record_of(point: int, summary: Mapping[str, Any], wall_s: float) -> Record:
    """The record of a run that ended, whatever its verdict."""
    return Record(
        point,
        str(summary["verdict"]),
        int(summary["exit_code"]),
        _reason(summary),
        flat_metrics(summary["metrics"]),
        str(summary["sha256"]),
        wall_s,
    )


def refused(point: int, reason: str) -> Record:
    """A point that the scenario does not admit."""
    return Record(point, "invalid", EXIT_USAGE, " ".join(reason.split()), {})


def broken(point: int, reason: str, exit_code: int = EXIT_LINK) -> Record:
    """A point whose run could not be finished: link, board, or the worker itself."""
    return Record(point, "failed", exit_code, " ".join(reason.split()), {})


def flat_metrics(metrics: Mapping[str, Any]) -> dict[str, float | None]:
    """Three numbers become four: one for each axis, and the largest (None where one is missing)."""
    flat: dict[str, float | None] = {}
    for name, value in metrics.items():
        if name == "from_tick":
            continue  # a setting
        if not isinstance(value, Sequence):
            flat[name] = value
            continue
        worst = None if any(item is None for item in value) else max(value)
        parts = METRICS.get(name) or XYZ
        flat |= {f"{name}.{part}": number for part, number in zip(parts, [*value, worst], strict=True)}
    return flat


def _reason(summary: Mapping[str, Any]) -> str:
    """Why it did not pass; "" if it did."""
    reasons = [summary["failure"]] if summary["failure"] else []
    for line in summary["require"]:
        if not line["passed"]:
            got = "none" if line["value"] is None else f"{line['value']:.4g}"
            reasons.append(f"{line['requirement']}, got {got}")
    if summary["not_a_number"]:
        reasons.append("torque or plant was not a number")
    if summary["verdict"] == "degraded":
        reasons.append(f"{summary['timing']['late_ticks']} ticks woke too late")
    if not reasons and summary["reason"] == "diverged" and summary["exit_code"]:
        reasons.append(f"diverged at {summary['metrics']['diverged_at_s']:g} s")
    return " ".join("; ".join(reasons).split())
