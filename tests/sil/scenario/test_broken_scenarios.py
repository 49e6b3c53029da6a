"""Row 9 of the issue: every broken scenario is one line with key, line, what was expected and what stands there."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil.check_findings import Finding
from sil.checks import check_scenario

# name: (scenario, key, line, expected, got), the last two as parts of the text
BROKEN: dict[str, tuple[str, str, int, str, str]] = {
    "misspelt key": (
        "seed: 1\nplant:\n  inerta_kgm2: [2, 3, 3]\n",
        "plant.inerta_kgm2", 3, "did you mean inertia_kgm2?", "unknown key",
    ),
    "a requirement on what only the board knows": (
        "telemetry_every: 0\nrequire:\n  - {metric: peak_error_deg.max, below: 1}\n",
        "require[0].metric", 3, "a metric that can be known with telemetry_every 0", "'peak_error_deg.max'",
    ),
    "misspelt section": ("actuator: {}\n", "actuator", 1, "did you mean actuators?", "unknown key"),
    "unit in the value": ("period_s: 500 ms\n", "period_s", 1, "a number in s", "'500 ms'"),
    "unit in the value, deep": (
        "plant:\n  orbit:\n    radius_m: 7000 km\n", "plant.orbit.radius_m", 3, "a number in m", "'7000 km'",
    ),
    "two of three angles": (
        "plant:\n  initial: {attitude_deg: [1, 2]}\n",
        "plant.initial.attitude_deg", 2, "3 numbers in deg", "[1, 2]",
    ),
    "text among the angles": (
        "plant:\n  initial:\n    attitude_deg: [1, 2, ten]\n",
        "plant.initial.attitude_deg", 3, "3 numbers in deg", "[1, 2, 'ten']",
    ),
    "period of no whole number of us": (
        "period_s: 0.3333333\n", "period_s", 1, "a whole number of microseconds, nearest 0.333333 s", "0.3333333",
    ),
    "duration of no whole number of ticks": (
        "duration_s: 600.3\n", "duration_s", 1, "a whole number of periods of 0.5 s, nearest 600.5 s", "600.3",
    ),
    "negative seed": ("seed: -1\n", "seed", 1, "a number not below 0", "-1"),
    "truth instead of a number": ("hold_limit: true\n", "hold_limit", 1, "a whole number", "true"),
    "restarts without end": ("restart_limit: 1001\n", "restart_limit", 1, "a number not above 1000", "1001"),
    "number instead of truth": ("law: {}\nexpect_missed: 1\n", "expect_missed", 2, "true or false", "1"),
    "endless duration": ("duration_s: 1e305\n", "duration_s", 1, "a number in s not above 2.6e+11", "1e+305"),
    "infinite duration": ("duration_s: .inf\n", "duration_s", 1, "a finite number in s", "inf"),
    "key given twice": ("seed: 1\nperiod_s: 0.5\nseed: 2\n", "seed", 3, "each key once", "first in line 1"),
    "number beyond float64 among the angles": (
        "plant:\n  initial: {attitude_deg: [" + "9" * 399 + ", 0, 0]}\n",
        "plant.initial.attitude_deg", 2, "3 numbers in deg", "[999",
    ),
    "parameter beyond float64": (
        "law: {name: mrac, params: {c2_pole: " + "9" * 399 + "}}\n", "law.params.c2_pole", 1, "from 0 to 0.999", "999",
    ),
    "name of a file that no file can have": (
        "board: none\nschedule: " + "a" * 5000 + "\n", "schedule", 2, "a CSV file that exists", "'aaa",
    ),
    "user law in a file that no file can be": (
        "law: {name: ./" + "a" * 5000 + ".py:Law}\n", "law.name", 1, "a file that exists", "./aaa",
    ),
    "extends what no file can be called": ("extends: " + "a" * 5000 + "\n", "extends", 1, "one of", "'aaa"),
    "nesting without end": ("seed: 1\na: " + "[" * 3000 + "\n", "YAML", 2, "at most 12 levels", "a deeper nesting"),
    "key with a line break": ('"a\\nb": 1\n', "a\\nb", 1, "known: ", "unknown key"),
    "a thousand million laughs": (
        "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
        + "".join(f"a{n}: &a{n} [{', '.join(['*a' + str(n - 1)] * 10)}]\n" for n in range(1, 9)),
        "a4", 1, "at most 100000 values", "aliases",
    ),
    "broken YAML": ("seed: 1\nlaw: {name: pd\n", "YAML", 3, "valid YAML", "flow mapping"),
    "list at the top": ("- seed\n", "scenario", 1, "a mapping of keys", "a list"),
    "law that does not exist": ("law:\n  name: mrca\n", "law.name", 2, "did you mean mrac?", "'mrca'"),
    "version that does not exist": ("law: {name: pd, version: 9}\n", "law.version", 1, "2", "9"),
    "parameter of another law": (
        "law:\n  name: pd\n  params:\n    kappa: 0.5\n", "law.params.kappa", 4, "known: kp_bits", "unknown key",
    ),
    "parameter out of range": (
        "law: {name: mrac, params: {c2_pole: 1.5}}\n", "law.params.c2_pole", 1, "from 0 to 0.999", "1.5",
    ),
    "parameter of the wrong kind": (
        "law: {name: mrac, params: {design: repared}}\n", "law.params.design", 1, "did you mean repaired?", "'repared'",
    ),
    "user law without its file": ("law: {name: ./none.py:Law}\n", "law.name", 1, "a file that exists", "none.py:Law"),
    "unknown profile": ("guidance: {profile: C}\n", "guidance.profile", 1, "one of A, B, hold, steps", "'C'"),
    "steps out of order": (
        "guidance:\n  profile: steps\n  rows:\n    - {t_s: 5, attitude_deg: [1, 0, 0]}\n"
        "    - {t_s: 4, attitude_deg: [0, 0, 0]}\n",
        "guidance.rows[1].t_s", 5, "above 5", "4.0",
    ),
    "unknown metric": (
        "require:\n  - {metric: rms_eror_deg.roll, below: 1}\n",
        "require[0].metric", 2, "did you mean rms_error_deg?", "'rms_eror_deg.roll'",
    ),
    "metric without its axis": (
        "require:\n  - {metric: rms_error_deg, below: 1}\n",
        "require[0].metric", 2, "rms_error_deg.roll", "'rms_error_deg'",
    ),
    "wall-clock metric": (
        "require:\n  - {metric: timing.wall_s, below: 1}\n",
        "require[0].metric", 2, "wall-clock", "'timing.wall_s'",
    ),
    "requirement with two bounds": (
        "require:\n  - {metric: missed, below: 1}\n  - {metric: late, below: 1, above: 0}\n",
        "require[1]", 3, "exactly one of below, above, between", "below and above",
    ),
    "a number of 5000 digits": ("seed: " + "9" * 5000 + "\n", "seed", 1, "a whole number", "inf"),
    "clock of speed zero": ("clock: scaled:0\n", "clock.mode", 1, "N from 0.01 to 1000", "'scaled:0'"),
    "clock that rounds to zero": ("clock: scaled:0.000001\n", "clock.mode", 1, "from 0.01 to", "'scaled:0.000001'"),
    "clock too fast for HELLO": ("clock: scaled:100000\n", "clock.mode", 1, "N from 0.01 to 1000", "'scaled:100000'"),
    "name that leaves the directory": ("seed: 1\nname: ../../evil\n", "name", 2, "a name of letters", "'../../evil'"),
    "name that is a directory": ("name: ..\n", "name", 1, "a letter or digit first", "'..'"),
    "name of two words": ("name: my run\n", "name", 1, "a name of letters", "'my run'"),
    "unknown link": ("link: {url: tcp://x, baud: 9600}\n", "link.url", 1, "pty, udp, inproc", "'tcp://x'"),
    "impossible inertia": ("plant:\n  inertia_kgm2: [1, 1, 3]\n", "plant.inertia_kgm2", 2, "sum of the other", "3.0"),
    "inertia not symmetric": (
        "plant:\n  inertia_kgm2: [[2, 0.1, 0], [0, 3, 0], [0, 0, 3]]\n",
        "plant.inertia_kgm2", 2, "a symmetric matrix", "[[2, 0.1, 0]",
    ),
    "quaternion of norm two": (
        "plant: {initial: {q: [2, 0, 0, 0]}}\n", "plant.initial.q", 1, "of norm 1", "[2, 0, 0, 0]",
    ),
    "negative torque limit": (
        "actuators:\n  wheels:\n    torque_max_Nm: -0.1\n",
        "actuators.wheels.torque_max_Nm", 3, "a number in N m above 0", "-0.1",
    ),
    "torque scale too fine": (
        "actuators: {wheels: {torque_max_Nm: 5}}\nwire: {torque_bits: 30}\n", "wire.torque_bits", 2, "at most 28", "30",
    ),
    "schedule with a board": ("schedule: x.csv\n", "schedule", 1, "board none only", "board process"),
    "schedule that is not there": ("board: none\nschedule: x.csv\n", "schedule", 2, "a CSV file", "'x.csv'"),
    "extends nothing": ("seed: 1\nextends: mrac-rs233\n", "extends", 2, "did you mean mrac-rs232?", "'mrac-rs233'"),
    "metrics after the end": ("duration_s: 5\nmetrics: {from_tick: 10}\n", "metrics.from_tick", 2, "below 10", "10"),
    # loads, but cannot work
    "answer too slow": (
        "period_s: 0.3\nanswer_delay_s: 0.345\n", "answer_delay_s", 2, "COMMAND within 1 x 0.3 s", "345 ms execution",
    ),
    "line too slow": ("link:\n  url: pty\n  baud: 1200\n", "link.baud", 3, "within sample_timeout_s", "658 ms on"),
    "period the law cannot use": ("law: {name: appc}\nperiod_s: 0.1\n", "period_s", 2, "from 0.2 to 1", "0.1"),
    "delay the law cannot use": (
        "law: {name: appc}\ntransport_delay_ticks: 2\n", "transport_delay_ticks", 2, "1 for law appc", "2",
    ),
    "no delay in real time": (
        "law: {name: pd}\ntransport_delay_ticks: 0\nclock: realtime\n", "clock", 3, "lockstep", "realtime",
    ),
    "sensor that the law needs": (
        "sensors:\n  attitude: {enabled: false}\n", "sensors.attitude.enabled", 2, "law appc reads it", "false",
    ),
    "timeout longer than the period": (
        "sample_timeout_s: 0.5\n", "sample_timeout_s", 1, "below the period", "0.5",
    ),
}  # fmt: skip


def errors(file: Path, text: str) -> list[Finding]:
    file.write_text(text)
    return [finding for finding in check_scenario(str(file)) if finding.severity == "error"]


def test_there_are_enough_of_them() -> None:
    assert len(BROKEN) >= 20


@pytest.mark.parametrize("name", BROKEN)
def test_broken_scenario_is_one_line(name: str, tmp_path: Path) -> None:
    text, key, line, expected, got = BROKEN[name]
    found = errors(tmp_path / "broken.yaml", text)
    assert len(found) == 1, [str(each) for each in found]
    finding = found[0]
    assert (finding.key, finding.line) == (key, line)
    assert expected in finding.expected
    assert got in finding.got
    shown = str(finding)
    assert "\n" not in shown
    assert shown.startswith(f"{tmp_path / 'broken.yaml'}:{line}: {key}: ")
    assert len(shown) < len(str(tmp_path)) + 400


def test_several_faults_are_several_lines_in_the_order_of_the_file(tmp_path: Path) -> None:
    found = errors(tmp_path / "broken.yaml", "seed: x\nplant: {step_s: 0}\nclok: lockstep\n")
    assert [finding.line for finding in found] == [1, 2, 3]
    assert [finding.key for finding in found] == ["seed", "plant.step_s", "clok"]


def test_a_broken_schedule_says_its_own_line(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("t,u1,u2,u3\n0,0,0,0\n1,0,zero,0\n")
    found = errors(tmp_path / "broken.yaml", "board: none\nschedule: u.csv\n")
    assert [str(each) for each in found] == [
        f"{tmp_path / 'u.csv'}:3: schedule: expected finite numbers t, u1, u2, u3, got 1,0,zero,0"
    ]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("period_s=500 ms", "--set period_s: expected a number in s, got '500 ms'"),
        ("plant.step=1", "--set plant.step: unknown key; known: kind, "),
        ("law.params.kappa=2", "--set law.params.kappa: expected a number from 0 to 1, got 2"),
        ("plant={step: 1}", "--set plant: plant.step: unknown key; known: kind, "),
        ("seed", "--set: 'seed': expected KEY=VALUE, such as law.form=float, got no KEY="),
        ("law.form={", "--set law.form: YAML: expected valid YAML, got "),
        ("require.9.below=1", "--set require.9.below: expected a list with an item 9, got 6 of them"),
    ],
)
def test_a_bad_override_names_itself(override: str, line: str) -> None:
    found = check_scenario("mrac-rs232", [override])
    assert len(found) == 1, [str(each) for each in found]
    assert str(found[0]).startswith(line)


def test_an_unknown_name_lists_the_built_ins() -> None:
    (found,) = check_scenario("mrac-rs23")
    assert str(found).startswith("scenario: expected a file or one of appc-rs232, ")
    assert "(did you mean mrac-rs232?), got 'mrac-rs23'" in str(found)


def test_a_circle_of_extends_is_refused(tmp_path: Path) -> None:
    (tmp_path / "b.yaml").write_text("extends: a.yaml\n")
    (found,) = errors(tmp_path / "a.yaml", "extends: b.yaml\n")
    assert (found.key, found.expected) == ("extends", "no circle")
    assert found.got == "a -> b -> a"


def test_expect_missed_admits_a_deadline_that_cannot_be_met(tmp_path: Path) -> None:
    assert errors(tmp_path / "x.yaml", "period_s: 0.3\nanswer_delay_s: 0.345\nexpect_missed: true\n") == []
    assert errors(tmp_path / "x.yaml", "period_s: 0.4\nanswer_delay_s: 0.345\nlink: {url: pty, baud: 115200}\n") == []


WARNINGS = {
    "noise below the LSB": ("sensors: {attitude: {noise_deg: 1e-5, bits: 16}}", "sensors.attitude.noise_deg"),
    "speed without inertia": (
        "actuators: {wheels: {initial_speed_radps: 100}}", "actuators.wheels.initial_speed_radps",
    ),
    "too fast a start": (
        "actuators: {wheels: {initial_speed_radps: 400, inertia_kgm2: 1e-3}}", "actuators.wheels.initial_speed_radps",
    ),
    "wheels filled by a disturbance": ("plant: {disturbance_Nm: [1e-3, 0, 0]}", "plant.disturbance_Nm.constant_Nm"),
    "too weak wheels": ("actuators: {wheels: {torque_max_Nm: 0.07}}", "actuators.wheels.torque_max_Nm"),
    "too small wheels": ("actuators: {wheels: {momentum_max_Nms: 0.09}}", "actuators.wheels.momentum_max_Nms"),
    "a board that has no time to be ready": (
        "clock: scaled:20\nevents: [{at_s: 10, do: board.restart, for_s: 2}]", "events[0].for_s",
    ),
    "a limit beyond the period": (
        "clock: scaled:20\ntiming: {max_lateness_ms: 100}", "timing.max_lateness_ms",
    ),
    "a reference that nobody knows": ("telemetry_every: 0", "telemetry_every"),
    "more torque than a law has registers for": (
        "actuators: {wheels: {torque_max_Nm: 20}}", "actuators.wheels.torque_max_Nm",
    ),
    "momentum too coarse to read a torque in": ("law: {name: appc}\nwire: {momentum_bits: 13}", "wire.momentum_bits"),
    "restarts of a board that nobody starts again": ("restart_limit: 2", "restart_limit"),
    "reference too fast to sample": (
        "guidance: {wn_radps: 1.5, profile: hold}\nplant: {initial: {attitude_deg: [0, 0, 0]}}", "guidance.wn_radps",
    ),
}  # fmt: skip


@pytest.mark.parametrize("board", ["cortex-m", "qemu", "/dev/ttyUSB0", "udp://127.0.0.1:5005"])
def test_a_board_that_can_restart_may(board: str, tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text(f"board: {board}\nrestart_limit: 2\n")
    assert check_scenario(str(tmp_path / "x.yaml")) == []


@pytest.mark.parametrize("name", WARNINGS)
def test_what_looks_wrong_is_a_warning(name: str, tmp_path: Path) -> None:
    text, key = WARNINGS[name]
    (tmp_path / "odd.yaml").write_text(text)
    found = check_scenario(str(tmp_path / "odd.yaml"))
    assert {finding.severity for finding in found} == {"warning"}
    assert {finding.key for finding in found} == {key}
    assert all(str(finding).startswith("warning: ") for finding in found)
