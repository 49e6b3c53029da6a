"""sil design as a user meets it: figures, files, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from sil.cli import invoke
from sil.configure import orders
from sil.design.fuzzy import half_table, one_input
from sil.design.linear import StateSpace
from sil.scenario import load_scenario


def test_the_table_says_what_was_designed(capsys: pytest.CaptureFixture[str]) -> None:
    command = "design lqg --inertia 0.01 --control-bandwidth 0.316227766 --observer-bandwidth 10 --integral 1"
    assert invoke(command.split()) == 0
    assert "C(s) = 0.0826669 (1 + 5.613 s + (3.906 s)^2) / (s (1 + 0.1286 s" in capsys.readouterr().out


def test_json_yaml_file_and_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = [
        "design",
        "glover",
        "--wc",
        "0.25",
        "--delay",
        "0.75",
        "--inertia",
        "2.13,3.04,3.09",
        "--period",
        "0.5",
        "--order",
        "4",
    ]
    files = ["--out", str(tmp_path / "law.yaml"), "--plot", str(tmp_path / "page.png")]
    assert invoke([*command, "--json", *files]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["margins"]["every 0.5 s, 1 tick late"]["delay_s"] > 2.0
    assert content["discrete"]["order"] == 4
    assert invoke([*command, "--yaml"]) == 0
    printed = capsys.readouterr().out
    assert printed == (tmp_path / "law.yaml").read_text()
    params = yaml.safe_load(printed)["law"]["params"]
    assert [len(row) for row in params["A"]] == [4] * 4 and params["gain"] == [2.13, 3.04, 3.09]
    assert params["D"] == pytest.approx(content["discrete"]["D"][0][0], rel=1e-11)
    assert (tmp_path / "page.png").read_bytes().startswith(b"\x89PNG")


def test_what_the_board_is_told_answers_as_what_was_designed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """From the section over the scenario to CONFIG's words and back: within the 0.1 % that the bits promise."""
    command = [
        "design",
        "glover",
        "--wc",
        "0.25",
        "--delay",
        "0.75",
        "--integral",
        "0.02",
        "--inertia",
        "2,3,4",
        "--period",
        "0.5",
        "--json",
        "--out",
    ]
    assert invoke([*command, str(tmp_path / "law.yaml")]) == 0
    designed = json.loads(capsys.readouterr().out)["discrete"]
    values = orders(load_scenario(str(tmp_path / "law.yaml"))).configuration.values
    n = designed["order"]
    A = np.array([[values[f"A_{i}_{k}"] for k in range(1, n + 1)] for i in range(1, n + 1)])
    B, C = (np.array([values[f"{name}_{i}"] for i in range(1, n + 1)]) for name in "BC")
    told = StateSpace(A, B[:, None], C[None], np.array([[values["D"]]]), 0.5)
    meant = StateSpace(*(np.array(designed[name]) for name in "ABCD"), 0.5)
    omega = np.geomspace(1e-2, 6.0, 50)
    np.testing.assert_allclose(told.response(omega), meant.response(omega), rtol=1e-4)
    assert [values[f"gain_{axis}"] for axis in "xyz"] == pytest.approx([2, 3, 4], rel=1e-8)
    assert values["state_bits"] == 28


def test_a_fuzzy_table_arrives_at_the_law(tmp_path: Path) -> None:
    """Its 65 words hold -f(e)/L of MATLAB's sets, in Q15."""
    file = tmp_path / "law.yaml"
    assert invoke(["design", "fuzzy", "--error", "0.4", "--inputs", "matlab", "--out", str(file)]) == 0
    values = orders(load_scenario(str(file), ["sensors.rate.enabled=true"])).configuration.values
    table = [values[f"f_table_{i}"] for i in range(1, 66)]
    np.testing.assert_allclose(table, half_table(one_input(0.4, 1.0, "matlab")), atol=2**-16)
    assert values["inference"] == 1 and values["E"] == pytest.approx(0.4)


def test_an_unstable_loop_is_said_so_and_a_drifting_one_warned_of(capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["design", "printed", "lqg-5.1", "--actuator-gain", "0.01"]) == 1
    assert "UNSTABLE" in capsys.readouterr().out
    assert invoke(["design", "printed", "ls-5.2", "--period", "0.1"]) == 0
    out = capsys.readouterr().out
    assert "drifts" in out and "warning: no stiffness" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("glover --wc -1", "--wc: expected 1e-06 to 1e+06, got -1"),
        ("lqg --inertia 1,2", "--inertia: expected a number or three"),
        ("lqg --yaml", "--yaml, --out: expected --period"),
        ("printed pd-2 --period 0.1 --yaml", "expected a compensator with states"),
        ("printed lqg-9", "NAME: expected one of pd-1"),
        ("glover --pade 7", "Pade order: expected one of 1, 2, 3, 4, got 7"),
        ("glover --gamma 1", "gamma: expected 1.0001 to 100 times the least"),
        ("glover --method euler", "--method: expected one of ramp, zoh, tustin, got euler"),
        ("glover --period 0.1 --order 0", "--order: expected a number of states, at least 1, got 0"),
        ("fuzzy --entries 2", "--entries: expected 3 to 257"),
        ("fuzzy --angle 0.5 --yaml", "expected one input and 65 entries"),
        ("fuzzy --inputs gauss", "--inputs: expected one of ruspini, matlab, got gauss"),
        ("fuzzy --csv /nowhere/table.csv", "/nowhere/table.csv: No such file"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["design", *arguments.split()]) == 2
    out, err = capsys.readouterr()
    assert says in err and len(err.splitlines()) == 1 and out == ""


@pytest.mark.parametrize("kind", ["lqg", "glover", "printed", "fuzzy"])
def test_every_kind_has_help_with_examples(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["design", kind, "-h"]) == 0
    out = capsys.readouterr().out
    assert f"   sil design {kind}" in out and "Exit codes" in out
