"""The tables of a study as sweeps, and what came of them beside what was printed: ratio, verdict, reason.

reproduced       every axis within 25 % of the printed error
lost as printed  both turn beyond 30 deg: how far says nothing
not              anything else
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sil.campaign import study_000 as study
from sil.campaign.conditions import Conditions, Spec
from sil.campaign.plan import Plan
from sil.campaign.records import FLOWN, Record
from sil.scenario import Scenario

VARIANT, SAMPLING, GUIDANCE, ERROR = "variant", "sensors.sampling", "guidance", "law.params.error"
DELAY = "sensors.sampling.delay_s"
AXES = ("roll", "pitch", "yaw")
WITHIN, LOST_DEG = 1.25, 30.0
STEP_S = 0.02
REPRODUCED, LOST, NOT, FAILED = "reproduced", "lost as printed", "not", "not flown"


class Row(NamedTuple):
    """One line of what is printed. published, ours: per axis, or rms and effort; ratio: ours / published."""

    table: str
    law: str
    delay_s: float
    published: tuple[float | None, ...]
    ours: tuple[float, ...]
    ratio: tuple[float | None, ...]
    verdict: str
    why: str


# -- tables 5.4, 5.7, 5.9 ---------------------------------------------------------------------------------------------


def table_conditions(name: str) -> tuple[Conditions, Any]:
    """The sweep of one table: each law at each delay that the table has."""
    table = study.TABLES[name]
    variants = list(dict.fromkeys(row.variant for row in table.rows))
    delays = list(dict.fromkeys(row.delay_s for row in table.rows))
    return _conditions({VARIANT: variants, SAMPLING: [table.sampling_at(delay_s) for delay_s in delays]}), _always


def table_rows(name: str, plan: Plan, records: Mapping[int, Record]) -> list[Row]:
    """Published beside ours; rows of runs that are not finished are left out."""
    found = {(p.values[VARIANT], p.values[SAMPLING]["delay_s"]): records[p.number] for p in _finished(plan, records)}
    rows = []
    for row in study.TABLES[name].rows:
        record = found.get((row.variant, row.delay_s))
        if record is not None:
            ours = tuple(_metric(record, f"rms_error_deg.{axis}") for axis in AXES)
            ratio = _ratios(row.rms_deg, ours)
            rows.append(Row(name, row.variant, row.delay_s, row.rms_deg, ours, ratio, _verdict(row, ours), row.why))
    return rows


def _verdict(row: study.Printed, ours: Sequence[float]) -> str:
    if any(math.isnan(value) for value in ours):
        return FAILED
    if max(row.rms_deg) > LOST_DEG:
        return LOST if max(ours) > LOST_DEG else NOT
    return REPRODUCED if _close(row.rms_deg, ours, WITHIN) else NOT


# -- the comparison ----------------------------------------------------------------------------------------------------


def comparison_conditions() -> tuple[Conditions, Any]:
    """Each law on each manoeuvre at each delay."""
    variants = [each.variant for each in study.COMPARED]
    guidance = list(study.MANOEUVRES.values())
    return _conditions({VARIANT: variants, GUIDANCE: guidance, DELAY: list(study.DELAYS_S)}), _always


def comparison_rows(plan: Plan, records: Mapping[int, Record]) -> list[Row]:
    """rms over all axes and effort, beside the study's; 5 % is asked for."""
    names = {json.dumps(value, sort_keys=True): name for name, value in study.MANOEUVRES.items()}
    printed = {each.variant: each for each in study.COMPARED}
    rows = []
    for point in _finished(plan, records):
        variant, name = point.values[VARIANT], names[json.dumps(point.values[GUIDANCE], sort_keys=True)]
        which = study.DELAYS_S.index(point.values[DELAY])
        record = records[point.number]
        rms = _in_time(_metric(record, "rms_error_deg.all"), plan.scenario, point.values[GUIDANCE])
        ours = (rms, _metric(record, "effort_Nms.total"))
        published = (printed[variant].rms_deg[name][which], printed[variant].effort_Nms[name][which])
        verdict = REPRODUCED if _close(published[:1], ours[:1], 1.05) else NOT
        rows.append(Row(name, variant, point.values[DELAY], published, ours, _ratios(published, ours), verdict, ""))
    return rows


def _in_time(rms_deg: float, scenario: Mapping[str, Any], guidance: Mapping[str, Any]) -> float:
    """The rms over time of an error that jumps at ticks: a mean over ticks counts each jump half a tick too long."""
    if guidance.get("rate_limit_degps"):
        return rms_deg
    before, jumps = [0.0, 0.0, 0.0], 0.0
    for row in guidance.get("rows", scenario["guidance"]["rows"]):
        jumps += sum((new - old) ** 2 for new, old in zip(row["attitude_deg"], before, strict=True))
        before = row["attitude_deg"]
    excess = jumps * scenario["period_s"] / (2 * 3 * scenario["duration_s"])
    return math.sqrt(max(rms_deg**2 - excess, 0.0)) if rms_deg > 0 else rms_deg


# -- largest delays ----------------------------------------------------------------------------------------------------


def largest_conditions() -> tuple[Conditions, Any]:
    """Each law and error, at every 0.02 s around the printed delay."""
    variants = list(dict.fromkeys(each.variant for each in study.LARGEST))
    grid = sorted({delay_s for each in study.LARGEST for delay_s in _grid(each)})
    searched = {(each.variant, each.error): _grid(each) for each in study.LARGEST}

    def flies(cell: Mapping[str, Any]) -> bool:
        return cell[DELAY] in searched.get((cell[VARIANT], cell[ERROR]), ())

    return _conditions({VARIANT: variants, ERROR: ["euler", "quaternion"], DELAY: grid}), flies


def largest_rows(plan: Plan, records: Mapping[int, Record]) -> list[Row]:
    """The last delay before the first with a residual of 2 deg; +-0.02 s is asked for."""
    residual = {
        (p.values[VARIANT], p.values[ERROR], p.values[DELAY]): _metric(records[p.number], "residual_error_deg.all")
        for p in _finished(plan, records)
    }
    rows = []
    for each in study.LARGEST:
        grid = _grid(each)
        values = [residual.get((each.variant, each.error, delay_s), math.nan) for delay_s in grid]
        if any(map(math.isnan, values)):
            continue
        beyond = next((i for i, value in enumerate(values) if value >= study.RESIDUAL_DEG), len(grid))
        ours = grid[beyond - 1] if beyond else math.nan
        verdict = REPRODUCED if abs(ours - each.printed_s) < STEP_S + 1e-9 else NOT
        ratio = _ratios((each.printed_s,), (ours,))
        rows.append(Row(f"error {each.error}", each.variant, ours, (each.printed_s,), (ours,), ratio, verdict, ""))
    return rows


def _grid(each: study.Largest) -> list[float]:
    low, high = each.searched
    return [round(low + i * STEP_S, 2) for i in range(round((high - low) / STEP_S) + 1)]


# -- below ------------------------------------------------------------------------------------------------------------


def needs(scenario: Scenario, conditions: Conditions) -> list[str]:
    """Variants that the sweep wants and the scenario lacks."""
    wanted = next(spec.spec for spec in conditions.specs if spec.key == VARIANT)
    return [name for name in wanted if name not in scenario.variants]


def _conditions(specs: Mapping[str, list[Any]]) -> Conditions:
    return Conditions(tuple(Spec(key, values, "tables") for key, values in specs.items()))


def _always(cell: Mapping[str, Any]) -> bool:
    return True


def _finished(plan: Plan, records: Mapping[int, Record]) -> list[Any]:
    return [point for point in plan.points if point.number in records]


def _metric(record: Record, name: str) -> float:
    """NaN where the run did not come to its end."""
    value = record.metrics.get(name)
    return math.nan if value is None or record.exit_code not in FLOWN else value


def _ratios(published: Sequence[float | None], ours: Sequence[float]) -> tuple[float | None, ...]:
    return tuple(None if p is None or math.isnan(o) else o / p for p, o in zip(published, ours, strict=True))


def _close(published: Sequence[float | None], ours: Sequence[float], factor: float) -> bool:
    return all(p is None or p / factor <= o <= p * factor for p, o in zip(published, ours, strict=True))
