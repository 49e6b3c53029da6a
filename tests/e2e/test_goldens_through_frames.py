"""Float laws through frames, board process's code in process, against the study's trajectories: 1e-5 deg, 1e-6 N m.

What frames add to stepping law and plant directly: angles in 2^-32 turn, torques in 2^-30 N m, parameters as CONFIG
words. MIN_A identifies, and identification amplifies rounding: the study asks 1e-3 deg and 1e-5 N m of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sil.runner import run_scenario
from sil.runs import open_run
from sil.scenario import load_values

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "mrac"
W0 = 1.0830778e-3  # rad/s, study
MU = 3.986004418e14
I0 = np.array([2.13, 3.04, 3.09])

CASES = {
    "BEST_A": ({"name": "appc"}, {}, 1e-5, 1e-6),
    "BESTg_A": ({"name": "appc", "params": {"gyro": True}}, {}, 1e-5, 1e-6),
    "BESTmis_adapt_A": ({"name": "appc"}, {"inertia_kgm2": (I0 * (1.3, 0.75, 0.8)).tolist()}, 1e-5, 1e-6),
    "MIN_fixed_A": ({"name": "mrac", "params": {"identify": False}}, {}, 1e-5, 1e-6),
    "MIN_A": ({"name": "mrac"}, {}, 1e-3, 1e-5),
    "MID_A": ({"name": "mrac", "params": {"decouple": True}}, {}, 1e-5, 1e-6),
    "PD50_A": ({"name": "pd"}, {}, 1e-5, 1e-6),
}


@pytest.mark.parametrize("name", CASES)
def test_golden_through_frames(tmp_path, name):
    law, plant, angle_deg, torque_Nm = CASES[name]
    golden = np.loadtxt(GOLDEN / f"{name}.csv", delimiter=",")
    scenario = load_values(
        {
            "name": name,
            "board": "inproc",
            "link": "inproc",
            "law": {"form": "float", **law},
            "plant": {"orbit": {"mu": MU, "radius_m": (MU / W0**2) ** (1 / 3)}, **plant},
        }
    )
    run = open_run(run_scenario(scenario, tmp_path / "run")["run_dir"])
    assert len(run) == len(golden) == 1200
    angle = np.abs(run.attitude_deg - golden[:, 1:4]).max()
    torque = np.abs(run.command_Nm - golden[:, 7:10]).max()
    print(f"{name}: {angle:.2e} deg, {torque:.2e} N m")
    assert angle <= angle_deg
    assert torque <= torque_Nm
    assert np.abs(run.reference_deg - golden[:, 4:7]).max() <= max(angle_deg, 2e-5)
