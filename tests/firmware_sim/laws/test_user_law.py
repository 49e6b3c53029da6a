"""A user's own law: loaded by path, refused in one line when it is not one, flown like any other."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.controllers import inputs, user_law
from firmware_sim.controllers.user import LawFailed, LawFileError, load_user_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import USER_LAW_ID, config_words, parse_configuration

MY_PD = Path(__file__).resolve().parents[3] / "docs" / "examples" / "my_pd.py"


def build(spec: str, form: str = "float", **values: object):
    table, cls = load_user_law(spec)
    configuration = parse_configuration(config_words(table, {"form": form} | values), table)
    return user_law(cls, configuration), Reference(configuration.common, form == "float"), configuration


def write(tmp_path: Path, body: str) -> str:
    file = tmp_path / "their_law.py"
    file.write_text(body)
    return f"{file}:Law"


def given(form: str, y: float, k: int, fresh: bool = True) -> np.ndarray:
    inp = np.zeros(inputs.SIZE)
    inp[[inputs.FRESH, inputs.TICK]] = fresh, k
    inp[inputs.EULER] = y
    if form == "fixed":
        inp[inputs.EULER] = np.round(y / (2 * math.pi) * 2**32)
    return inp if form == "float" else inp.astype(np.int64)


def test_a_strangers_pd_is_short() -> None:
    assert len(MY_PD.read_text().splitlines()) <= 25


@pytest.mark.parametrize("form", ["float", "fixed"])
def test_it_flies(form: str) -> None:
    law, reference, configuration = build(f"{MY_PD}:MyPd", form)
    assert configuration.table.law_id == USER_LAW_ID and configuration.params["kp"] == 20000
    out, lsb = np.zeros(4, np.float64 if form == "float" else np.int64), 1.0 if form == "float" else 2.0**-30
    ym = [0.1, 0.1, 0.1 * (1 - (1 - configuration.values["reference_pole"]) ** 2)]  # zoh, lead 2, set-point 0
    for k in range(3):
        inp = given(form, 0.1, k)
        reference.advance(inp)
        law.step(inp, reference.state, out)
        expected = 0.02 * (ym[k] - 0.1) + 0.25 * ((ym[k] - ym[k - 1]) if k else 0.0) / 0.5
        assert out[:3] * lsb == pytest.approx([expected] * 3, abs=1e-8)
        assert out[3] == 0
    law.step(given(form, 0.5, 3, fresh=False), reference.state, out)
    assert out[:3] * lsb == pytest.approx([expected] * 3, abs=1e-8)  # repeated; the stale reading was not looked at
    assert not law.has_model and law.telemetry() == [] and not law.reference_restarted


def test_before_the_first_reading_it_is_starting() -> None:
    law, reference, _ = build(f"{MY_PD}:MyPd")
    out = np.ones(4)
    law.step(given("float", 0.3, 0, fresh=False), reference.state, out)
    assert out.tolist() == [0, 0, 0, inputs.STARTING]


def test_a_law_with_a_model_is_asked_without_a_reading_and_never_sees_a_stale_one(tmp_path: Path) -> None:
    spec = write(
        tmp_path,
        "class Law:\n    MODEL = True\n    def step(self, s):\n"
        "        return [float(s.fresh), s.attitude_rad[0], s.tick]\n",
    )
    law, reference, _ = build(spec)
    out = np.zeros(4)
    law.step(given("float", 0.3, 0), reference.state, out)
    assert out[:3].tolist() == [1.0, 0.3, 0.0]
    law.step(given("float", 0.3, 1, fresh=False), reference.state, out)
    assert out[0] == 0.0 and math.isnan(out[1]) and out[2] == 1.0


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("x = 1\n", "no class Law"),
        ("Law = 3\n", "no class Law"),
        ("class Law(:\n", "line 1: invalid syntax"),
        ("import nowhere_to_be_found\n", "line 1: ModuleNotFoundError"),
        ("class Law: pass\n", "expected a method step"),
        ("class Law:\n    PARAMS = {'k': (1, 'N', 1e-6)}\n    def step(self, s): ...\n", "expected a method init"),
        ("class Law:\n    PARAMS = 3\n    def step(self, s): ...\n", "PARAMS: expected"),
        (
            "class Law:\n    PARAMS = {'k': 3}\n    def init(self, p): ...\n    def step(self, s): ...\n",
            "PARAMS['k']: exp",
        ),
        (
            "class Law:\n    PARAMS = {'k': (9, '', 1e-9)}\n    def init(self, p): ...\n    def step(self, s): ...\n",
            "does not fit 32 bits",
        ),
        (
            "class Law:\n    PARAMS = {'law_id': (9, '', 1)}\n    def init(self, p): ...\n    def step(self, s): ...\n",
            "is not a free name",
        ),
    ],
)
def test_what_is_no_law_is_refused_in_one_line(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(LawFileError) as error:
        load_user_law(write(tmp_path, body))
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("spec", ["my_law", "my_law.txt:Law", "my_law.py:", "/nowhere/my_law.py:Law"])
def test_bad_names(spec: str) -> None:
    with pytest.raises(LawFileError):
        load_user_law(spec)


def test_an_exception_names_file_and_line(tmp_path: Path) -> None:
    law, reference, _ = build(write(tmp_path, "class Law:\n    def step(self, s):\n        return 1 / 0\n"))
    with pytest.raises(LawFailed, match=r"law Law: step: ZeroDivisionError: .* \(their_law.py, line 3\)"):
        law.step(given("float", 0.0, 0), reference.state, np.zeros(4))


@pytest.mark.parametrize("answer", ["None", "[1, 2]", "'abc'", "{}"])
def test_what_is_no_torque_is_said(tmp_path: Path, answer: str) -> None:
    law, reference, _ = build(write(tmp_path, f"class Law:\n    def step(self, s):\n        return {answer}\n"))
    with pytest.raises(LawFailed, match="expected three numbers"):
        law.step(given("float", 0.0, 0), reference.state, np.zeros(4))
