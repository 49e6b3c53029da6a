"""Compiled once, loaded by every later process; quick enough for a live board; another edit starts another cache."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import firmware_sim
from firmware_sim import jit

PACKAGE = Path(firmware_sim.__file__).parent
STEP = """
import sys, numpy as np
from firmware_sim.controllers import inputs, new_law
from protocol.law_tables import config_words, law_by_name, parse_configuration
law = new_law("pd", parse_configuration(config_words(law_by_name("pd"), {})))
law.step(np.zeros(inputs.SIZE, np.int64), np.zeros(30, np.int64), np.zeros(4, np.int64))
stats = type(law).compiled[1].stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


def in_process(cache: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "XDG_CACHE_HOME": str(cache)}
    return subprocess.run(
        [sys.executable, "-c", STEP], env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_a_second_process_loads_what_the_first_compiled(tmp_path: Path) -> None:
    assert in_process(tmp_path) == "0 1\n"
    assert in_process(tmp_path) == "1 0\n"
    (directory,) = (tmp_path / "attitude-sil").iterdir()
    assert directory.name == f"firmware_sim-{jit.source_hash()}"


def test_the_hash_follows_any_edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in PACKAGE.rglob("*.py"):
        copy = tmp_path / path.relative_to(PACKAGE)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit.py"))
    before = jit.source_hash.__wrapped__()
    for edited in ("fixed.py", "controllers/kinematics.py", "guidance/reference.py"):
        (tmp_path / edited).write_text((tmp_path / edited).read_text() + "\n# edited\n")
        after = jit.source_hash.__wrapped__()
        assert after != before
        before = after
