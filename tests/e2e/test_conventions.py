"""Where it points, written as literals: at yaw +90 deg the nose (+x of the body) is along +y of the reference frame.

The same for roll and pitch, in /tf as a viewer composes it, in the log's quaternion and angles, in the exported CSV and
in the picture of `sil plot`. The report's page is held against the same literals in test_report_page.py.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_ros2.decoder import DecoderFactory as Ros2Decoder
from scipy.spatial.transform import Rotation

from sil import open_run
from sil.report.colours import LIGHT
from sil.report.export import export
from sil.report.plot import pages
from sil.runner import run_scenario
from sil.runs import Run
from sil.scenario import load_scenario

POINTED = {  # angles (roll, pitch, yaw) in deg, and where x, y, z of the body point in the reference frame then
    "roll": ((90, 0, 0), (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "pitch": ((0, 90, 0), (0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "yaw": ((0, 0, 90), (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
}
ORBITAL_IN_INERTIAL = ((0, 1, 0), (0, 0, -1), (-1, 0, 0))  # forward, -normal, down at the node on +x, equatorial
EACH = pytest.mark.parametrize(
    "run", [(n, f, s) for n in POINTED for f, s in (("lvlh", 321), ("inertial", 123))], indirect=True
)


@pytest.fixture(scope="module")
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, str]:
    """A satellite that stands at 90 deg about one axis of its frame, nobody controlling it; and which."""
    name, frame, sequence = request.param
    angles = list(POINTED[name][0])
    stands = f"plant.initial={{frame: {frame}, attitude_deg: {angles}, rate_kind: body_relative, q: null}}"
    orbit = "plant.orbit={inclination_deg: 0, u0_deg: 0}"
    attitude = f"attitude={{frame: {frame}, sequence: {sequence}}}"
    sets = [stands, orbit, attitude, "plant.gravity_gradient=false", "schedule=null", "require=[]", "duration_s=1"]
    folder = tmp_path_factory.mktemp(name)
    run_scenario(load_scenario("rigid-open-loop", sets), folder)
    return open_run(folder), name


def transforms(run: Run) -> dict[str, tuple[str, Rotation]]:
    """The first /tf: by child frame its parent, and the rotation of child to parent components."""
    with open(run.path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        first: Any = next(reader.iter_decoded_messages(topics=["/tf"]))[3]
    turns = {}
    for part in first.transforms:
        q = part.rotation
        turns[part.child_frame_id] = part.parent_frame_id, Rotation.from_quat([q.x, q.y, q.z, q.w])
    return turns


@EACH
def test_tf_turns_the_body_to_where_it_points(run: tuple[Run, str]) -> None:
    """As a viewer does it: a point of the body up to inertial, and down to the frame that is displayed."""
    log, name = run
    tf = transforms(log)
    assert (tf["body"][0], tf["orbital"][0]) == ("inertial", "inertial")
    assert np.allclose(tf["orbital"][1].apply(np.eye(3)), ORBITAL_IN_INERTIAL, atol=1e-7)
    up = tf["body"][1].apply(np.eye(3))
    seen = tf["orbital"][1].inv().apply(up) if log.scenario["attitude"]["frame"] == "lvlh" else up
    assert np.allclose(seen, POINTED[name][1:], atol=1e-7)


def test_speeds_of_wheels_are_those_relative_to_the_body(tmp_path: Path) -> None:
    """As the scenario gives them, in a body that turns, so that the absolute ones are others."""
    wheels = "actuators.wheels={inertia_kgm2: 0.01, initial_speed_radps: [100, -50, 0]}"
    rate = "plant.initial={rate_kind: body_inertial, rate_degps: [10, 20, 30]}"
    run_scenario(load_scenario("rigid-open-loop", [wheels, rate, "require=[]", "duration_s=1"]), tmp_path / "run")
    with open(tmp_path / "run" / "run.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[Ros2Decoder()])
        first: Any = next(reader.iter_decoded_messages(topics=["/joint_states"]))[3]
    assert first.name == ["wheel_x", "wheel_y", "wheel_z"]
    assert np.allclose(first.velocity, [100, -50, 0], atol=1e-12)


@EACH
def test_quaternion_of_the_log_and_of_tf_are_one(run: tuple[Run, str]) -> None:
    log, _ = run
    w, x, y, z = log["q_BN"][0]
    assert np.array_equal(transforms(log)["body"][1].as_quat(), Rotation.from_quat([x, y, z, w]).as_quat())


@EACH
def test_angles_of_the_log_the_csv_and_the_picture(run: tuple[Run, str], tmp_path: Path) -> None:
    log, name = run
    axis = list(POINTED).index(name)
    assert log.attitude_deg[0, axis] == pytest.approx(90.0, abs=1e-5)
    export(log, tmp_path / "run.csv")
    with open(tmp_path / "run.csv", newline="") as file:
        row = next(csv.DictReader(file))
    assert float(row[("phi_deg", "theta_deg", "psi_deg")[axis]]) == pytest.approx(90.0, abs=1e-5)
    (picture,) = pages([log], ["attitude"], False, LIGHT, whole=False)
    drawn = [line for line in picture.figure.axes[0].lines if line.get_color() == LIGHT.axes[axis]]
    assert any(line.get_ydata()[0] == pytest.approx(90.0, abs=1e-5) for line in drawn)
