"""A sweep's directory: nothing that is finished gets lost, nothing that is torn gets in, and the tables are exact."""

from __future__ import annotations

import csv
import json

import pytest

from sil.campaign import results
from sil.campaign.conditions import conditions_from
from sil.campaign.figures import exit_code, summarise
from sil.campaign.plan import make_plan
from sil.campaign.records import Record, broken, flat_metrics, refused
from sil.scenario import load_scenario
from sil.trouble import UsageError


@pytest.fixture
def plan():
    scenario = load_scenario("mrac-rs232", ["board=inproc", "duration_s=5"])
    return make_plan(scenario, conditions_from(None, ["law.params.c2_pole=0.7,0.8", "seed=1:3"], None, None, None))


def passed(point, rms):
    return Record(point, "passed", 0, "", {"rms_error_deg.max": rms, "missed": 0}, f"sha{point}", 0.1 * point)


def rows(folder):
    with open(folder / "results.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_tables_are_in_the_order_of_the_plan_whatever_finished_first(tmp_path, plan):
    for folder, order in (("a", (1, 2, 3, 4, 5, 6)), ("b", (6, 3, 1, 2, 5, 4))):
        (tmp_path / folder).mkdir()
        opened = results.create(tmp_path / folder, plan)
        for number in order:
            opened.add(passed(number, number / 3)._replace(wall_s=0.0 if folder == "a" else 5.0))
        opened.finish()
        opened.close()
    for name in ("plan.json", "results.csv", "results.json", "summary.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    table = rows(tmp_path / "a")
    assert [row["point"] for row in table] == list("123456")
    assert float(table[3]["rms_error_deg.max"]) == 4 / 3  # every digit
    assert (table[3]["law.params.c2_pole"], table[3]["seed"], table[3]["sha256"]) == ("0.8", "1", "sha4")
    points = json.loads((tmp_path / "a" / "results.json").read_text())["points"]
    assert points[3]["values"] == {"law.params.c2_pole": 0.8, "seed": 1}


@pytest.mark.parametrize(
    ("damage", "left", "torn"),
    [
        (lambda text: text[:-20], {1, 2}, 1),  # the power went while the last line was written
        (lambda text: text + '{"point": 4, "ver', {1, 2, 3}, 1),
        (lambda text: text.replace('"point": 2', '"point": #'), {1, 3}, 1),
        (lambda text: text.replace('"point": 3', '"point": 99'), {1, 2}, 1),
        (lambda text: text[:10], set(), 0),
        (lambda text: text, {1, 2, 3}, 0),
    ],
)
def test_a_damaged_line_costs_its_point_and_no_other(tmp_path, plan, damage, left, torn):
    opened = results.create(tmp_path, plan)
    for number in (1, 2, 3):
        opened.add(passed(number, 0.5))
    opened.close()
    file = tmp_path / "results.jsonl"
    file.write_text(damage(file.read_text()))
    for _ in range(2):  # what was dropped is gone for good, and what is added then stays
        again = results.reopen(tmp_path)
        assert set(again.records) == left
        assert again.torn == torn
        again.add(passed(5, 0.25))
        again.close()
        left, torn = left | {5}, 0
    assert results.reopen(tmp_path).records[5] == passed(5, 0.25)


def test_results_of_another_plan_are_refused(tmp_path, plan):
    results.create(tmp_path, plan).close()
    file = tmp_path / "plan.json"
    file.write_text(file.read_text().replace("0.8", "0.9"))
    with pytest.raises(UsageError, match="those of another plan"):
        results.reopen(tmp_path)


def test_two_at_the_same_sweep_do_not_mix(tmp_path, plan):
    opened = results.create(tmp_path, plan)
    with pytest.raises(UsageError, match="runs at this moment"):
        results.reopen(tmp_path)
    opened.close()
    results.reopen(tmp_path).close()


def test_figures_are_over_the_points_that_have_them_and_by_cell(plan):
    records = [passed(n, value) for n, value in zip(range(1, 6), (1.0, 2.0, 6.0, None, 5.0), strict=True)]
    records.append(broken(6, "gone"))
    summary = summarise(plan, records)
    figures = summary["metrics"]["rms_error_deg.max"]
    assert figures == {"count": 4, "median": 3.5, "p95": pytest.approx(5.85), "max": 6.0, "max_at_point": 3}
    assert summary["verdicts"] == {"failed": 1, "passed": 5}
    first, second = summary["cells"]
    assert first["values"] == {"law.params.c2_pole": 0.7} and first["metrics"]["rms_error_deg.max"]["median"] == 2.0
    assert second["verdicts"] == {"failed": 1, "passed": 2}
    assert second["metrics"]["rms_error_deg.max"]["count"] == 1


def test_the_worst_point_decides_and_a_refused_one_is_no_pass():
    fine, bad = passed(1, 0.1), passed(2, 0.1)._replace(verdict="failed", exit_code=1)
    assert exit_code([fine, fine]) == 0
    assert exit_code([fine, bad]) == 1
    assert exit_code([fine, refused(3, "no body")]) == 1
    assert exit_code([bad, broken(4, "gone"), fine]) == 3


def test_the_worst_axis_of_a_metric_that_is_not_a_number_is_not_one_either():
    flat = flat_metrics({"rms_error_deg": [1.0, None, 2.0], "peak_torque_Nm": [1.0, 3.0, 2.0], "missed": 4})
    assert flat["rms_error_deg.max"] is None and flat["rms_error_deg.yaw"] == 2.0
    assert flat["peak_torque_Nm.max"] == 3.0 and flat["peak_torque_Nm.y"] == 3.0
    assert flat["missed"] == 4
