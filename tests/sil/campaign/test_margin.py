"""The margin map: which places are flown, what their figures mean, and a picture that tells nothing by colour alone."""

from __future__ import annotations

import csv
import io
import json
import math

import pytest

from sil.campaign.margin import (
    INDEPENDENT,
    LINK,
    SENSOR,
    Wanted,
    as_json,
    cells_of,
    csv_text,
    default_laws,
    is_map,
    preset,
)
from sil.campaign.margin_map import draw, page_of
from sil.campaign.plan import make_plan, read_plan
from sil.campaign.records import Record, broken
from sil.report.heat_map import heat_maps
from sil.scenario import load_scenario
from sil.trouble import UsageError

WANTED = Wanted(("appc", "pd"), (0.1, 0.4), (INDEPENDENT, 5.0), (2,), (0, 2), 3)
SETS = ("duration_s=60", "board=inproc", "clock=lockstep", "require=[]", "seed=7")


def planned(wanted=WANTED, sets=()):
    scenario = load_scenario("appc-rs232", [*SETS, *sets])
    conditions, flies = preset(scenario, wanted)
    return read_plan(make_plan(scenario, conditions, wanted=flies).text(), "plan.json")


@pytest.fixture(scope="module")
def plan():
    return planned()


def flown(point, rms=0.1, diverged=None):
    code = 0 if diverged is None else 1
    return Record(point, "passed", code, "", {"rms_error_deg.max": rms, "diverged_at_s": diverged})


def all_flown(plan, special=()):
    return {point.number: flown(point.number) for point in plan.points} | dict(special)


def test_every_law_flies_the_transport_delays_it_allows_and_no_point_is_refused(plan):
    cells = cells_of(plan, all_flown(plan))
    rows = {law: {(c.transport, c.delay) for c in cells if c.law == law} for law in WANTED.laws}
    assert rows == {"appc": {(1, 0), (1, 2)}, "pd": {(1, 0), (1, 2), (0, 0), (2, 0)}}
    assert not any(point.refused for point in plan.points)


def test_without_loss_there_is_one_place_and_with_it_one_for_each_length_of_bursts(plan):
    cells = [c for c in cells_of(plan, all_flown(plan)) if (c.law, c.transport, c.delay) == ("appc", 1, 0)]
    assert [(c.loss, c.burst) for c in cells] == [(0, 0), (0.1, 1), (0.1, 5), (0.4, 1), (0.4, 5)]
    assert [c.nominal for c in cells] == [True, False, False, False, False]
    assert [c.runs for c in cells] == [3] * 5


def test_all_laws_lose_the_same_frames(plan):
    """The seeds of a place are the same in every place: the channel draws from them."""
    seeds = {}
    for point in plan.points:
        place = {key: value for key, value in point.values.items() if key != "seed"}
        seeds.setdefault(json.dumps(place), []).append(point.values["seed"])
    assert set(map(tuple, seeds.values())) == {(7, 8, 9)}


def test_faults_that_the_scenario_has_already_stay(plan):
    plan = planned(sets=["sensors.attitude.faults=[{kind: wrong, bias_deg: 1}]", "link.faults.up.byte_loss=0.01"])
    values = [point.values for point in plan.points]
    assert {fault["kind"] for each in values for fault in each[SENSOR][:1]} == {"wrong"}
    assert {len(each[SENSOR]) for each in values} == {1, 2}
    assert all("up" not in each[LINK] for each in values)
    assert {c.delay for c in cells_of(plan, all_flown(plan))} == {0, 2}


def test_a_lost_run_has_no_error_and_one_that_broke_is_in_no_figure(plan):
    """The median over three: of one lost run still a number, of two none."""
    records = all_flown(plan)
    records |= {1: flown(1, 0.2), 2: flown(2, 0.05, diverged=12.0), 4: flown(4, diverged=1.0), 5: flown(5, None)}
    records |= {7: broken(7, "link: gone")}
    first, second, third = cells_of(plan, records)[:3]
    assert (first.runs, first.lost, first.rms_deg, first.max_deg) == (3, 1, 0.2, math.inf)
    assert (second.lost, second.rms_deg) == (2, math.inf)
    assert (third.runs, third.failed, third.lost, third.rms_deg) == (2, 1, 0, 0.1)


def test_the_tables_say_the_same(plan):
    cells = cells_of(plan, all_flown(plan, {n: flown(n, diverged=1.0) for n in (1, 2, 3)}))
    rows = list(csv.DictReader(io.StringIO(csv_text(cells))))
    told = as_json(plan, cells)
    assert len(rows) == len(told["cells"]) == len(cells)
    assert (rows[0]["rms_deg"], told["cells"][0]["rms_deg"], told["cells"][0]["lost"]) == ("inf", None, 3)
    assert float(rows[1]["rms_deg"]) == told["cells"][1]["rms_deg"] == 0.1
    json.dumps(told, allow_nan=False)


def test_the_picture_has_every_number_and_says_where_runs_were_lost(plan, tmp_path):
    special = {1: flown(1, 0.2), 2: flown(2, diverged=12.0), 4: flown(4, diverged=1.0), 5: flown(5, diverged=1.0)}
    cells = cells_of(plan, all_flown(plan, special))
    page, panels = page_of(plan, cells)
    axes = heat_maps(page, panels).axes
    texts = [text.get_text() for text in axes[0].texts]
    assert {"0.20\n1/3 lost", "2/3 lost", "0.10"} <= set(texts)
    hatched = [patch for patch in axes[0].patches if patch.get_hatch()]
    assert len(hatched) == 2
    notes = [text.get_text() for ax in axes for text in ax.texts]
    assert notes.count("appc does not fly with n = 0") == 1
    draw(plan, cells, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_a_map_of_which_little_is_finished_is_drawn_too(plan, tmp_path):
    draw(plan, cells_of(plan, {1: flown(1)}), tmp_path / "one.png")
    draw(plan, cells_of(plan, {1: broken(1, "gone")}), tmp_path / "none.png")


def test_bursts_that_no_chain_can_make_are_refused_before_anything_flies():
    with pytest.raises(UsageError, match=r"--loss 0.7 --burst 1.2: .*share.*at most 0.5455"):
        planned(WANTED._replace(losses=(0.1, 0.7), bursts=(1.2,)))


def test_the_usual_laws_are_those_that_fly_the_scenario():
    assert default_laws(load_scenario("mrac-rs232", SETS)) == ("mrac", "appc", "pd")
    assert default_laws(load_scenario("pd-root-locus", [*SETS, "period_s=2"])) == ("pd",)


def test_numbers_stay_readable_however_many_laws_there_are(plan):
    page, panels = page_of(plan, cells_of(plan, all_flown(plan)))
    many = [panel._replace(column=column) for column in range(9) for panel in panels if panel.column == 0]
    figure = heat_maps(page._replace(columns=tuple("abcdefghi")), many)
    assert min(ax.get_position().width for ax in figure.axes[:-1]) * figure.get_figwidth() > 2.5


def test_other_sweeps_are_no_map(plan):
    assert is_map(plan)
    assert not is_map(make_plan(load_scenario("appc-rs232"), _seeds()))


def _seeds():
    from sil.campaign.conditions import conditions_from

    return conditions_from(None, ["seed=1:2"], None, None, None)


@pytest.mark.parametrize(
    ("sets", "laws", "told"),
    [
        (["sensors.attitude.enabled=false"], ("pd",), "sensors.attitude"),
        (["period_s=2"], ("appc",), "a law that flies this scenario, got appc: "),
        ([], ("appc", "nope"), "a law that flies this scenario, got nope: law.name"),
        (["sensors.attitude.faults=[{kind: delayed, delay_s: 1}]"], ("pd",), "--delay 2: .*no overlap with faults.0."),
        (["link.faults.up.drop=0.5"], ("pd",), "no link.faults.up.drop"),
        (["link.faults.down.burst={share: 0.1, mean_ticks: 2}"], ("pd",), "no link.faults.down.burst"),
    ],
)
def test_what_no_map_can_be_made_of(sets, laws, told):
    with pytest.raises(UsageError, match=told):
        planned(WANTED._replace(laws=laws), sets)
