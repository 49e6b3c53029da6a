"""sil tables: verdicts, the plan of each table, the correction of an error that jumps. Protects what a row says."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sil.campaign import study_000 as study
from sil.campaign import tables
from sil.campaign.plan import Plan, Point
from sil.campaign.records import Record
from sil.scenario import load_scenario
from sil.verbs.tables import _write_csv


def record(number: int, rms: tuple[float, float, float], exit_code: int = 0) -> Record:
    metrics: dict[str, float | None] = {f"rms_error_deg.{a}": v for a, v in zip(tables.AXES, rms, strict=True)}
    return Record(number, "passed", exit_code, "", metrics)


@pytest.mark.parametrize(
    ("printed", "ours", "verdict"),
    [
        ((1.0, 2.0, 3.0), (1.2, 1.7, 3.0), "reproduced"),
        ((1.0, 2.0, 3.0), (1.3, 2.0, 3.0), "not"),
        ((90.0, 30.0, 90.0), (60.0, 10.0, 150.0), "lost as printed"),
        ((90.0, 30.0, 90.0), (1.0, 1.0, 1.0), "not"),
    ],
)
def test_verdicts(printed: tuple[float, float, float], ours: tuple[float, float, float], verdict: str) -> None:
    assert tables._verdict(study.Printed("pd", 0.0, printed), ours) == verdict


def test_the_csv_says_table_and_manoeuvre_and_neither_twice(tmp_path: Path) -> None:
    figures = ((1.0, None), (1.1, 2.0), (1.1, None))
    rows = [tables.Row(name, "pd", 0.2, *figures, "reproduced", "") for name in ("5.7", "train")]
    _write_csv(tmp_path / "t.csv", {"5.7": rows[:1], "comparison": rows[1:]})
    head, *lines = (tmp_path / "t.csv").read_text().splitlines()
    assert head == "table,manoeuvre,law,delay_s,published,ours,ratio,verdict,why"
    assert lines == ["5.7,,pd,0.2,1 -,1.1 2,1.1 -,reproduced,", "comparison,train,pd,0.2,1 -,1.1 2,1.1 -,reproduced,"]


def test_a_run_that_failed_is_not_flown_and_one_that_is_missing_has_no_row() -> None:
    sampling = study.TABLES["5.4"].sampling_at
    points = tuple(Point(i, {"variant": "pd", "sensors.sampling": sampling(d)}) for i, d in enumerate((0.0, 0.01)))
    plan = Plan("x", {}, "", (), points)
    rows = tables.table_rows("5.4", plan, {1: record(1, (1.0, 1.0, 1.0), exit_code=3)})
    assert [(row.delay_s, row.verdict) for row in rows] == [(0.01, "not flown")]


def test_scenarios_have_every_variant_and_delay_that_the_tables_want() -> None:
    for table in study.TABLES.values():
        known = load_scenario(table.scenario).variants
        for row in table.rows:
            assert row.variant in known
    for row in study.TABLES["5.7"].rows[:2]:
        sampling = study.TABLES["5.7"].sampling_at(row.delay_s)
        sets = ["variant=pd", *(f"sensors.sampling.{k}={'null' if v is None else v}" for k, v in sampling.items())]
        assert load_scenario("delay-nanosat", sets).sensors.sampling.delay_s == row.delay_s
    known = load_scenario(study.COMPARISON).variants
    assert {each.variant for each in (*study.COMPARED, *study.LARGEST)} <= set(known)


def test_an_error_that_jumps_counts_half_a_tick_less() -> None:
    """One step of 10 deg on one axis that decays as exp(-t): sampled at ticks of 0.1 s, and in time."""
    T, duration = 0.1, 20.0
    sampled = sum((10 * math.exp(-k * T)) ** 2 for k in range(200)) * T
    exact = 100 / 2
    scenario = {"period_s": T, "duration_s": duration, "guidance": {"rows": [{"attitude_deg": [10, 0, 0]}]}}
    found = tables._in_time(math.sqrt(sampled / duration / 3), scenario, {})
    assert found == pytest.approx(math.sqrt(exact / duration / 3), rel=0.002)
    assert math.sqrt(sampled / exact) > 1.04  # what is corrected
