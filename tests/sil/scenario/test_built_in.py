"""The built-in scenarios load without a finding, say what they are about, and fly the manoeuvres of the study."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from sil.check_deadlines import wire_times_s
from sil.checks import check
from sil.configure import orders
from sil.plants.rigid import Rigid
from sil.profiles import PROFILES, setpoints
from sil.scenario import load_scenario, load_values
from sil.scenario_sections import Guidance
from sil.scenario_table import markdown, non_defaults
from sil.scenarios import list_scenarios
from sil.schedule import read_schedule

GOLDEN = Path(__file__).parents[2] / "golden"
NAMES = [info.name for info in list_scenarios()]
EXPECTED = [
    "appc-rs232", "appc-udp", "delay-comparison", "delay-large", "delay-nanosat", "delay-picosat", "fvsc-rs232",
    "mrac-as-printed", "mrac-as-printed-limited", "mrac-as-printed-no-delay", "mrac-rs232", "pd-root-locus",
    "rigid-open-loop",
]  # fmt: skip


def test_all_are_there() -> None:
    assert NAMES == EXPECTED


@pytest.mark.parametrize("info", list_scenarios(), ids=NAMES)
def test_it_loads_without_a_finding(info: object) -> None:
    name, about = info  # type: ignore[misc]
    scenario = load_scenario(name)
    assert check(scenario) == []
    assert scenario.name == name
    assert scenario.about == about
    assert 20 < len(about) <= 110


def test_the_default_job_is_what_the_issue_says() -> None:
    scenario = load_scenario("mrac-rs232")
    assert (scenario.law.name, scenario.law.form, scenario.law.params["design"]) == ("mrac", "fixed", "repaired")
    assert (scenario.guidance.profile, scenario.link.url, scenario.board) == ("A", "pty", "process")
    assert (scenario.transport_delay_ticks, scenario.period_s) == (1, 0.5)


def test_as_printed_is_what_the_issue_says() -> None:
    scenario = load_scenario("mrac-as-printed")
    assert (scenario.law.form, scenario.law.params["design"], scenario.law.params["F0"]) == ("float", "printed", 0.01)
    assert scenario.actuators.wheels.torque_max_Nm == (None, None, None)
    assert (scenario.guidance.profile, scenario.guidance.wn_radps, scenario.guidance.reference) == ("B", 0.05, "paper")
    limited, direct = load_scenario("mrac-as-printed-limited"), load_scenario("mrac-as-printed-no-delay")
    assert (limited.law.form, limited.actuators.wheels.torque_max_Nm) == ("fixed", (0.1, 0.1, 0.1))
    assert (direct.transport_delay_ticks, direct.clock.mode) == (0, "lockstep")


def test_config_can_be_written_for_every_one_with_a_board() -> None:
    for name in NAMES:
        scenario = load_scenario(name)
        if scenario.board != "none":
            assert len(orders(scenario).configuration.rows) == len(scenario.setpoints())


def test_wire_time_of_the_serial_line() -> None:
    """10 bits a byte at 115200: a SAMPLE of 79 bytes is 6.86 ms, a COMMAND of 31 bytes 2.69 ms."""
    up, command, answer = wire_times_s(load_scenario("mrac-rs232"))
    assert up == pytest.approx(790 / 115200, abs=1e-9)
    assert command == pytest.approx(310 / 115200, abs=1e-9)
    assert command < answer < 0.02


# -- the plant alone --------------------------------------------------------------------------------------------------


def test_open_loop_is_the_golden_case() -> None:
    """Scenario, schedule and plant together reproduce tests/golden/basilisk/torque_dt0.01.csv."""
    scenario = load_scenario("rigid-open-loop")
    file = scenario.file_of("schedule")
    assert file is not None
    torque = read_schedule(file, scenario.period_s, scenario.ticks)
    table = np.loadtxt(GOLDEN / "basilisk" / "torque_dt0.01.csv", delimiter=",", skiprows=1)
    plant = Rigid.from_scenario(scenario)
    for k in range(scenario.ticks):
        motion = plant.motion(k * scenario.period_ns)
        assert np.abs(motion.q_BN * np.sign(motion.q_BN @ table[k, 1:5]) - table[k, 1:5]).max() < 5e-10
        assert np.abs(motion.omega_BN_B - table[k, 8:11]).max() < 1e-11
        plant.advance(torque[k], k * scenario.period_ns, scenario.period_ns)


def test_the_packaged_schedule_is_the_golden_one() -> None:
    file = load_scenario("rigid-open-loop").file_of("schedule")
    assert file is not None
    with file.open() as ours, (GOLDEN / "basilisk" / "torque_dt0.01.csv").open() as golden:
        for mine, theirs in zip(csv.DictReader(ours), csv.DictReader(golden), strict=False):
            assert [float(mine[name]) for name in ("t", "u1", "u2", "u3")] == [
                float(theirs[name]) for name in ("t", "u1", "u2", "u3")
            ]


def test_a_schedule_holds_from_its_time_on(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("t, u1, note, u2, u3\n0.5,1,x,2,3\n1.2,4,x,5,6\n")
    torque = read_schedule(tmp_path / "u.csv", 0.5, 5)
    np.testing.assert_array_equal(torque, [[0, 0, 0], [-1, -2, -3], [-1, -2, -3], [-4, -5, -6], [-4, -5, -6]])


# -- profiles ---------------------------------------------------------------------------------------------------------


def at(profile: str, t_s: float, period_s: float = 0.5) -> tuple[float, ...]:
    value: tuple[float, ...] = (0.0, 0.0, 0.0)
    for row in setpoints(Guidance(profile=profile), period_s, round(1200 / period_s)):
        if row.tick * period_s <= t_s:
            value = row.xyz_deg
    return value


@pytest.mark.parametrize(
    ("t_s", "expected"),
    [(59.5, (0, 0, 0)), (60, (25, 0, 0)), (109.5, (25, 0, 0)), (110, (25, 30, 0)), (160, (-25, 30, 0)),
     (210, (-25, -30, 0)), (260, (25, -30, 0)), (599.5, (-25, 30, 0))],
)  # fmt: skip
def test_manoeuvre_a_overlaps(t_s: float, expected: tuple[float, ...]) -> None:
    assert at("A", t_s) == expected


@pytest.mark.parametrize(
    ("t_s", "expected"),
    [(59.5, (0, 0, 0)), (60, (25, 0, 0)), (150, (-25, 0, 0)), (240, (0, 0, 0)), (330, (0, 30, 0)), (420, (0, -30, 0)),
     (510, (0, 0, 0)), (659.5, (0, 0, 0)), (660, (25, 0, 0)), (1020, (0, -30, 0))],
)  # fmt: skip
def test_manoeuvre_b_is_one_axis_after_the_other(t_s: float, expected: tuple[float, ...]) -> None:
    assert at("B", t_s) == expected


def test_a_change_between_ticks_waits_for_the_next() -> None:
    rows = setpoints(Guidance(profile="A"), 0.7, 200)
    assert rows[0].tick == math.ceil(60 / 0.7)


def test_hold_and_steps() -> None:
    hold = Guidance(profile="hold", hold_deg=(1.0, 2.0, 3.0))
    assert setpoints(hold, 0.5, 10) == ((0, (1.0, 2.0, 3.0)),)
    steps = load_scenario(
        "appc-rs232",
        [
            "guidance.profile=steps",
            "guidance.rows=[{t_s: 1, attitude_deg: [5, 0, 0]}, {t_s: 2, attitude_deg: [0, 0, 0]}]",
        ],
    )
    assert steps.setpoints() == ((2, (5.0, 0.0, 0.0)), (4, (0.0, 0.0, 0.0)))


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_every_profile_gives_ascending_rows_within_the_run(profile: str) -> None:
    guidance = {"profile": profile, "rows": ({"t_s": 3, "attitude_deg": (1, 2, 3)},) if profile == "steps" else ()}
    rows = setpoints(Guidance.model_validate(guidance), 0.5, 4000)
    assert [row.tick for row in rows] == sorted({row.tick for row in rows})
    assert all(0 <= row.tick < 4000 for row in rows)


# -- the table in the docs --------------------------------------------------------------------------------------------


def test_the_table_in_the_docs_is_current() -> None:
    """Make it again with: python -m sil.scenario_table > docs/reference/scenarios.md"""
    assert (Path(__file__).parents[3] / "docs" / "reference" / "scenarios.md").read_text(encoding="utf-8") == markdown()


@pytest.mark.parametrize("name", NAMES)
def test_what_the_table_says_is_all_that_differs(name: str) -> None:
    """A scenario made of the defaults and the rows of the table is the same scenario."""
    scenario = load_scenario(name)
    sets = [f"{key}={json.dumps(value)}" for key, value in non_defaults(scenario).items() if key != "schedule"]
    again = load_values({"law": {"name": scenario.law.name}}, sets).resolved()
    for key, value in scenario.resolved().items():
        if key not in ("name", "about", "require", "schedule", "variants"):
            assert again[key] == value
