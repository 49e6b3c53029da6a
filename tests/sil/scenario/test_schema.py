"""The published JSON Schema says of a scenario file what the loader says, as far as a schema can.

An editor that underlines what runs, or stays silent about a misspelt key, is worse than none; so every built-in
scenario and every broken one of test_broken_scenarios.py goes through both.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from jsonschema import Draft7Validator
from test_broken_scenarios import BROKEN, WARNINGS

from protocol.law_tables import LAWS
from sil.scenario import Scenario, load_scenario
from sil.scenario_errors import ScenarioInvalid
from sil.scenario_schema import scenario_schema, text
from sil.scenario_source import SHORT
from sil.scenario_yaml import read_mapping
from sil.scenarios import DIRECTORY, SCHEMA, list_scenarios

VALIDATOR = Draft7Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))

# What a schema of one file cannot know: other keys, other files, arithmetic. The loader and `sil check` do.
BEYOND_A_SCHEMA = {
    "a requirement on what only the board knows",
    "period of no whole number of us", "duration of no whole number of ticks", "key given twice",
    "broken YAML", "list at the top", "user law without its file", "steps out of order", "impossible inertia",
    "inertia not symmetric",
    "quaternion of norm two", "torque scale too fine", "schedule with a board", "schedule that is not there",
    "extends nothing", "metrics after the end", "answer too slow", "line too slow", "period the law cannot use",
    "delay the law cannot use", "no delay in real time", "sensor that the law needs", "timeout longer than the period",
    "number beyond float64 among the angles", "name of a file that no file can have",
    "user law in a file that no file can be", "extends what no file can be called", "nesting without end",
    "a thousand million laughs",
}  # fmt: skip


def refused(scenario_text: str) -> list[str]:
    """What the schema has against a scenario file of this content."""
    data = json.loads(json.dumps(read_mapping(scenario_text, "x.yaml").data))
    return [error.message for error in VALIDATOR.iter_errors(data)]


def test_the_published_file_is_current() -> None:
    """Remade by `python -m sil.scenario_schema > sil/scenarios/scenario.schema.json`."""
    assert SCHEMA.read_text(encoding="utf-8") == text()


def test_it_is_a_schema_of_draft_7() -> None:
    Draft7Validator.check_schema(scenario_schema())
    assert "prefixItems" not in text()  # a later draft's word, which editors ignore


def test_every_key_says_what_it_means() -> None:
    """More than its unit: an editor shows it, and so does docs/reference/scenario.md."""
    schema = scenario_schema()
    models = {"Scenario": schema, **schema["$defs"]}
    mute = [
        f"{name}.{key}"
        for name, model in models.items()
        for key, said in model["properties"].items()
        if "$ref" not in said and not re.sub(r"^\[[^]]*\]", "", said.get("description", "")).strip()
    ]
    assert mute == []
    assert [name for name, model in models.items() if not model.get("description")] == []


def test_a_plant_of_ones_own_is_valid() -> None:
    assert refused("plant: {kind: ./my_plant.py:MyPlant}") == []
    assert refused("plant: {kind: no-such-plant}")


@pytest.mark.parametrize("info", list_scenarios(), ids=lambda info: info.name)
def test_every_built_in_scenario_is_valid(info: Any) -> None:
    assert refused((DIRECTORY / f"{info.name}.yaml").read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("info", list_scenarios(), ids=lambda info: info.name)
def test_every_resolved_scenario_is_valid(info: Any) -> None:
    """Every key at once, defaults and all parameters of the law included."""
    resolved = json.loads(json.dumps(load_scenario(info.name).resolved()))
    assert [error.message for error in VALIDATOR.iter_errors(resolved)] == []


@pytest.mark.parametrize("name", WARNINGS)
def test_what_only_looks_odd_is_valid(name: str) -> None:
    assert refused(WARNINGS[name][0]) == []


@pytest.mark.parametrize("name", sorted(set(BROKEN) - BEYOND_A_SCHEMA))
def test_broken_scenarios_are_refused(name: str) -> None:
    assert refused(BROKEN[name][0])


def test_what_is_beyond_a_schema_is_that_and_no_more() -> None:
    """A name in the list that the schema does refuse, or that is no broken scenario, would hide a hole."""
    unreadable = {"key given twice", "broken YAML", "list at the top"}
    unreadable |= {"nesting without end", "a thousand million laughs"}
    assert set(BROKEN) >= BEYOND_A_SCHEMA
    for name in BEYOND_A_SCHEMA - unreadable:
        assert refused(BROKEN[name][0]) == [], name


@pytest.mark.parametrize(
    "short",
    ["link: udp", "link: udp://127.0.0.1:5005", "clock: realtime", "clock: scaled:20",
     "plant: {disturbance_Nm: [1e-4, 0, 0]}", "link: {baud: 9600}", "clock: {priority: 50, lab_cpu: 0}",
     "actuators: {wheels: {torque_max_Nm: 0.1, momentum_max_Nms: [0.1, null, 1]}}",
     "plant: {inertia_kgm2: [2, 3, 3]}", "law: {name: mrac, params: {identify: on, trace_max: null}}",
     "law: {name: './mine.py:Mine', params: {anything: 1}}", "extends: mrac-rs232\nlaw: {params: {kappa: 0.2}}",
     "require: [{metric: missed, below: 1, above: null}]", "law: {params: {controller_pole: 0.7}}",
     "law: {form: float}", "events: [{at_s: 1, do: setpoint, deg: [5, 0, 0]}, {at_s: 2, do: link.disconnect}]",
     "sensors: {attitude: {faults: [{kind: off, axis: x}, {kind: wrong, bias_deg: 1, axis: [x, y], for_s: null}]}}",
     "actuators: {wheels: {faults: [{kind: intermittent, fraction: 0.1}, {kind: wrong, bias_Nm: 0.01}]}}"],
)  # fmt: skip
def test_short_forms_are_valid(short: str, tmp_path: Path) -> None:
    assert refused(short) == []


def test_every_short_form_of_the_loader_is_in_the_schema() -> None:
    """SHORT is the loader's table; a new row of it must not need a second edit here."""
    schema = scenario_schema()
    for path, name in SHORT.items():
        section = schema
        for part in path[:-1]:
            section = schema["$defs"][section["properties"][part]["$ref"].rpartition("/")[2]]
        whole = schema["$defs"][section["properties"][path[-1]]["anyOf"][1]["$ref"].rpartition("/")[2]]
        assert name in whole["properties"]


@pytest.mark.parametrize(
    "wrong",
    ["link: tcp", "clock: fast", "clock: {priority: 100}", "plant: {disturbance_Nm: [1, 2]}",
     "require: [{metric: missed}]", "law: {name: mrac, params: {kappa: two}}", "law: {name: mrac, version: 99}",
     "timing: {max_degraded_fraction: 2}", "clock: scaled:5000", "clock: {mode: scaled:0}",
     "law: {params: {nope: 1}}", "law: {params: {controller_pole: two}}",
     "guidance: {profile: steps, rows: [{t_s: 1, attitude_deg: [1, 2]}]}", "extends: 3",
     "events: [{at_s: 1, do: board.reboot}]", "events: [{do: setpoint}]", "events: [{at_s: 1, do: setpoint, deg: [1]}]",
     "sensors: {rate: {faults: [{kind: wrong, bias_deg: 1}]}}", "sensors: {rate: {faults: [{kind: off, axis: w}]}}",
     "actuators: {wheels: {faults: [{at_s: 1}]}}", "actuators: {wheels: {faults: [{kind: off, for_s: 0}]}}"],
)  # fmt: skip
def test_wrong_short_and_long_forms_are_refused(wrong: str) -> None:
    assert refused(wrong)


def test_every_key_says_what_it_is_or_its_unit() -> None:
    """What an editor shows beside a key; names that say all themselves are listed."""
    plain = {"seed", "enabled", "noise", "gravity_gradient", "from_tick", "momentum_bits", "rate_bits", "metric",
             "below", "above", "between", "kind", "form", "frame", "sine"}  # fmt: skip
    schema = scenario_schema()
    for where, section in {"top": schema, **schema["$defs"]}.items():
        for key, value in section.get("properties", {}).items():
            assert "$ref" in value or value.get("description") or key in plain, f"{where}.{key}"


KEYS = [(f"law.params.{key}", name) for name in {table.name for table in LAWS.values()}
        for key in scenario_schema()["$defs"][f"Params_{name}"]["properties"]]  # fmt: skip


@given(
    st.sampled_from(KEYS),
    st.floats(-10, 10) | st.integers(-3, 50) | st.booleans() | st.none() | st.text("ab", max_size=3),
)
def test_the_schema_refuses_no_parameter_that_the_loader_takes(key: tuple[str, str], value: Any) -> None:
    """An editor must not underline what flies; the other way round the loader is the stricter one."""
    path, law = key
    try:
        load_scenario("appc-rs232", ["law.params={}", f"law.name={law}", f"{path}={json.dumps(value)}"])
    except ScenarioInvalid:
        return
    data = {"law": {"name": law, "params": {path.rpartition(".")[2]: value}}}
    assert [error.message for error in VALIDATOR.iter_errors(data)] == []


@given(
    st.floats(0, 2000).map(lambda number: f"{number:f}")
    | st.integers(0, 2000).map(str)
    | st.text("0123456789.", max_size=7)
)
@example("0.01")
@example("0.009")
@example("1000")
@example("1000.1")
@example("007.50")
def test_the_speed_of_a_clock_is_that_of_the_loader(scale: str) -> None:
    try:
        load_scenario("appc-rs232", [f"clock.mode=scaled:{scale}"])
        taken = True
    except ScenarioInvalid:
        taken = False
    assert VALIDATOR.is_valid({"clock": f"scaled:{scale}"}) is taken


def test_all_sections_of_the_model_are_there() -> None:
    assert set(scenario_schema()["properties"]) == {*Scenario.model_fields, "extends"}
    assert VALIDATOR.schema["properties"]["seed"]["exclusiveMaximum"] == 2**64
