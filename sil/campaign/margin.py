"""The margin map: pointing error and stability over loss, bursts and delays, for each law. A preset of a sweep.

| axis | key | values |
|---|---|---|
| law | law.name | the scenario's own with its parameters, others with their defaults |
| transport delay n | transport_delay_ticks | the scenario's own; others the law allows, with the sensor on time only |
| sensor delay | sensors.attitude.faults | those of the scenario, and one that delays by whole ticks |
| loss and burst | link.faults | both ways: `drop`, independent; or `burst` with a share and a mean length |
| seed | seed | as many as wanted, from the scenario's own on |

A run is *lost* when its attitude went beyond metrics.diverged_deg or was no number; its error counts as infinite.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from protocol.law_tables import LAWS
from sil.campaign import provenance
from sil.campaign.conditions import Conditions, Spec
from sil.campaign.figures import percentiles
from sil.campaign.plan import Plan, sets_of
from sil.campaign.records import FLOWN, Record
from sil.checks import check
from sil.scenario import Scenario, load_values
from sil.scenario_errors import ScenarioInvalid
from sil.trouble import UsageError

LAW, TRANSPORT, SENSOR, LINK, SEED = KEYS = (
    "law.name",
    "transport_delay_ticks",
    "sensors.attitude.faults",
    "link.faults",
    "seed",
)
ERROR, DIVERGED = "rms_error_deg.max", "diverged_at_s"
SETTLED_TICKS = 20  # the start is not pointing
INDEPENDENT = 1.0  # burst length of losses that know nothing of each other


class Wanted(NamedTuple):
    """What the map is over. losses: shares of frames; bursts: mean ticks, 1 independent; delays, transports: ticks."""

    laws: tuple[str, ...]
    losses: tuple[float, ...]
    bursts: tuple[float, ...]
    delays: tuple[int, ...]
    transports: tuple[int, ...]
    seeds: int


class Cell(NamedTuple):
    """One place of the map, over its seeds. rms_deg: worst axis; infinite where half the runs or more are lost."""

    law: str
    transport: int
    delay: int  # of the sensor, ticks
    loss: float
    burst: float  # mean ticks; 0 without loss
    nominal: bool  # the scenario as it is, without loss
    runs: int
    lost: int
    failed: int  # runs that link, board or machine ended: in none of the figures
    rms_deg: float | None  # None: nothing was flown to its end
    p95_deg: float | None
    max_deg: float | None


Flies = Callable[[Mapping[str, Any]], bool]


def default_laws(scenario: Scenario) -> tuple[str, ...]:
    """The scenario's own law first, then the others of the product."""
    own = scenario.law.name
    return (own, *(name for name in sorted({table.name for table in LAWS.values()}) if name != own))


def preset(scenario: Scenario, wanted: Wanted) -> tuple[Conditions, Flies]:
    """The sweep: its conditions, and which places of the grid are flown. Raises UsageError."""
    if not scenario.sensors.attitude.enabled:
        raise UsageError("faults: expected sensors.attitude that is enabled, got none: its delay is an axis of the map")
    own = scenario.transport_delay_ticks
    allowed = {law: _allowed(scenario, law, (own, *wanted.transports)) for law in wanted.laws}
    if not any(allowed.values()):
        raise UsageError(f"faults: expected a law that flies this scenario, got {', '.join(wanted.laws)}, which do not")
    transports = list(dict.fromkeys(n for n in (own, *wanted.transports) if any(n in ns for ns in allowed.values())))
    undelayed = _delayed(scenario, 0)
    specs = {
        LAW: [law for law in wanted.laws if allowed[law]],
        TRANSPORT: transports,
        SENSOR: [_delayed(scenario, ticks) for ticks in dict.fromkeys((0, *wanted.delays))],
        LINK: list(_links(wanted)),
        SEED: [scenario.seed + i for i in range(wanted.seeds)],
    }

    def flies(values: Mapping[str, Any]) -> bool:
        n = values[TRANSPORT]
        return n in allowed[values[LAW]] and (n == own or values[SENSOR] == undelayed)

    return Conditions(tuple(Spec(key, spec, "faults") for key, spec in specs.items())), flies


def _allowed(scenario: Scenario, law: str, transports: Sequence[int]) -> tuple[int, ...]:
    """The transport delays, of these, that the law flies with."""

    directory = Path(provenance.directory_of(scenario))

    def may(n: int) -> bool:
        sets = sets_of({LAW: law, TRANSPORT: n})
        base = {**scenario.resolved(), "out": None}
        try:
            return all(found.severity != "error" for found in check(load_values(base, sets, "scenario", directory)))
        except ScenarioInvalid:
            return False

    return tuple(n for n in dict.fromkeys(transports) if may(n))


def _delayed(scenario: Scenario, ticks: int) -> list[dict[str, Any]]:
    own = [fault.model_dump(mode="json") for fault in scenario.sensors.attitude.faults]
    return own + ([{"kind": "delayed", "delay_s": ticks * scenario.period_s}] if ticks else [])


def _links(wanted: Wanted) -> Iterator[dict[str, Any]]:
    """Faults of the link, both ways: none, then every loss with every burst length."""
    yield {"drop": 0.0, "burst": None}
    for loss in wanted.losses:
        for burst in wanted.bursts:
            if burst == INDEPENDENT:
                yield {"drop": loss, "burst": None}
            else:
                yield {"drop": 0.0, "burst": {"share": loss, "mean_ticks": burst}}


# -- what came of it ---------------------------------------------------------------------------------------------------


def is_map(plan: Plan) -> bool:
    """Whether a sweep was planned as a margin map."""
    return tuple(plan.keys) == KEYS


def cells_of(plan: Plan, records: Mapping[int, Record]) -> list[Cell]:
    """The map in the plan's order; places of which nothing is finished are left out."""
    groups: dict[str, tuple[dict[str, Any], list[Record]]] = {}
    for point in plan.points:
        if (record := records.get(point.number)) is not None:
            place = {key: value for key, value in point.values.items() if key != SEED}
            groups.setdefault(json.dumps(place), (place, []))[1].append(record)
    return [_cell(plan.scenario, place, those) for place, those in groups.values()]


def _cell(scenario: Mapping[str, Any], place: Mapping[str, Any], records: Sequence[Record]) -> Cell:
    loss, burst = _loss_and_burst(place[LINK])
    own_faults = len(scenario["sensors"]["attitude"]["faults"])
    added = place[SENSOR][own_faults:]
    delay = round(added[0]["delay_s"] / scenario["period_s"]) if added else 0
    nominal = not loss and not delay and place[TRANSPORT] == scenario["transport_delay_ticks"]
    flown = [record for record in records if record.exit_code in FLOWN]
    errors = [_error_deg(record) for record in flown]
    rms, p95, most = (*percentiles(errors, (50.0, 95.0)), max(errors)) if errors else (None,) * 3
    lost = sum(math.isinf(error) for error in errors)
    failed = len(records) - len(flown)
    return Cell(place[LAW], place[TRANSPORT], delay, loss, burst, nominal, len(flown), lost, failed, rms, p95, most)


def _loss_and_burst(faults: Mapping[str, Any]) -> tuple[float, float]:
    if (burst := faults["burst"]) is not None:
        return burst["share"], burst["mean_ticks"]
    return faults["drop"], INDEPENDENT if faults["drop"] else 0.0


def _error_deg(record: Record) -> float:
    error = record.metrics.get(ERROR)
    return math.inf if error is None or record.metrics.get(DIVERGED) is not None else error


def csv_text(cells: Sequence[Cell]) -> str:
    """map.csv: a row a cell; inf where runs are lost."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(Cell._fields)
    for cell in cells:
        table.writerow(["" if value is None else value for value in cell])
    return out.getvalue()


def as_json(plan: Plan, cells: Sequence[Cell]) -> dict[str, Any]:
    """map.json: the same; an infinite figure is null there, and `lost` says why."""
    rows = [{name: None if value == math.inf else value for name, value in cell._asdict().items()} for cell in cells]
    limit = plan.scenario["metrics"]["diverged_deg"]
    return {"name": plan.name, "error": ERROR, "lost_beyond_deg": limit, "period_s": plan.scenario["period_s"],
            "cells": rows}  # fmt: skip
