"""From Python: sil.run and sil.open_run."""

from __future__ import annotations

import numpy as np
import pytest

import sil
from sil.run_columns import COLUMNS, TRIPLES
from sil.scenario_errors import ScenarioInvalid


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("api") / "run"
    overrides = {"law.params.controller_pole": 0.65, "sensors.attitude.noise_deg": 0.01}
    return sil.run("appc-rs232", out=folder, duration_s=60, board="inproc", require=[], **overrides)


def test_run_gives_arrays_by_name_with_units(run):
    assert run["phi_deg"].shape == run["t_s"].shape == (120,)
    assert run.attitude_deg.shape == (120, 3)
    assert run.units["command_x_Nm"] == "N m"
    assert run["t_s"][-1] == 59.5
    assert np.isfinite(run["g_x"]).all()


def test_the_docstring_says_every_name_and_its_unit():
    rows = [line.strip().strip("|").split("|") for line in sil.open_run.__doc__.splitlines() if line.count("|") == 4]
    said = {name: row[1].strip() for row in rows[2:] for name in row[0].split()}
    assert said == COLUMNS | TRIPLES


def test_overrides_are_what_ran(run):
    assert run.scenario["law"]["params"]["controller_pole"] == 0.65
    assert run.summary["verdict"] == "passed"


def test_open_run_reads_the_same(run):
    again = sil.open_run(run.directory)
    assert np.array_equal(again["phi_deg"], run["phi_deg"])


def test_an_unknown_name_lists_the_known_ones(run):
    with pytest.raises(KeyError, match="theta_deg"):
        run["pitch"]


def test_an_unknown_key_is_refused():
    with pytest.raises(ScenarioInvalid, match="known"):
        sil.run("appc-rs232", duration=60)
