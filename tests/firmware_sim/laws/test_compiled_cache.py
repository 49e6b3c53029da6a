"""Compiled once, loaded by every later process; quick enough for a live board; another edit starts another cache."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import firmware_sim
from firmware_sim import jit
from firmware_sim.controllers import LAWS, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration

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


@pytest.mark.parametrize(("form", "limit_us"), [("fixed", 20.0), ("float", 5.0)])
@pytest.mark.parametrize("name", LAWS)
def test_step_time(name: str, form: str, limit_us: float) -> None:
    """Python wrapper included; the best of many short rounds, since other work shares the machine."""
    configuration = parse_configuration(config_words(law_by_name(name), {"form": form}))
    dtype = np.float64 if form == "float" else np.int64
    law, reference = new_law(name, configuration), Reference(configuration.common, form == "float")
    inp, out = np.zeros(inputs.SIZE, dtype), np.zeros(4, dtype)
    inp[:3] = 1, 100, 1
    rounds = []
    for _ in range(50):
        reference.advance(inp)
        start = time.perf_counter()
        for _ in range(20):
            law.step(inp, reference.state, out)
        rounds.append((time.perf_counter() - start) / 20 * 1e6)
    print(f"{name} {form}: {min(rounds):.2f} us")
    assert min(rounds) <= limit_us
