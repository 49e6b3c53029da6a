"""C == Python: 100,000 random steps of each law, its state and that of the reference compared after every step."""

from __future__ import annotations

import ctypes
from pathlib import Path

import c_build
import numpy as np
import pytest
from comparison import compare, run
from episodes import STEPS, Episode, episodes

from firmware_sim.controllers import LawRefuses, inputs, new_law
from protocol.law_tables import COMMON, config_words, law_by_name, parse_configuration
from protocol.laws import IN_C
from sil.pil import library
from tools.c_states import SHARED

EPISODES = 500
UNSATURATED = 0.7  # at least this share of the steps; random inputs alone would keep every output at its limit


def unsaturated(recorded: list[Episode]) -> float:
    """Share of steps with a torque that is neither at a limit nor zero."""
    shares = [
        ((np.abs(e.expected.out[:, :3]) < e.limits).all(1) & (e.expected.out[:, :3] != 0).any(1)).mean()
        for e in recorded
        if e.expected is not None
    ]
    return float(np.mean(shares))


@pytest.mark.parametrize("law", IN_C)
def test_every_step_is_pythons(law: str, tmp_path: Path) -> None:
    """And the same from a build that stops at undefined behaviour and at accesses out of bounds."""
    count = EPISODES // 10 if law in SHARED else EPISODES  # those have the step of another law
    recorded = list(episodes(law, count))
    traces = run(c_build.program(tmp_path / "plain"), recorded)
    found = compare(recorded, traces)
    share = unsaturated(recorded)
    print(f"{law}: {found.steps} steps, {found.differing} differ, {share:.1%} unsaturated")
    assert found.steps == count * STEPS
    assert found.differing == 0, found.first
    assert share >= UNSATURATED
    assert run(c_build.program(tmp_path / "sanitized", c_build.sanitized()), recorded) == traces


@pytest.mark.parametrize("law", IN_C)
def test_episodes_go_through_everything(law: str) -> None:
    """Each flag that the law has appears, losses as well, and each number of its state moves in some step."""
    recorded = [e for e in episodes(law, 60) if e.expected is not None]
    flags = np.concatenate([e.expected.out[:, 3] for e in recorded])
    own = [inputs.SATURATED, inputs.ARITHMETIC, inputs.STARTING]
    own += [inputs.IDENTIFICATION_PAUSED] if law in ("mrac", "appc") else []
    assert all((flags & flag).any() and not (flags & flag).all() for flag in own)
    fresh = np.concatenate([e.inp[:, inputs.FRESH] for e in recorded])
    assert 0.05 < 1 - fresh.mean() < 0.5
    moved = np.any([np.ptp(e.expected.state, axis=0) > 0 for e in recorded], axis=0)
    assert moved.all(), np.flatnonzero(~moved)


def test_mrac_refuses_what_python_refuses(tmp_path: Path) -> None:
    """b = T_s^2 / (2 inertia) around its limit, 4, one count of inertia apart."""
    limit = round(0.125 * 2**26)
    asked, refused = [], []
    for count in range(limit - 3, limit + 4):
        table = law_by_name("mrac")
        words = list(config_words(table, {"period_us": 1_000_000, "inertia_kgm2": [1.0, count / 2**26, 2.0]}))
        configuration = parse_configuration(words)
        try:
            new_law("mrac", configuration)
            refused.append(False)
        except LawRefuses:
            refused.append(True)
        array, split = np.array(words, np.int32), len(COMMON)
        inp = np.zeros((1, inputs.SIZE), np.int32)
        asked.append(Episode("mrac", array[:split], array[split:], inp, None, np.zeros(3)))
    traces = run(c_build.program(tmp_path), asked)
    assert [trace == b"" for trace in traces] == refused
    assert set(refused) == {True, False}


LAWS_UNDER_TEST = ("law_find", "reference_init", "reference_advance", "reference_words")


class Call(ctypes.Structure):
    """`episode` of episode.h."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in LAWS_UNDER_TEST),
        ("id", ctypes.c_uint32),
        ("version", ctypes.c_uint32),
        *((name, ctypes.c_void_p) for name in ("common", "params", "inp")),
        ("steps", ctypes.c_uint32),
        ("trace", ctypes.c_void_p),
    ]


def test_the_library_that_flies_has_the_same_laws(tmp_path: Path) -> None:
    """The functions of the very library that board `native` loads, called by address."""
    flown = library.load()
    made = c_build.build(tmp_path / "episode.so", [c_build.HERE / "episode.c"], ["-shared", "-fPIC"], laws=False)
    functions = [ctypes.cast(getattr(flown, name), ctypes.c_void_p).value for name in LAWS_UNDER_TEST]
    for law in IN_C:
        recorded, traces = list(episodes(law, 24)), []
        for e in recorded:
            table, trace = law_by_name(law), ctypes.create_string_buffer(STEPS * 2048)
            places = [array.ctypes.data for array in (e.common, e.params, e.inp)]
            call = Call(*functions, table.law_id, table.version, *places, STEPS, ctypes.addressof(trace))
            size = ctypes.CDLL(str(made)).run_episode(ctypes.byref(call))
            traces.append(trace.raw[:size])
        assert compare(recorded, traces)[:2] == (24 * STEPS, 0)
