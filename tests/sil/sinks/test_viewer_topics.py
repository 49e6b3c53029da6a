"""What a viewer is shown is what the journal says: frames of /tf, wheels, scene, log; nothing is invented."""

from __future__ import annotations

import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
import pytest
from feeding import PERIOD_NS, Feed, configured, session, truth
from foxglove_schemas_protobuf.Log_pb2 import Log
from scipy.spatial.transform import Rotation
from synthetic import synthetic_journal

from protocol import events
from protocol.frames import Telemetry
from sil.runs import open_run
from sil.sinks import journal as jn
from sil.sinks.journal import Kind, Record
from sil.sinks.mcap_rows import TimingRows
from sil.sinks.seal import seal
from sil.sinks.viewer import WHEELS

HALF = math.sqrt(0.5)
ALL = ["body", "orbital", "horizon", "reference"]  # frames of a tick, in their order
ZERO = (0.0, 0.0, 0.0)
EQUATORIAL = {"plant": {"orbit": {"radius_m": 7.0e6, "mu": 4.0e14, "inclination_deg": 0.0, "u0_deg": 0.0}}}


def rotation(q: tuple[float, ...]) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


# -- /tf -------------------------------------------------------------------------------------------------------------


def test_body_in_the_orbital_frame_has_the_angles_of_the_log_and_the_reference_is_telemetrys() -> None:
    euler = np.radians([20.0, -30.0, 40.0])
    q_BN = np.roll(Rotation.from_rotvec([0.3, -0.2, 1.0]).as_quat(), 1)
    feed = Feed()
    answer = (feed.telemetry(0, (0, 0, 90)), feed.begins(0))
    feed.tick(0, session(0), *configured(), *answer, truth(0, q_BN, ZERO, ZERO, euler))
    (tf,) = feed.transforms()
    assert list(tf) == ALL
    assert [tf[frame][0] for frame in tf] == ["inertial", "inertial", "orbital", "orbital"]
    assert tf["body"][1] == tuple(q_BN)
    in_orbital = rotation(tf["orbital"][1]).inv() * rotation(tf["body"][1])
    assert np.allclose(in_orbital.as_euler("ZYX")[::-1], euler, atol=1e-14)
    assert np.allclose(tf["reference"][1], (HALF, 0.0, 0.0, HALF), atol=1e-15)


def test_of_an_inertial_frame_the_orbit_is_the_scenarios_and_the_reference_stands_in_inertial() -> None:
    """Equatorial orbit at its ascending node on +x: x of the orbital frame is forward (+y), z is down (-x)."""
    feed = Feed({"attitude": {"sequence": 123, "frame": "inertial"}, **EQUATORIAL})
    feed.tick(0, *configured(), feed.begins(0), feed.telemetry(0, (0, 90, 0)), truth(0))
    (tf,) = feed.transforms()
    assert tf["reference"] == ("inertial", pytest.approx((HALF, 0.0, HALF, 0.0), abs=1e-15))
    axes = rotation(tf["orbital"][1]).apply(np.eye(3))
    assert np.allclose(axes, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], atol=1e-15)
    level = (rotation(tf["orbital"][1]) * rotation(tf["horizon"][1])).apply(np.eye(3))  # forward, normal, up
    assert np.allclose(level, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


def test_a_reference_that_is_not_known_is_not_sent() -> None:
    """Not in ticks without TELEMETRY, not before the board's model began, not after a restart until it begins again."""
    feed = Feed()
    feed.tick(0, session(0), *configured(telemetry_every=2), feed.telemetry(0, (0, 0, 0)), truth(0))
    feed.tick(1, truth(1))
    feed.tick(2, feed.telemetry(2, (0, 0, 10)), feed.begins(2), truth(2))
    feed.tick(3, truth(3))
    feed.tick(4, session(4), feed.telemetry(4, (0, 0, 0)), truth(4))
    feed.tick(6, feed.telemetry(6, (0, 0, 20)), feed.begins(6), truth(6))
    assert ["reference" in tf for tf in feed.transforms()] == [False, False, True, False, False, True]


def test_where_the_board_follows_the_setpoint_itself_that_is_the_reference() -> None:
    feed = Feed()
    feed.tick(0, *configured(reference_kind="none", telemetry_every=0), truth(0, setpoint_deg=(90, 0, 0)))
    assert feed.transforms()[0]["reference"][1] == pytest.approx((HALF, HALF, 0.0, 0.0), abs=1e-15)
    assert "reference" in [entity.id for entity in feed.sheet.of("/scene")[0].entities]


@pytest.mark.parametrize(
    ("values", "board", "known", "frames"),
    [
        ({"telemetry_every": 0}, True, True, ALL[:-1]),  # its reference is nowhere in the log
        ({"reference_kind": "none", "rate_limit": 100, "telemetry_every": 0}, True, True, ALL[:-1]),
        ({}, False, True, ALL[:-1]),  # nobody follows anything
        ({}, True, False, ["body"]),  # a log that has no scenario
    ],
)
def test_what_nobody_knows_is_neither_a_frame_nor_in_the_scene(
    values: dict[str, object], board: bool, known: bool, frames: list[str]
) -> None:
    feed = Feed(known=known)
    feed.tick(0, *(configured(**values) if board else ()), truth(0))
    assert list(feed.transforms()[0]) == frames
    assert {entity.frame_id for entity in feed.sheet.of("/scene")[0].entities} == set(frames) - {"horizon"}


@pytest.mark.parametrize(
    "nonsense",
    [
        "a text",
        {"attitude": "a text"},
        {"attitude": {"sequence": "yaw first"}},
        {"plant": {"orbit": {"radius_m": 0.0}}},
        {"plant": {"orbit": {"mu": -1.0}}},
        {"plant": {"orbit": {"u0_deg": math.nan}}},
        {"actuators": {"kind": "wheels", "wheels": {"inertia_kgm2": [1.0]}}},
    ],
)
def test_a_scenario_that_makes_no_sense_is_as_good_as_none(nonsense: object) -> None:
    """The log is made all the same; that it makes no sense is said to whoever opens it."""
    feed = Feed()
    feed.rows.meta({"scenario": nonsense})
    feed.tick(0, *configured(), feed.telemetry(0, (0, 0, 0)), feed.begins(0), truth(0))
    assert list(feed.transforms()[0]) == ["body"]
    assert not feed.sheet.of("/joint_states")


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_what_is_not_a_number_is_no_transform(wrong: float) -> None:
    """A plant that runs away leaves a log all the same; what comes after is shown again."""
    feed = Feed()
    feed.tick(0, *configured(), feed.begins(0), feed.telemetry(0, (0, 0, 0)), truth(0, euler_rad=(0.0, wrong, 0.0)))
    feed.tick(1, feed.telemetry(1, (0, 0, 0)), truth(1, q_BN=(wrong, 0.0, 0.0, 0.0), momentum=(wrong, 0.0, 0.0)))
    feed.tick(2, feed.telemetry(2, (0, 0, 0)), truth(2))
    assert [list(tf) for tf in feed.transforms()] == [
        ["body", "reference"],
        ["reference"],
        ALL,
    ]


def test_a_board_whose_telemetry_is_too_short_has_no_reference() -> None:
    feed = Feed()
    short = feed.down(Telemetry(0, 9999, 1, (5, 5)))
    feed.tick(0, *configured(), feed.begins(0), short, truth(0))
    assert list(feed.transforms()[0]) == ALL[:-1]


def test_signs_are_continuous() -> None:
    """Half a turn about x on one side and the other: q and -q are the same attitude, between them nothing jumps."""
    feed = Feed()
    feed.tick(0, *configured(), feed.begins(0))
    for k, deg in enumerate((170, 179, -179, -170)):  # of a plant and a board that wrap at half a turn
        half = math.radians(deg) / 2
        q_BN = (math.cos(half), math.sin(half), 0.0, 0.0)
        feed.tick(k, feed.telemetry(k, (deg, 0, 0)), truth(k, q_BN, ZERO, ZERO, (math.radians(deg), 0.0, 0.0)))
    for frame in ("body", "orbital", "reference"):
        q = np.array([tf[frame][1] for tf in feed.transforms() if frame in tf])
        assert ((q[1:] * q[:-1]).sum(axis=1) > 0.9).all(), frame


def test_a_telemetry_without_its_tick_is_a_transform_of_its_own() -> None:
    """A live view shows a tick before the answer to it has come."""
    feed = Feed()
    feed.tick(0, *configured(), feed.begins(0), feed.telemetry(0, (0, 0, 0)), truth(0))
    feed.tick(1, truth(1))
    feed.tick(1, feed.telemetry(1, (0, 0, 90)))
    whole, without, late = (list(tf) for tf in feed.transforms())
    assert (whole, without, late) == (ALL, ALL[:-1], ["reference"])
    assert {part.timestamp.nanos for part in feed.sheet.of("/tf")[-1].transforms} == {PERIOD_NS}


def test_a_sealed_run_has_the_reference_that_was_reported(tmp_path: Path) -> None:
    """Also where TELEMETRY was lost or came late: it is what the board had."""
    seal(synthetic_journal(tmp_path / "a", 60, telemetry_every=5, late=(20,)))
    run = open_run(tmp_path / "a")
    feed = Feed()
    records: dict[int, list[Record]] = {}
    for record in jn.read_journal(tmp_path / "a" / "run.journal"):
        if record.kind in (Kind.PACKET, Kind.TRUTH, Kind.SESSION):
            records.setdefault(0 if record.tick == 0xFFFFFFFF else record.tick, []).append(record)
    for k, of in sorted(records.items()):
        feed.tick(k, *of)
    tfs = feed.transforms()
    assert [k for k, tf in enumerate(tfs) if "reference" in tf] == list(range(0, 60, 5))
    angles = rotation(tfs[35]["reference"][1]).as_euler("ZYX", degrees=True)[::-1]
    assert np.allclose(angles, [run[f"reference_{axis}"][35] for axis in "xyz"], atol=1e-9)


# -- /joint_states ---------------------------------------------------------------------------------------------------


def wheels(inertia: list[float]) -> dict[str, object]:
    return {"actuators": {"kind": "wheels", "wheels": {"inertia_kgm2": inertia}}}


def test_wheels_turn_relative_to_the_body_and_the_motor_pushes_against_it() -> None:
    """h = Js (Omega + omega): 0.2 N m s of a wheel of 0.002 kg m^2 in a body that turns at 1 rad/s is 99 rad/s."""
    feed = Feed(wheels([0.002, 0.004, 0.005]))
    feed.tick(3, truth(3, omega=(1.0, 0.0, -2.0), momentum=(0.2, -0.2, 0.0), applied=(0.01, 0.0, -0.03)))
    (state,) = feed.sheet.of("/joint_states")
    assert state.name == list(WHEELS) == ["wheel_x", "wheel_y", "wheel_z"]
    assert state.velocity == pytest.approx([99.0, -50.0, 2.0], rel=1e-12)
    assert state.effort == [-0.01, 0.0, 0.03]
    assert state.position == []
    assert (state.header.stamp.sec, state.header.stamp.nanosec, state.header.frame_id) == (1, PERIOD_NS, "body")


def test_speeds_that_are_not_known_are_not_there() -> None:
    momentum_only, one_known = Feed(wheels([0.0, 0.0, 0.0])), Feed(wheels([0.0, 0.002, 0.0]))
    for feed in (momentum_only, one_known):
        feed.tick(0, truth(0, momentum=(0.1, 0.1, 0.1), applied=(0.0, 0.0, 0.25)))
    (state,), (mixed,) = momentum_only.sheet.of("/joint_states"), one_known.sheet.of("/joint_states")
    assert (state.velocity, state.effort) == ([], [0.0, 0.0, -0.25])
    assert np.isnan([mixed.velocity[0], mixed.velocity[2]]).all() and mixed.velocity[1] == pytest.approx(50.0)


@pytest.mark.parametrize("actuators", [{"kind": "thrusters"}, {}])
def test_without_wheels_there_is_no_such_topic(actuators: dict[str, object]) -> None:
    feed = Feed({"actuators": actuators})
    feed.tick(0, truth(0))
    assert "/joint_states" not in feed.sheet.topics
    assert not feed.sheet.of("/scene")[0].entities[0].cylinders[1:]  # the nose alone


# -- /scene ----------------------------------------------------------------------------------------------------------


def test_the_scene_points_where_its_frames_point() -> None:
    feed = Feed()
    feed.tick(0, *configured(), truth(0))
    satellite, reference, directions = feed.sheet.of("/scene")[0].entities
    assert [entity.frame_id for entity in (satellite, reference, directions)] == ["body", "reference", "orbital"]
    assert all(entity.frame_locked for entity in (satellite, reference, directions))
    arrows = [turned((1, 0, 0), arrow.pose.orientation) for arrow in satellite.arrows]
    assert np.allclose(arrows, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    assert [text.text for text in satellite.texts] == ["x", "y", "z"]
    nose, *three = satellite.cylinders
    assert np.allclose(turned((0, 0, 1), nose.pose.orientation), [1, 0, 0]) and nose.top_scale == 0.0
    assert nose.pose.position.x > 0.3
    assert np.allclose([turned((0, 0, 1), wheel.pose.orientation) for wheel in three], np.eye(3), atol=1e-15)
    velocity, nadir = (turned((1, 0, 0), arrow.pose.orientation) for arrow in directions.arrows)
    assert np.allclose([velocity, nadir], [[1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert [text.text for text in directions.texts] == ["velocity", "nadir"]
    assert 0.0 < reference.cubes[0].color.a < 0.3


def turned(v: tuple[float, float, float], q: object) -> np.ndarray:
    return Rotation.from_quat([getattr(q, c) for c in "xyzw"]).apply(v)


def test_the_scene_is_sent_once_and_can_be_had_again() -> None:
    feed = Feed()
    feed.tick(0, *configured(), truth(0))
    for k in range(1, 5):
        feed.tick(k, truth(k))
    (sent,) = feed.sheet.of("/scene")
    again = type(sent).FromString(feed.rows.scene(7 * PERIOD_NS))
    assert again.entities[0].timestamp.nanos == PERIOD_NS
    for entity in (*sent.entities, *again.entities):
        entity.ClearField("timestamp")
    assert again == sent


def test_a_board_that_comes_later_adds_its_ghost() -> None:
    feed = Feed()
    feed.tick(0, truth(0))
    feed.tick(1, session(1), *configured(), truth(1))
    assert [len(update.entities) for update in feed.sheet.of("/scene")] == [2, 3]


# -- /log ------------------------------------------------------------------------------------------------------------


def test_every_event_is_in_the_log_with_level_and_origin() -> None:
    feed = Feed()
    codes = (events.DIVERGED, events.COMMAND_LATE)
    feed.tick(0, *(Record(Kind.LAB_EVENT, 0, jn.event_payload(code, 1, 2), 0) for code in codes), feed.begins(0))
    board, *laboratory = feed.sheet.of("/log")
    assert (board.level, board.name, board.message.partition(":")[0]) == (Log.INFO, "board", "REFERENCE_RESTART")
    assert [(line.level, line.name) for line in laboratory] == [(Log.WARNING, "laboratory"), (Log.ERROR, "laboratory")]
    timing = TimingRows(feed.sheet)  # type: ignore[arg-type]
    timing.tick(9, 9 * PERIOD_NS, [Record(Kind.LAB_EVENT, 9, jn.event_payload(events.EPOCH_REBASED, 9, 1), 0)])
    host = feed.sheet.of("/log")[-1]
    assert (host.level, host.name, host.message.partition(":")[0]) == (Log.WARNING, "host", "EPOCH_REBASED")
