"""The plan: which points there are, which draws they share, and what is refused before anything runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil.campaign.conditions import conditions_from
from sil.campaign.plan import make_plan, read_plan, sets_of
from sil.scenario import load_scenario, load_values
from sil.trouble import UsageError

SHORT = ("board=inproc", "duration_s=5")
WIDE = "plant.inertia_kgm2.0=uniform(1, 12)"  # half of it no body can have beside 3.04 and 3.09


def plan(*vary, draws=None, sample=None, seed=0, scenario="mrac-rs232", sets=()):
    return make_plan(load_scenario(scenario, [*SHORT, *sets]), conditions_from(None, vary, sample, draws, seed))


def test_a_grid_has_every_combination_the_last_key_fastest():
    made = plan("law.params.c2_pole=0.7,0.8", "seed=1:3")
    assert [tuple(point.values.values()) for point in made.points] == [
        (0.7, 1), (0.7, 2), (0.7, 3), (0.8, 1), (0.8, 2), (0.8, 3)
    ]  # fmt: skip
    assert [point.number for point in made.points] == [1, 2, 3, 4, 5, 6]
    assert made.cell_keys == ["law.params.c2_pole"]  # seeds repeat a cell


def test_every_cell_of_a_grid_flies_the_same_draws():
    made = plan("sensors.attitude.noise_deg=uniform(0.01,0.05)", "law.name=appc,mrac", draws=4, seed=5)
    noise = [point.values["sensors.attitude.noise_deg"] for point in made.points]
    assert [point.values["law.name"] for point in made.points] == ["appc"] * 4 + ["mrac"] * 4
    assert noise[:4] == noise[4:] and len(set(noise)) == 4
    assert list(made.points[0].values) == ["sensors.attitude.noise_deg", "law.name"]  # as the user ordered them


@pytest.mark.parametrize("sample", ["random", "lhs"])
def test_a_draw_that_the_scenario_refuses_is_drawn_again_and_counted(sample):
    made = plan(WIDE, draws=30, sample=sample, seed=1)
    assert len(made.points) == 30 and not any(point.refused for point in made.points)
    assert all(point.values["plant.inertia_kgm2.0"] <= 6.13 for point in made.points)
    assert made.sample["redrawn"] > 5
    assert "sum of the other two" in made.sample["redrawn_first_reason"]


def test_a_refused_point_of_a_grid_stays_with_its_reason():
    made = plan("plant.inertia_kgm2.0=2.13,7")
    assert [bool(point.refused) for point in made.points] == [False, True]
    assert "plant.inertia_kgm2" in made.points[1].refused and "sum of the other two" in made.points[1].refused


def test_a_point_is_what_the_same_overrides_make_of_the_scenario():
    made = plan("plant.inertia_kgm2.1=3.5", "plant.disturbance_Nm.2=1e-4", "law.params.c2_pole=0.75")
    (point,) = made.points
    flown = load_values(made.scenario, sets_of(point.values))
    sets = ["plant.inertia_kgm2=[2.13, 3.5, 3.09]", "plant.disturbance_Nm=[0, 0, 1e-4]", "law.params.c2_pole=0.75"]
    assert flown.identity() == load_scenario("mrac-rs232", [*SHORT, *sets]).identity()


def test_a_plan_is_read_back_as_it_was_written():
    made = plan("plant.inertia_kgm2.0=2.13,7", "seed=uniform(1,1000)", draws=2)
    read = read_plan(made.text(), "plan.json")
    assert read.text() == made.text()
    assert (read.points, read.keys, read.cell_keys, read.sample) == (
        made.points, made.keys, made.cell_keys, made.sample
    )  # fmt: skip
    with pytest.raises(UsageError, match=r"plan.json: expected the plan of a sweep"):
        read_plan(made.text()[:-20], "plan.json")


@pytest.mark.parametrize(
    ("vary", "options", "said"),
    [
        (["law.params.c2_pool=1,2"], {}, "--vary law.params.c2_pool: unknown key; known: design, c2_pole"),
        (["plant.inertia_kgm2.5=1,2"], {}, "a list with an item 5"),
        (["seed=uniform(1,5)"], {}, "-n: expected how many draws"),
        (["seed=1:5"], {"draws": 3}, "expected a drawn axis"),
        (["seed=1:5"], {"sample": "lhs"}, "expected a drawn axis"),
        (["seed=1:1000", "law.params.c2_pole=0.5:0.9:1000"], {}, "at most 100000 points in all"),
        (["plant.inertia_kgm2=[2,3,3]", "plant.inertia_kgm2.0=2,3"], {}, "none inside of another"),
        (["plant.inertia_kgm2.0=uniform(8,9)"], {"draws": 2}, "1000 in a row"),
        (["plant.inertia_kgm2.0=8,9"], {}, "no point of the sweep can be flown"),
        (["out=a,b"], {}, "--out says where"),
        (["clock.mode=realtime,lockstep"], {}, "--clock says it for all points"),  # it went past the one-worker rule
        (["clock=realtime,lockstep"], {}, "--clock says it for all points"),
        (["timing.max_lateness_ms=1,2"], {}, "the scenario says it for all points"),
        (["plant.inertia_kgm2.²=1,2"], {}, "an item as 0, 1, 2"),  # a digit to str.isdigit, and to nobody else
        (["plant.initial.attitude_deg.0=1,.nan"], {}, "expected finite numbers, got nan"),
        (["plant.initial.attitude_deg.0=1e400"], {}, "expected finite numbers, got inf"),
        (["plant.initial.attitude_deg.0=1:1e400:3"], {}, "expected finite numbers, got inf"),
        (["plant.initial.attitude_deg=[0, .inf, 0]"], {}, "expected finite numbers, got inf"),
        (["plant.initial.attitude_deg.0=choice(1,.inf)"], {"draws": 2}, "expected finite numbers, got inf"),
        (["plant.initial.attitude_deg.0=normal(0,1e308)"], {"draws": 2}, "expected finite numbers"),
        (["law.name=mrac,\udc80"], {}, "text that UTF-8 can hold"),
        (['law.name=mrac,"\\ud800"'], {}, "text that UTF-8 can hold"),
    ],
)
def test_what_makes_no_sense_is_refused(vary, options, said):
    with pytest.raises(UsageError) as caught:
        plan(*vary, **options)
    assert said in str(caught.value) and "--set" not in str(caught.value)


def test_a_full_inertia_matrix_says_how_its_items_are_called():
    full = ("plant.inertia_kgm2=[[2.1, 0.1, 0], [0.1, 3, 0], [0, 0, 3]]",)
    with pytest.raises(UsageError, match=r"expected plant.inertia_kgm2.0.0"):
        plan("plant.inertia_kgm2.0=2,3", sets=full)
    assert len(plan("plant.inertia_kgm2.0.0=2,2.5", sets=full).points) == 2


@pytest.mark.parametrize("scenario", ["appc-rs232", "mrac-rs232"])
def test_the_monte_carlo_example_is_a_plan(scenario):
    file = Path(__file__).resolve().parents[3] / "docs" / "examples" / "monte-carlo.yaml"
    conditions = conditions_from(file, (), None, 20, None)
    made = make_plan(load_scenario(scenario, [*SHORT, *conditions.sets]), conditions)
    assert len(made.points) == 20 and not any(point.refused for point in made.points)
    believed = (2.13, 3.04, 3.09)
    for point in made.points:
        for axis, mine in enumerate(believed):
            assert 0.7 * mine - 1e-9 <= point.values[f"plant.inertia_kgm2.{axis}"] <= 1.3 * mine + 1e-9
        assert point.values["sensors.attitude.bits"] in (16, 24) and isinstance(point.values["seed"], int)
