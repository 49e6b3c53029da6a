"""Emulated Cortex-M4 == host: the shipped image's own law code, raw bytes of all memory after each of 100,000 steps."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import c_build
import pytest
from comparison import compare, run
from episodes import STEPS, episodes

from protocol.laws import IN_C
from tools.c_states import SHARED

EPISODES = 500
MISSING = [name for name in ("unicorn", "elftools", "ziglang") if importlib.util.find_spec(name) is None]
HERE_IT_MAY_BE_MISSING = bool(MISSING) and "CI" not in os.environ
pytestmark = pytest.mark.skipif(HERE_IT_MAY_BE_MISSING, reason=f"needs the extras pil and dev: {MISSING}")


@pytest.mark.parametrize("law", IN_C)
def test_every_step_has_the_same_bytes(law: str, tmp_path: Path) -> None:
    from cortex_m4 import CortexM4

    from sil.pil.image import load_image

    count = EPISODES // 10 if law in SHARED else EPISODES  # those have the step of another law
    recorded = list(episodes(law, count, seed=2))
    host = run(c_build.program(tmp_path), recorded)
    differing, processor = 0, CortexM4(load_image(), tmp_path)
    for episode, expected, got in zip(recorded, host, processor.run(recorded), strict=True):
        assert len(got) == len(expected)
        if got != expected:
            differing += compare([episode], [got]).differing
    print(f"{law}: {count * STEPS} steps on the Cortex-M4, {differing} differ")
    assert differing == 0
