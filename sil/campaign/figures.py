"""A sweep in few numbers: median, 95th percentile and maximum of every metric, verdicts counted, worst exit code."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from sil.campaign.plan import Plan
from sil.campaign.records import FLOWN, Record
from sil.trouble import EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT


def summarise(plan: Plan, records: Sequence[Record]) -> dict[str, Any]:
    """Over all finished points, and for each cell of the grid over its seeds and draws (cells: [] if there is one)."""
    cells: dict[str, tuple[dict[str, Any], list[Record]]] = {}
    for record in records:
        values = {key: plan.points[record.point - 1].values[key] for key in plan.cell_keys}
        cells.setdefault(json.dumps(values), (values, []))[1].append(record)
    several = len(cells) > 1
    return {
        "name": plan.name,
        "points": len(plan.points),
        "finished": len(records),
        "exit_code": exit_code(records),
        "sample": plan.sample,
        **_figures(records),
        "cells": [{"values": values, **_figures(those)} for values, those in cells.values()] if several else [],
    }


def exit_code(records: Iterable[Record]) -> int:
    """The worst of all points: 3 before 1 before 0. A point that the scenario refused counts as one that failed (1):
    2 is for a sweep that could not begin."""
    codes = {record.exit_code for record in records}
    if EXIT_LINK in codes:
        return EXIT_LINK
    return EXIT_REQUIREMENT if codes - {EXIT_OK} else EXIT_OK


def _figures(records: Sequence[Record]) -> dict[str, Any]:
    """measured: points whose run came to its end (exit code 0 or 1); the metrics are over these. diverged: of these."""
    measured = [record for record in records if record.exit_code in FLOWN]
    names = dict.fromkeys(name for record in records for name in record.metrics)
    return {
        "verdicts": dict(sorted(Counter(record.verdict for record in records).items())),
        "measured": len(measured),
        "excluded": len(records) - len(measured),
        "diverged": sum(record.metrics.get("diverged_at_s") is not None for record in measured),
        "metrics": {name: _statistics(name, measured) for name in names},
    }


def _statistics(name: str, records: Sequence[Record]) -> dict[str, Any]:
    """count: points that have something there, the other figures are over these; never: how many of them are infinite,
    which is more than any number. A figure that is itself infinite is None."""
    having = [(value, record.point) for record in records if (value := record.metrics.get(name)) is not None]
    if not having:
        return {"count": 0, "never": 0, "median": None, "p95": None, "max": None, "max_at_point": None}
    median, p95 = percentiles([value for value, _ in having], (50.0, 95.0))
    largest, point = max(having, key=lambda pair: (pair[0], -pair[1]))
    figures = {"median": median, "p95": p95, "max": largest}
    return {
        "count": len(having),
        "never": sum(math.isinf(value) for value, _ in having),
        **{key: None if math.isinf(value) else value for key, value in figures.items()},
        "max_at_point": point,
    }


def percentiles(values: Sequence[float], percents: Sequence[float]) -> list[float]:
    """Between two neighbours in proportion; infinite where the upper one is."""
    array = np.array(values, float)
    if np.isfinite(array).all():
        return [float(value) for value in np.percentile(array, percents)]
    found = []
    for percent in percents:
        lower, upper = (float(np.percentile(array, percent, method=method)) for method in ("lower", "higher"))
        between = lower != upper and math.isfinite(upper)
        found.append(float(np.percentile(array, percent)) if between else upper)
    return found
