"""A sweep's directory: nothing that is finished gets lost, nothing that is torn gets in, and the tables are exact."""

from __future__ import annotations

import csv
import errno
import json
import math

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
    assert figures == {
        "count": 4, "never": 0, "median": 3.5, "p95": pytest.approx(5.85), "max": 6.0, "max_at_point": 3
    }  # fmt: skip
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


def test_the_worst_axis_is_the_one_a_requirement_has():
    """settling_s.max of an axis without a step was empty here and 39.5 in `sil run`; never was no step."""
    assert flat_metrics({"settling_s": [39.5, None, 12.0]})["settling_s.max"] == 39.5
    assert flat_metrics({"settling_s": [None] * 3, "never_settled": []})["settling_s.max"] is None
    never = flat_metrics({"settling_s": [39.5, None, None], "never_settled": ["yaw"]})
    assert (never["settling_s.max"], never["settling_s.pitch"], never["settling_s.yaw"]) == (math.inf, None, math.inf)


def test_what_belongs_to_the_link_of_this_host_is_in_no_table(tmp_path, plan):
    """Bytes of a table must not depend on the cable; lines of older sweeps still have them."""
    metrics = {"crc_errors": 3, "discarded_bytes": 9, "missed": 1}
    assert flat_metrics(metrics) == {"missed": 1}
    opened = results.create(tmp_path, plan)
    opened.add(passed(1, 0.5)._replace(metrics=metrics))
    opened.close()
    again = results.reopen(tmp_path)
    again.finish()
    again.close()
    for name in ("results.csv", "results.json", "summary.json"):
        text = (tmp_path / name).read_text()
        assert "crc_errors" not in text and "discarded" not in text and "missed" in text


def test_runs_that_died_are_in_no_statistics(plan):
    """A run that a link ended after a second has a small error for that reason alone."""
    died = passed(4, 1e-6)._replace(verdict="failed", exit_code=3)
    diverged = passed(3, 6.0)._replace(
        verdict="failed", exit_code=1, metrics={"rms_error_deg.max": 6.0, "diverged_at_s": 2.0}
    )
    summary = summarise(plan, [passed(1, 1.0), passed(2, 2.0), diverged, died, refused(5, "no")])
    figures = summary["metrics"]["rms_error_deg.max"]
    assert (figures["count"], figures["median"], figures["max"]) == (3, 2.0, 6.0)
    assert (summary["measured"], summary["excluded"], summary["diverged"]) == (3, 2, 1)
    assert summary["cells"][1]["metrics"].get("rms_error_deg.max", {}).get("count", 0) == 0


def test_never_is_more_than_any_time_and_goes_through_every_file(tmp_path, plan):
    """Never settled must not improve a sweep, nor look like an axis that had no step."""
    opened = results.create(tmp_path, plan)
    for number, value in enumerate((10.0, 20.0, math.inf, None, 30.0, math.inf), start=1):
        opened.add(Record(number, "passed", 0, "", {"settling_s.max": value}, "sha"))
    opened.close()
    again = results.reopen(tmp_path)
    summary = again.finish()
    again.close()
    figures = summary["metrics"]["settling_s.max"]
    assert figures == {"count": 5, "never": 2, "median": 30.0, "p95": None, "max": None, "max_at_point": 3}
    assert [row["settling_s.max"] for row in rows(tmp_path)] == ["10.0", "20.0", "inf", "", "30.0", "inf"]
    points = json.loads((tmp_path / "results.json").read_text())["points"]
    assert [(p["metrics"]["settling_s.max"], p["never"]) for p in points[2:4]] == [
        (None, ["settling_s.max"]),
        (None, []),
    ]


def test_a_full_disk_while_damaged_lines_are_dropped_loses_nothing(tmp_path, plan, monkeypatch):
    """The good lines go into another file first; what could not be recorded names its file and exits with 3."""
    opened = results.create(tmp_path, plan)
    opened.add(passed(1, 0.5))
    opened.close()
    file = tmp_path / "results.jsonl"
    with open(file, "a") as out:
        out.write('{"point": 2, "verd')
    before = file.read_bytes()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(results, "_append", full)
        with pytest.raises(results.NotRecorded, match=r"results.jsonl.new.*No space left") as caught:
            results.reopen(tmp_path)
    assert caught.value.exit_code == 3
    assert file.read_bytes() == before and not file.with_name("results.jsonl.new").exists()
    again = results.reopen(tmp_path)
    assert again.records == {1: passed(1, 0.5)}
    with pytest.raises(UsageError, match="runs at this moment"):  # the new file is locked as the old one was
        results.reopen(tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr(results, "_append", full)
        with pytest.raises(results.NotRecorded, match=r"results.jsonl: results could not be recorded"):
            again.add(passed(2, 0.5))
    assert 2 not in again.records
    again.close()


def test_a_reason_that_no_file_can_hold_is_written_with_escapes():
    assert broken(1, "law: \udc80\n gone").reason == "law: \\udc80 gone"
