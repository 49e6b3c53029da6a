"""What became of one point, as a line of results.jsonl and as a row of results.csv."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sil.metrics import value_of
from sil.scenario_metrics import METRICS
from sil.trouble import EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT, EXIT_USAGE

XYZ = ("x", "y", "z", "max")
HOST = ("crc_errors", "discarded_bytes")  # of this host's link, not of the test: no table has them
SETTLING, NEVER = "settling_s", "never_settled"
FLOWN = (EXIT_OK, EXIT_REQUIREMENT)  # exit codes of runs that came to their end


class Record(NamedTuple):
    """One finished point. metrics: `rms_error_deg.roll` and so on; None: no number; infinite: it never settled."""

    point: int
    verdict: str  # as in summary.json of a run; invalid: the scenario refuses it
    exit_code: int  # what `sil run` would have returned
    reason: str
    metrics: dict[str, float | None]
    sha256: str = ""
    wall_s: float = 0.0
    run_dir: str = ""  # where the run was kept

    def line(self) -> str:
        """One line of results.jsonl; an infinite metric is the text inf there."""
        metrics = {name: "inf" if value == math.inf else value for name, value in self.metrics.items()}
        return json.dumps({**self._asdict(), "metrics": metrics}, allow_nan=False) + "\n"

    @classmethod
    def read(cls, line: bytes) -> Record:
        """What line() wrote; raises ValueError for anything else."""
        try:
            content: dict[str, Any] = json.loads(line)
            record = cls(**content)
            metrics = {name: math.inf if value == "inf" else value for name, value in content["metrics"].items()}
            numbers = all(value is None or isinstance(value, int | float) for value in metrics.values())
            if not numbers or not isinstance(record.point, int) or not isinstance(record.exit_code, int):
                raise TypeError("not the types of a record")
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise ValueError(f"expected a record, got {line[:60]!r}") from error
        return record._replace(metrics={name: value for name, value in metrics.items() if name not in HOST})


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
    return Record(point, "invalid", EXIT_USAGE, _line(reason), {})


def broken(point: int, reason: str, exit_code: int = EXIT_LINK) -> Record:
    """A point whose run could not be finished: link, board, or the worker itself."""
    return Record(point, "failed", exit_code, _line(reason), {})


def flat_metrics(metrics: Mapping[str, Any]) -> dict[str, float | None]:
    """Three numbers become four: one for each axis, and `.max` as a requirement has it.

    metrics: as in summary.json. Of settling_s null is an axis without a step, or one that never settled (infinite) if
    `never_settled` names it; of all others it is what is not a number, and so is the largest of three then.
    """
    flat: dict[str, float | None] = {}
    for name, value in metrics.items():
        if name in ("from_tick", NEVER, *HOST):
            continue  # a setting; a note; of the host
        if not isinstance(value, Sequence):
            flat[name] = value
            continue
        parts = METRICS.get(name) or XYZ
        whole = {
            name: [_meant(name, item, part, metrics.get(NEVER, ())) for item, part in zip(value, parts, strict=False)]
        }
        for part in parts:
            number = value_of(whole, f"{name}.{part}")
            flat[f"{name}.{part}"] = None if number is None or math.isnan(number) else number
    return flat


def _meant(name: str, item: float | None, part: str, never: Sequence[str]) -> float | None:
    """What null stands for."""
    if item is not None:
        return item
    return math.nan if name != SETTLING else math.inf if part in never else None


def _reason(summary: Mapping[str, Any]) -> str:
    """Why it did not pass; "" if it did."""
    reasons = [summary["failure"]] if summary["failure"] else []
    for line in summary["require"]:
        if not line["passed"]:
            got = line.get("reason") or ("none" if line["value"] is None else f"{line['value']:.4g}")
            reasons.append(f"{line['requirement']}, got {got}")
    if summary["not_a_number"]:
        reasons.append("torque or plant was not a number")
    if summary["verdict"] == "degraded":
        reasons.append(f"{summary['timing']['late_ticks']} ticks woke too late")
    if not reasons and summary["reason"] == "diverged" and summary["exit_code"]:
        reasons.append(f"diverged at {summary['metrics']['diverged_at_s']:g} s")
    return _line("; ".join(reasons))


def _line(text: str) -> str:
    """In one line, and such that a file can hold it."""
    return " ".join(text.encode(errors="backslashreplace").decode().split())
