"""Logs as the reference TypeScript libraries read them: same counts, same identity, same values bit for bit.

They are what Foxglove and its relatives decode with. Every message of every topic is decoded, of a made-up run and of
real ones, of run.mcap and timing.mcap; a channel without a schema ends the reader.
Needs node and, once, `npm ci` in this folder (done here when node_modules is missing and a registry can be reached).
Without node it is skipped with the reason; with CI=true in the environment it fails instead.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any, NoReturn

sys.path.insert(0, str(Path(__file__).parents[1] / "sil" / "sinks"))

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from synthetic import synthetic_journal

from protocol.frames import Telemetry
from protocol.law_tables import LAWS
from sil.runner import run_scenario
from sil.runs import Run, open_run
from sil.scenario import Scenario, load_scenario, load_values
from sil.sinks import layouts
from sil.sinks.decoding import Decoder
from sil.sinks.seal import seal

HERE = Path(__file__).parent
INSTALL_s, READ_s = 180, 60


def unavailable(reason: str) -> NoReturn:
    if os.environ.get("CI", "").lower() in ("1", "true"):
        pytest.fail(f"in CI the independent reader has to run: {reason}")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def node() -> str:
    """Path of node, with the reader's packages in place."""
    program = shutil.which("node")
    if program is None:
        unavailable("node is not installed")
    if not (HERE / "node_modules" / "@mcap" / "core").is_dir():
        npm = shutil.which("npm")
        if npm is None:
            unavailable("npm is not installed and node_modules is missing")
        command = [npm, "ci", "--no-audit", "--no-fund", "--ignore-scripts"]
        try:
            done = subprocess.run(command, cwd=HERE, capture_output=True, text=True, timeout=INSTALL_s)
        except subprocess.TimeoutExpired:
            unavailable(f"npm ci did not end within {INSTALL_s} s")
        if done.returncode:
            unavailable(f"npm ci failed: {done.stderr.strip().splitlines()[-1:]}")
    return program


def read(node: str, log: Path, *topics: str) -> subprocess.CompletedProcess[str]:
    command = [node, str(HERE / "read_mcap.mjs"), str(log), *topics]
    return subprocess.run(command, capture_output=True, text=True, timeout=READ_s)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = synthetic_journal(tmp_path_factory.mktemp("reader") / "a", 300, late=(50,), lose=(60,))
    seal(folder)
    return open_run(folder)


@pytest.fixture(scope="module")
def seen(node: str, run: Run) -> dict[str, Any]:
    """What node found, all messages decoded."""
    for_viewers = ("/tf", "/joint_states", "/scene")
    return content(read(node, run.path, "/truth", "/command", "/sample", "/telemetry", *for_viewers))


def content(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def bits(number: float) -> str:
    return struct.pack(">d", number).hex()


def number(printed: str) -> float:
    value: float = struct.unpack(">d", bytes.fromhex(printed))[0]
    return value


def as_bits(value: Any) -> Any:
    array = np.asarray(value, np.float64)
    return bits(float(array)) if array.ndim == 0 else [bits(v) for v in array.tolist()]


@pytest.mark.parametrize("topic", ["/truth", "/command", "/sample"])
def test_values_are_equal_bit_for_bit(seen: dict[str, Any], run: Run, topic: str) -> None:
    rows = {"/truth": run.truth, "/command": run.commands, "/sample": run.samples}[topic]
    theirs = seen["topics"][topic]["rows"]
    assert len(theirs) == len(rows) > 0
    for mine, other in zip(rows, theirs, strict=True):
        assert {name: as_bits(mine[name]) for name in rows.dtype.names} | {"log_time": other["log_time"]} == other


def test_telemetry_and_transforms(seen: dict[str, Any], run: Run) -> None:
    first = seen["topics"]["/telemetry"]["rows"][3]
    assert first["reference_x"] == bits(float(run["reference_x"][3]))
    parts = {part["child_frame_id"]: part for part in seen["topics"]["/tf"]["rows"][7]["transforms"]}
    assert [part["parent_frame_id"] for part in parts.values()] == ["inertial", "inertial", "orbital", "orbital"]
    assert [parts["body"]["rotation"][c] for c in "wxyz"] == [bits(v) for v in run["q_BN"][7].tolist()]
    assert parts["reference"]["timestamp"]["seconds"] == bits(3)


def test_wheels_as_joints(seen: dict[str, Any], run: Run) -> None:
    inertia = run.scenario["actuators"]["wheels"]["inertia_kgm2"]
    for k in (0, 7, 299):
        state = seen["topics"]["/joint_states"]["rows"][k]
        assert state["name"] == ["wheel_x", "wheel_y", "wheel_z"] and state["position"] == []
        assert state["effort"] == as_bits(0.0 - run.applied_Nm[k])
        speed = run.momentum_Nms[k, :2] / inertia[:2] - run.omega_radps[k, :2]
        assert np.allclose([number(v) for v in state["velocity"][:2]], speed, rtol=1e-12)
        assert np.isnan(number(state["velocity"][2]))  # nobody knows the third wheel's inertia
        assert state["header"]["frame_id"] == "body"


def test_scene(seen: dict[str, Any]) -> None:
    satellite, reference, directions = seen["topics"]["/scene"]["rows"][0]["entities"]
    assert [e["frame_id"] for e in (satellite, reference, directions)] == ["body", "reference", "orbital"]
    assert [text["text"] for text in satellite["texts"]] == ["x", "y", "z"]
    assert (len(satellite["cubes"]), len(satellite["cylinders"]), len(reference["lines"])) == (5, 4, 1)


def test_counts_and_identity(seen: dict[str, Any], run: Run) -> None:
    topics = seen["topics"]
    assert sum(topic["count"] for topic in topics.values()) == seen["statistics"]["messages"]
    assert topics["/packet/up"]["count"] + topics["/packet/down"]["count"] == len(run.packets)
    assert topics["/scene"]["count"] == 1
    assert topics["/log"]["count"] == topics["/event"]["count"] == len(run.events)
    assert json.loads(seen["attachments"]["scenario.json"]) == run.scenario
    assert seen["metadata"]["end"] == {"reason": "finished", "ticks": "300"}
    assert seen["library"] == "attitude-sil"


# -- real runs -------------------------------------------------------------------------------------------------------

EVERYTHING = {
    "duration_s": 30,
    "seed": 8,
    "board": "inproc",
    "link": {"url": "inproc", "baud": 115200, "faults": {"drop": 0.1, "bit_error_rate": 2e-4, "duplicate": 0.1}},
    "events": [{"at_s": 9.8, "do": "board.restart", "for_s": 3}, {"at_s": 20, "do": "setpoint", "deg": [5, 0, 0]}],
    "sensors": {"attitude": {"noise_deg": 0.02, "faults": [{"kind": "intermittent", "fraction": 0.1}]}},
    "actuators": {"wheels": {"inertia_kgm2": 0.002, "faults": [{"kind": "wrong", "scale": 0.8, "axis": "z"}]}},
    "metrics": {"diverged_deg": None},
}
THRUSTERS = ("duration_s=2", "require=[]", "board=inproc", "link.url=inproc", "clock=lockstep")
OF_A_RUN = {
    "/session": "sil/msg/Session", "/packet/up": "sil/msg/Packet", "/packet/down": "sil/msg/Packet",
    "/sample": "sil/msg/Sample", "/command": "sil/msg/Command", "/truth": "sil/msg/Truth", "/event": "sil/msg/Event",
    "/tf": "foxglove.FrameTransforms", "/scene": "foxglove.SceneUpdate", "/log": "foxglove.Log",
}  # fmt: skip


def flown(folder: Path, scenario: Scenario) -> Run:
    run_scenario(scenario, folder)
    return open_run(folder)


def test_a_run_in_which_everything_happens(node: str, tmp_path: Path) -> None:
    run = flown(tmp_path / "run", load_values(EVERYTHING))
    found = content(read(node, run.path, "/log", "/packet/up"))
    topics = found["topics"]
    of_law = {"/telemetry": "sil/msg/TelemetryAppc", "/joint_states": "sensor_msgs/msg/JointState"}
    assert {topic: said["schema"] for topic, said in topics.items()} == {**OF_A_RUN, **of_law}
    assert all(said["count"] for said in topics.values())
    assert [line["message"] for line in topics["/log"]["rows"]] == [row.text for row in run.events]
    assert [line["name"] for line in topics["/log"]["rows"]] == [row.origin for row in run.events]
    up = [row for row in run.packets if row.direction == "up"]
    altered = [[bits(byte) for byte in row.encoded] for row in up if row.encoded]
    assert altered == [row["encoded"] for row in topics["/packet/up"]["rows"] if row["encoded"]] != []
    assert [row["cause"] for row in topics["/packet/up"]["rows"]] == [row.cause for row in up]
    timing = content(read(node, tmp_path / "run" / "timing.mcap"))["topics"]
    assert timing["/timing"]["count"] == len(run) and timing["/housekeeping/up"]["count"] > 0


def test_a_run_with_thrusters(node: str, tmp_path: Path) -> None:
    run = flown(tmp_path / "run", load_scenario("delay-nanosat", THRUSTERS))
    topics = content(read(node, run.path))["topics"]
    telemetry = topics.pop("/telemetry")
    assert telemetry["count"] > 0
    assert {topic: said["schema"] for topic, said in topics.items()} == OF_A_RUN


def test_telemetry_of_every_law(node: str, tmp_path: Path) -> None:
    """One message each, word i being i counts; the names are those of the law's table."""
    log, scaled = tmp_path / "laws.mcap", {}
    with open(log, "wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        for (law_id, version), table in LAWS.items():
            decoder, frame = Decoder(), Telemetry(3, law_id, version, tuple(range(len(table.telemetry) + 13)))
            known = decoder.telemetry_table(frame)
            schema = writer.register_schema(known.layout.name, layouts.SCHEMA_ENCODING, known.layout.schema)
            topic = f"/telemetry/{law_id}/{version}"
            channel = writer.register_channel(topic, layouts.ENCODING, schema)
            writer.add_message(channel, 0, known.pack(frame, 0), 0)
            names = [field.name for field in known.layout.fields]
            scaled[topic] = dict(zip(names, (i * scale for i, scale in enumerate(known.scales)), strict=False))
        writer.finish()
    topics = content(read(node, log, *scaled))["topics"]
    for topic, words in scaled.items():
        (row,) = topics[topic]["rows"]
        assert {name: row[name] for name in words} == {name: bits(value) for name, value in words.items()}, topic
        assert row["tick"] == bits(3)


# -- negative controls -----------------------------------------------------------------------------------------------


def test_negative_control_a_flipped_byte_is_refused(node: str, run: Run, tmp_path: Path) -> None:
    content = bytearray(run.path.read_bytes())
    content[len(content) // 4] ^= 0x10  # of a chunk; behind chunks are indexes, which that reader does not check
    (tmp_path / "flipped.mcap").write_bytes(content)
    done = read(node, tmp_path / "flipped.mcap")
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1


def test_negative_control_a_channel_without_a_schema_is_refused(node: str, tmp_path: Path) -> None:
    with open(tmp_path / "bare.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/bare", "cdr", 0), 0, b"", 0)
        writer.finish()
    done = read(node, tmp_path / "bare.mcap")
    assert (done.returncode, done.stderr) == (1, "/bare: a channel without schema\n")
