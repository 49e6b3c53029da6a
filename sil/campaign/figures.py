"""A sweep in few numbers: median, 95th percentile and maximum of every metric, verdicts counted, worst exit code."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from sil.campaign.plan import Plan
from sil.campaign.records import Record
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
    names = dict.fromkeys(name for record in records for name in record.metrics)
    return {
        "verdicts": dict(sorted(Counter(record.verdict for record in records).items())),
        "metrics": {name: _statistics(name, records) for name in names},
    }


def _statistics(name: str, records: Sequence[Record]) -> dict[str, Any]:
    """count: points that have a number there; the other figures are over these."""
    having = [(value, record.point) for record in records if (value := record.metrics.get(name)) is not None]
    if not having:
        return {"count": 0, "median": None, "p95": None, "max": None, "max_at_point": None}
    median, p95 = np.percentile(np.array([value for value, _ in having], float), [50.0, 95.0])
    largest, point = max(having, key=lambda pair: (pair[0], -pair[1]))
    return {"count": len(having), "median": float(median), "p95": float(p95), "max": largest, "max_at_point": point}
