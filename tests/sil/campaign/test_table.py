"""What a person is shown fits 80 columns, tells reasons once, and says when a varied seed decided nothing."""

from __future__ import annotations

import io
import math

import pytest
from rich.console import Console

from sil.campaign import table
from sil.campaign.conditions import conditions_from
from sil.campaign.figures import summarise
from sil.campaign.plan import make_plan
from sil.campaign.records import Record
from sil.scenario import load_scenario


def shown(vary, records, draws=None, interrupted=False, sweep_dir="sweeps/x-001"):
    plan = make_plan(
        load_scenario("mrac-rs232", ["board=inproc", "duration_s=5"]), conditions_from(None, vary, None, draws, 1)
    )
    records = records[: len(plan.points)]
    summary = summarise(plan, records) | {
        "interrupted": interrupted,
        "wall_s": 1.0,
        "workers": 2,
        "sweep_dir": sweep_dir,
    }
    out = io.StringIO()
    assert summary["excluded"] == sum(record.exit_code > 1 for record in records)
    table.show(summary, plan, records, Console(file=out, width=80, highlight=False, emoji=False))
    return out.getvalue()


def flown(point, rms, passed=True):
    metrics = {"rms_error_deg.max": rms, "peak_error_deg.max": 2 * rms, "peak_torque_Nm.max": 0.05}
    reason = "" if passed else f"rms_error_deg.max < 0.1, got {rms:.4g}"
    return Record(point, "passed" if passed else "failed", 0 if passed else 1, reason, metrics, f"sha{point}")


@pytest.mark.parametrize(
    ("vary", "draws", "must"),
    [
        (["law.params.c2_pole=0.5:0.9:9"], None, ["point  c2_pole  verdict", "0.55", "50.00"]),
        (["law.params.c2_pole=0.5:0.9:3", "seed=1:3"], None, ["c2_pole  passed  rms median", "3/3"]),
        (["sensors.attitude.noise_deg=uniform(0.01,0.05)"], 9, ["median", "drawn 9 times", "0.0500", "max at point"]),
    ],
)
def test_each_kind_of_sweep_has_its_table_in_80_columns(vary, draws, must):
    text = shown(vary, [flown(n, n / 100) for n in range(1, 10)], draws)
    for part in must:
        assert part in text, text
    assert max(map(len, text.splitlines())) <= 80
    assert "failed" not in text


def test_a_reason_is_told_once_with_its_points():
    records = [flown(n, n / 10, passed=n < 2) for n in range(1, 10)]
    text = shown(["law.params.c2_pole=0.5:0.9:9"], records)
    assert text.count("rms_error_deg.max < 0.1") == 1
    assert "8 points 2, 3, 4, 5, 6, 7, ...: rms_error_deg.max < 0.1" in text


def test_a_seed_that_decides_nothing_is_said():
    vary = ["law.params.c2_pole=0.5,0.6", "seed=1:2"]
    same = [flown(1, 0.1), flown(2, 0.1), flown(3, 0.2), flown(4, 0.2)]
    assert "the seed changes nothing here" in shown(vary, same)
    assert "the seed changes nothing here" not in shown(vary, [*same[:3], flown(4, 0.3)])


def test_a_directory_is_shown_as_it_is_called():
    assert "sweep: a[red]b/[/]c" in shown(["seed=1:4"], [flown(1, 0.1)], sweep_dir="a[red]b/[/]c")


def test_what_the_statistics_leave_out_and_what_never_settled_is_said():
    records = [flown(n, n / 100) for n in range(1, 10)]
    records[0] = records[0]._replace(exit_code=3, verdict="failed", reason="link: gone")
    for n in range(1, 9):
        metrics = records[n].metrics | {"settling_s.max": math.inf if n > 3 else 20.0}
        records[n] = records[n]._replace(metrics=metrics)
    records[8] = records[8]._replace(metrics=records[8].metrics | {"diverged_at_s": 4.0})
    text = shown(["sensors.attitude.noise_deg=uniform(0.01,0.05)"], records, draws=9)
    assert "over 8 points, without 1 that did not end as planned; 1 diverged; 5 never settled" in " ".join(text.split())
    (line,) = [line for line in text.splitlines() if line.startswith("settled after")]
    assert line.split()[2:6] == ["never", "never", "never", "s"]
    assert max(map(len, text.splitlines())) <= 80


def test_no_statistics_where_no_run_came_to_its_end():
    text = shown(["seed=1:4"], [flown(1, 0.1)._replace(exit_code=3, verdict="failed", reason="gone", metrics={})])
    assert "no statistics: no run came to its end" in text and "median" not in text and "gone" in text


def test_an_interruption_is_said_first_even_before_the_first_point():
    assert shown(["seed=1:4"], [], interrupted=True).startswith("interrupted   mrac-rs232: 0 of 4 points")
    text = shown(["seed=1:4"], [flown(1, 0.1)], interrupted=True)
    assert text.startswith("interrupted   passed 1   mrac-rs232: 1 of 4 points")
