"""Loading a scenario: defaults, extends, overrides, what is resolved, and what is part of a run's identity."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest
from pydantic import ValidationError

from sil.clock import clock_rate_q16, new_clock
from sil.scenario import Scenario, json_schema, load_scenario, load_values
from sil.scenario_errors import ScenarioInvalid

FIVE_LINES = "law:\n  name: mrac\nduration_s: 60\nsensors:\n  attitude: {noise_deg: 0.02}\n"


def written(folder: Path, text: str, name: str = "mine.yaml") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def test_five_lines_are_a_scenario(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, FIVE_LINES))
    assert scenario.name == "mine"
    assert (scenario.ticks, scenario.period_us, scenario.period_ns) == (120, 500_000, 500_000_000)
    assert scenario.sample_timeout_us == 100_000
    assert scenario.law.params["design"] == "repaired"
    assert scenario.law.version == 1
    assert scenario.torque_bits == 30


def test_an_empty_file_is_a_scenario(tmp_path: Path) -> None:
    assert load_scenario(written(tmp_path, "")).law.name == "appc"


def test_a_scenario_is_frozen(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, FIVE_LINES))
    with pytest.raises(ValidationError):
        scenario.seed = 3  # type: ignore[misc]


def test_resolved_says_everything_and_loads_again(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, FIVE_LINES), ["law.params.trace_max=null"])
    resolved = scenario.resolved()
    assert [*resolved, "variants", "variant"] == list(Scenario.model_fields)  # it has none
    again = load_values(json.loads(json.dumps(resolved, allow_nan=False)))
    assert again.resolved() == resolved
    assert again.law_values() == scenario.law_values()
    assert load_values(resolved, ["law.params.c2_pole=0.7"]).law.params["c2_pole"] == 0.7


def test_how_a_scenario_is_run_is_not_part_of_its_identity() -> None:
    ways = [
        load_scenario("mrac-rs232", sets)
        for sets in ([], ["clock=scaled:20", "link=udp", "board=inproc", "out=/tmp/x", "link.baud=9600"])
    ]
    assert ways[0].identity() == ways[1].identity()
    assert ways[0].resolved() != ways[1].resolved()
    assert ways[0].identity() != load_scenario("mrac-rs232", ["seed=1"]).identity()


def test_the_short_forms_keep_what_they_do_not_name() -> None:
    scenario = load_scenario("mrac-rs232", ["link=udp", "plant.disturbance_Nm=[1e-4, 0, 0]"])
    assert (scenario.link.url, scenario.link.baud) == ("udp", 115200)
    assert scenario.plant.disturbance_Nm.constant_Nm == (1e-4, 0.0, 0.0)


@pytest.mark.parametrize("order", [["link.baud=9600", "link=udp"], ["link=udp", "link.baud=9600"]])
def test_short_forms_in_any_order(order: list[str]) -> None:
    link = load_scenario("appc-udp", order).link
    assert (link.url, link.baud) == ("udp", 9600)


def test_overrides_reach_everything() -> None:
    sets = ["law.form=float", "plant.initial.attitude_deg=[1, 2, 3]", "require.0.below=7", "clock=realtime", "seed=9"]
    scenario = load_scenario("mrac-rs232", sets)
    assert scenario.law.form == "float"
    assert scenario.plant.initial.attitude_deg == (1.0, 2.0, 3.0)
    assert scenario.require[0].below == 7
    assert scenario.clock_scale == 1.0
    assert str(scenario.where("law.form")) == "--set law.form"
    assert str(scenario.where("plant.initial.attitude_deg")) == "--set plant.initial.attitude_deg"


def test_the_last_override_counts() -> None:
    assert load_scenario("mrac-rs232", ["seed=1", "seed=2"]).seed == 2


def test_another_law_drops_the_parameters_of_the_first() -> None:
    scenario = load_scenario("mrac-rs232", ["law.name=appc", "law.params.adapt=false"])
    assert scenario.law.params["adapt"] is False
    assert "kappa" not in scenario.law.params


def test_extends_by_path_and_by_name(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    written(tmp_path, "extends: mrac-rs232\nabout: base\nseed: 5\nrequire: []\n", "base.yaml")
    scenario = load_scenario(written(tmp_path / "deep", "extends: ../base.yaml\nlaw: {params: {kappa: 0.2}}\n"))
    assert (scenario.name, scenario.about, scenario.seed, scenario.require) == ("mine", "", 5, ())
    assert (scenario.law.params["kappa"], scenario.law.params["c2_pole"]) == (0.2, 0.8)
    assert scenario.where("law.params.kappa").line == 2
    assert scenario.where("seed").file.endswith("base.yaml")


@pytest.mark.parametrize(
    ("file", "name"),
    [("my test (2).yaml", "my-test-2"), ("_x.y--z.yaml", "x.y--z"), ("δοκιμή.yaml", "scenario"), ("-r.yaml", "r")],
)
def test_a_file_may_be_called_anything(tmp_path: Path, file: str, name: str) -> None:
    """The run directory is not: the default name is made of what a name can have."""
    assert load_scenario(written(tmp_path, "seed: 1\n", file)).name == name


@pytest.mark.parametrize("clock", ["scaled:0.01", "scaled:1000"])
def test_the_board_is_told_every_clock_rate_that_is_allowed(clock: str) -> None:
    scenario = load_scenario("appc-rs232", [f"clock={clock}"])
    assert clock_rate_q16(new_clock(scenario.clock.mode)) == pytest.approx(scenario.clock_scale * 65536, rel=1e-3)


def test_lists_are_replaced_not_merged(tmp_path: Path) -> None:
    text = "extends: mrac-rs232\nrequire:\n  - {metric: late, below: 1}\n"
    assert [line.metric for line in load_scenario(written(tmp_path, text)).require] == ["late"]


def test_yaml_numbers_are_those_a_person_means(tmp_path: Path) -> None:
    text = "seed: 0x10\nduration_s: 1e+1\nanswer_delay_s: 1e-4\nabout: on\n"
    scenario = load_scenario(written(tmp_path, text))
    assert (scenario.seed, scenario.duration_s, scenario.answer_delay_s, scenario.about) == (16, 10.0, 1e-4, "on")


@pytest.mark.parametrize(
    ("limit", "bits"), [("0.1", 30), ("1.9", 30), ("2", 29), ("[0.1, 5, 1]", 28), ("null", 20), ("1e6", 11)]
)
def test_torque_scale_fits_the_limit(limit: str, bits: int) -> None:
    assert load_scenario("appc-rs232", [f"actuators.wheels.torque_max_Nm={limit}"]).torque_bits == bits


@pytest.mark.parametrize(
    ("clock", "scale"), [("lockstep", 0.0), ("realtime", 1.0), ("scaled:20", 20.0), ("scaled:0.5", 0.5)]
)
def test_clock_scale(clock: str, scale: float) -> None:
    assert load_scenario("appc-rs232", [f"clock={clock}"]).clock_scale == scale


def test_a_period_of_odd_microseconds_is_exact() -> None:
    scenario = load_scenario("pd-root-locus", ["period_s=0.333333", "duration_s=33.3333"])
    assert (scenario.period_ns, scenario.ticks) == (333_333_000, 100)


def test_files_are_found_from_the_file_that_names_them(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("t,u1,u2,u3\n")
    base = written(tmp_path, "board: none\nschedule: u.csv\n", "base.yaml")
    (tmp_path / "deep").mkdir()
    scenario = load_scenario(written(tmp_path / "deep", f"extends: {base}\n"))
    assert scenario.file_of("schedule") == tmp_path / "u.csv"
    assert scenario.identity()["schedule"] == "u.csv"


USER_LAW = """
class MyLaw:
    PARAMS = {"kp": (0.002, "N m/rad", 1e-9), "kd": (0.05, "N m s/rad", 1e-8)}
"""


def test_a_users_own_law_brings_its_own_parameters(tmp_path: Path) -> None:
    (tmp_path / "my_law.py").write_text(USER_LAW)
    text = "law: {name: './my_law.py:MyLaw', form: float, params: {kp: 0.004}}\n"
    scenario = load_scenario(written(tmp_path, text))
    assert scenario.law.params == {"kp": 0.004, "kd": 0.05}
    assert scenario.file_of("law.name") == tmp_path / "my_law.py"
    with pytest.raises(ScenarioInvalid, match=r"law\.params\.ki: unknown key; known: kp, kd"):
        load_scenario(str(tmp_path / "mine.yaml"), ["law.params.ki=1"])
    with pytest.raises(ScenarioInvalid, match=r"law\.params\.kp: expected a number from -2\.14748 to"):
        load_scenario(str(tmp_path / "mine.yaml"), ["law.params.kp=3"])
    with pytest.raises(ScenarioInvalid, match=r"law\.name: expected class Other with PARAMS .*no class Other"):
        load_scenario(str(tmp_path / "mine.yaml"), [f"law.name={tmp_path}/my_law.py:Other", "law.params={}"])


def test_scenarios_can_be_sent_to_another_process() -> None:
    scenario = load_scenario("mrac-rs232")
    assert pickle.loads(pickle.dumps(scenario)).resolved() == scenario.resolved()


def test_the_json_schema_knows_every_key() -> None:
    schema = json_schema()
    assert set(schema["properties"]) == {*Scenario.model_fields, "extends"}
    assert schema["additionalProperties"] is False
    assert json.dumps(schema)


def test_a_whole_section_by_set_owns_the_keys_inside() -> None:
    """A law file named so is looked for in the working directory, not beside the scenario that named another law."""
    scenario = load_scenario("appc-rs232", ["law={name: pd, form: float}"])
    assert str(scenario.where("law.name")).startswith("--set law")
    with pytest.raises(ScenarioInvalid, match=r"^--set law: law\.form: "):
        load_scenario("appc-rs232", ["law={name: pd, form: octal}"])
