"""A user's own plant: flown by its path, its file part of the identity of a run, its mistakes one line each."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from sil.replay import replay
from sil.runner import run_scenario
from sil.runs import open_run
from sil.scenario import ScenarioInvalid, load_scenario
from sil.trouble import SilError

PLANT = """\
from sil.plants.rigid import Rigid

class Mine(Rigid):
    def motion(self, t_ns):
        return super().motion(t_ns)

class Half:
    @classmethod
    def from_scenario(cls, scenario): return cls()
    def motion(self, t_ns): return 1.0

class Late(Rigid):
    def advance(self, torque_B, t_ns, period_ns):
        if t_ns == 2_000_000_000:
            raise ArithmeticError("two seconds\\nare enough")
"""


def scenario(folder: Path, kind: str, *sets: str):
    (folder / "plant.py").write_text(PLANT)
    (folder / "s.yaml").write_text(f"duration_s: 10\nboard: inproc\nplant: {{kind: '{kind}'}}\n")
    return load_scenario(folder / "s.yaml", sets)


def test_it_flies_and_replays_and_the_log_knows_its_file(tmp_path: Path) -> None:
    own = run_scenario(scenario(tmp_path, "./plant.py:Mine"), tmp_path / "own")
    ours = run_scenario(scenario(tmp_path, "rigid"), tmp_path / "ours")
    assert own["metrics"]["rms_error_deg"] == ours["metrics"]["rms_error_deg"]
    run = open_run(tmp_path / "own")
    assert run.meta["plant_file_sha256"] == hashlib.sha256(PLANT.encode()).hexdigest()
    assert "plant_file_sha256" not in open_run(tmp_path / "ours").meta
    (tmp_path / "plant.py").unlink()
    assert replay(run).identical, "a replay needs the board only"


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("rgid", "plant.kind: expected one of rigid (did you mean rigid?), or ./FILE.py:CLASS, got 'rgid'"),
        ("./none.py:Mine", "plant.kind: expected a file that exists, got './none.py:Mine'"),
        ("./plant.py:Yours", "plant.kind: expected a class of plant.py (Mine, Half, Late), got './plant.py:Yours'"),
    ],
)
def test_what_is_no_plant_is_refused_before_anything_runs(tmp_path: Path, kind: str, expected: str) -> None:
    with pytest.raises(ScenarioInvalid) as refused:
        scenario(tmp_path, kind)
    assert str(refused.value).endswith(expected)


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("Half", "plant.py: expected class Half with from_scenario, motion, advance, got none called advance"),
        ("Late", "plant.py:15: the plant raised ArithmeticError: two seconds are enough"),
    ],
)
def test_what_it_does_wrong_is_one_line_with_its_place(tmp_path: Path, kind: str, line: str) -> None:
    flown = scenario(tmp_path, f"./plant.py:{kind}")
    with pytest.raises(SilError) as failed:
        run_scenario(flown, tmp_path / "run")
    assert str(failed.value).endswith(line)
    assert "\n" not in str(failed.value)


def test_a_motion_that_is_none_is_refused_at_the_start(tmp_path: Path) -> None:
    text = PLANT + "    def motion(self, t_ns): return 1.0\n"
    made = scenario(tmp_path, "./plant.py:Late")
    (tmp_path / "plant.py").write_text(text)
    with pytest.raises(SilError, match=r"plant\.py: expected a sil\.signals\.Motion from motion\(\), got float$"):
        run_scenario(made, tmp_path / "run")
