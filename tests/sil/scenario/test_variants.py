"""Variants of a scenario: one file, several laws; protects what a run of one is, and what is said of a wrong one."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil.campaign.conditions import conditions_from
from sil.campaign.plan import make_plan, sets_of
from sil.scenario import load_scenario, load_values
from sil.scenario_errors import ScenarioInvalid

FILE = """
name: two
duration_s: 60
link: udp
law: {name: mrac, params: {c2_pole: 0.7}}
plant: {inertia_kgm2: [2, 3, 3]}
variants:
  slow: {law: {params: {c2_pole: 0.8}}, plant: {disturbance_Nm: [0.001, 0, 0]}}
  pd:
    law: {name: pd}
    link: pty
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "two.yaml"
    path.write_text(FILE)
    return str(path)


def test_a_variant_is_merged_as_over_a_scenario_that_is_extended(file: str) -> None:
    slow, pd = load_scenario(file, ["variant=slow"]), load_scenario(file, ["variant=pd"])
    assert (slow.name, slow.law.name, slow.law.params["c2_pole"]) == ("two-slow", "mrac", 0.8)
    assert slow.plant.inertia_kgm2[1][1] == 3 and slow.plant.disturbance_Nm.constant_Nm[0] == 0.001
    assert (pd.name, pd.law.name, pd.link.url) == ("two-pd", "pd", "pty") and "c2_pole" not in pd.law.params


def test_set_wins_over_the_variant(file: str) -> None:
    assert load_scenario(file, ["law.params.c2_pole=0.6", "variant=slow"]).law.params["c2_pole"] == 0.6


def test_without_one_the_identity_says_nothing_of_variants(file: str) -> None:
    """Logs of runs without variants keep their bytes."""
    assert not {"variant", "variants"} & set(load_scenario(file).identity())
    assert not {"variant", "variants"} & set(load_scenario("mrac-rs232").resolved())


def test_the_chosen_one_is_recorded_and_loads_again_as_it_is(file: str) -> None:
    slow = load_scenario(file, ["variant=slow", "law.params.c2_pole=0.6"])
    assert slow.identity()["variant"] == "slow" and "variants" not in slow.resolved()
    assert load_values(slow.resolved()).resolved() == slow.resolved()


def test_the_points_of_a_sweep_are_the_runs(file: str) -> None:
    plan = make_plan(load_scenario(file), conditions_from(None, ["variant=slow,pd"], None, None, None))
    for point, name in zip(plan.points, ("slow", "pd"), strict=True):
        flown = load_values(plan.scenario, sets_of(point.values))
        assert flown.identity() == load_scenario(file, [f"variant={name}"]).identity()


@pytest.mark.parametrize(
    ("text", "sets", "said"),
    [
        (FILE, ["variant=sloww"], "--set variant: expected one of slow, pd (did you mean slow?), got 'sloww'"),
        (FILE + "variant: lqg\n", [], "two.yaml:12: variant: expected one of slow, pd, got 'lqg'"),
        ("duration_s: 60\n", ["variant=pd"], "--set variant: expected no variant, since the scenario has no variants"),
        (FILE.replace("c2_pole: 0.8", "c3_pole: 0.8"), ["variant=slow"], "two.yaml:8: law.params.c3_pole: "),
        (FILE.replace("{name: pd}", "{nome: pd}"), ["variant=pd"], "two.yaml:10: law.nome: "),
        ("variants: 3\n", [], "variants: expected a mapping"),
        ("variants: {pd: 3}\n", [], "variants.pd: expected a mapping"),
    ],
)
def test_what_is_wrong_is_one_line_with_its_place(tmp_path: Path, text: str, sets: list[str], said: str) -> None:
    path = tmp_path / "two.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioInvalid) as caught:
        load_scenario(path, sets)
    assert said in str(caught.value)
