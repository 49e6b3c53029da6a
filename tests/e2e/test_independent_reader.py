"""run.mcap as the reference TypeScript library reads it: same counts, same identity, same values bit for bit.

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
from synthetic import synthetic_journal

from sil.runs import Run, open_run
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
    done = read(node, run.path, "/truth", "/command", "/sample", "/telemetry", "/tf")
    assert done.returncode == 0, done.stderr
    content: dict[str, Any] = json.loads(done.stdout)
    return content


def bits(number: float) -> str:
    return struct.pack(">d", number).hex()


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
    rotation = seen["topics"]["/tf"]["rows"][7]["rotation"]
    assert [rotation[c] for c in "wxyz"] == [bits(v) for v in run["q_BN"][7].tolist()]


def test_counts_and_identity(seen: dict[str, Any], run: Run) -> None:
    topics = seen["topics"]
    assert sum(topic["count"] for topic in topics.values()) == seen["statistics"]["messages"]
    assert topics["/packet/up"]["count"] + topics["/packet/down"]["count"] == len(run.packets)
    assert topics["/scene"]["count"] == 1
    assert topics["/log"]["count"] == topics["/event"]["count"] == len(run.events)
    assert json.loads(seen["attachments"]["scenario.json"]) == run.scenario
    assert seen["metadata"]["end"] == {"reason": "finished", "ticks": "300"}
    assert seen["library"] == "attitude-sil"


def test_negative_control_a_flipped_byte_is_refused(node: str, run: Run, tmp_path: Path) -> None:
    content = bytearray(run.path.read_bytes())
    content[len(content) // 4] ^= 0x10  # of a chunk; behind chunks are indexes, which that reader does not check
    (tmp_path / "flipped.mcap").write_bytes(content)
    done = read(node, tmp_path / "flipped.mcap")
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
