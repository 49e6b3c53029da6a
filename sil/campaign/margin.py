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
USUAL_LAWS = ("appc", "mrac", "pd")
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
    """The scenario's own law first, then those whose defaults are for the satellite that scenarios fly by default."""
    own = scenario.law.name
    return (own, *(name for name in USUAL_LAWS if name != own and any(_allowed(scenario, name, _transports(scenario)))))


def _transports(scenario: Scenario, more: Sequence[int] = ()) -> tuple[int, ...]:
    return tuple(dict.fromkeys((scenario.transport_delay_ticks, *more)))


def preset(scenario: Scenario, wanted: Wanted) -> tuple[Conditions, Flies]:
    """The sweep: its conditions, and which places of the grid are flown. Raises UsageError."""
    if not scenario.sensors.attitude.enabled:
        raise UsageError("faults: expected sensors.attitude that is enabled, got none: its delay is an axis of the map")
    own = scenario.transport_delay_ticks
    _refuse_what_overrides(scenario)
    _refuse_places(scenario, wanted)
    allowed = {law: _allowed(scenario, law, _transports(scenario, wanted.transports)) for law in wanted.laws}
    for law, those in allowed.items():
        if not those:
            why = _why_not(scenario, law, own)
            raise UsageError(f"faults: expected a law that flies this scenario, got {law}: {why}")
    transports = [n for n in _transports(scenario, wanted.transports) if any(n in ns for ns in allowed.values())]
    undelayed = _delayed(scenario, 0)
    specs = {
        LAW: list(wanted.laws),
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
    return tuple(n for n in transports if not _why_not(scenario, law, n))


def _why_not(scenario: Scenario, law: str, n: int) -> str:
    """Why the law does not fly with a transport delay of n ticks; "": it does."""
    try:
        found = check(_with(scenario, {LAW: law, TRANSPORT: n}))
    except ScenarioInvalid as error:
        return _first(error)
    return next((f"{one.key}: {one.expected}" for one in found if one.severity == "error"), "")


def _with(scenario: Scenario, values: dict[str, Any]) -> Scenario:
    """The scenario at one place. Raises ScenarioInvalid."""
    base, directory = {**scenario.resolved(), "out": None}, Path(provenance.directory_of(scenario))
    return load_values(base, sets_of(values), "scenario", directory)


def _first(error: ScenarioInvalid) -> str:
    problem = error.problems[0]
    return f"{problem.key}: expected {problem.expected}, got {problem.got}"


def _refuse_what_overrides(scenario: Scenario) -> None:
    """Loss of one direction would stay whatever the map says of both."""
    for name in ("up", "down"):
        way = getattr(scenario.link.faults, name)
        for key in ("drop", "burst"):
            if getattr(way, key) is not None:
                raise UsageError(f"faults: expected no link.faults.{name}.{key}: the map varies loss, both ways alike")


def _refuse_places(scenario: Scenario, wanted: Wanted) -> None:
    """What the scenario does not admit beside its own faults, or no chain of bursts can do, is said before it flies."""
    places: list[tuple[str, dict[str, Any]]]
    places = [(f"--delay {ticks}", {SENSOR: _delayed(scenario, ticks)}) for ticks in wanted.delays]
    for loss in wanted.losses:
        for burst in wanted.bursts:
            places.append((f"--loss {loss:g} --burst {burst:g}", {LINK: _link(loss, burst)}))
    for said, values in places:
        try:
            _with(scenario, values)
        except ScenarioInvalid as error:
            raise UsageError(f"faults: {said}: {_first(error)}") from None


def _delayed(scenario: Scenario, ticks: int) -> list[dict[str, Any]]:
    own = [fault.model_dump(mode="json") for fault in scenario.sensors.attitude.faults]
    return own + ([{"kind": "delayed", "delay_s": ticks * scenario.period_s}] if ticks else [])


def _links(wanted: Wanted) -> Iterator[dict[str, Any]]:
    """Faults of the link, both ways: none, then every loss with every burst length."""
    yield {"drop": 0.0, "burst": None}
    for loss in wanted.losses:
        for burst in wanted.bursts:
            yield _link(loss, burst)


def _link(loss: float, burst: float) -> dict[str, Any]:
    if burst == INDEPENDENT:
        return {"drop": loss, "burst": None}
    return {"drop": 0.0, "burst": {"share": loss, "mean_ticks": burst}}


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
