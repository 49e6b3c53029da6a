"""What the C flight gives a law and makes of its answer, shown by a law of the tests; Python's does the same."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pytest
from c_board import CBoard, assert_same, python_board
from hostile import Laboratory
from test_sessions_in_c import frames_of

from firmware_sim.controllers import inputs
from firmware_sim.flight import Flight
from protocol import events, frames
from protocol.frames import Command, Event
from protocol.law_tables import Configuration


class Probe:
    """probe_law.c in Python."""

    def __init__(self, configuration: Configuration) -> None:
        self.has_model = configuration.table.law_id != 1
        self._seen = [0] * inputs.SIZE

    @property
    def reference_restarted(self) -> bool:
        return self._seen[inputs.TICK] % 5 == 4

    def step(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        self._seen = inp.tolist()
        tick = self._seen[inputs.TICK]
        for i in range(3):
            wanted = (-1 if tick & 1 else 1) * (1 << (10 + 8 * i))
            out[i] = wanted if tick & 7 else inp[inputs.I_APPLIED + i]
        out[3] = (frames.FLAG_ARITHMETIC if tick & 4 else 0) | (frames.FLAG_STARTING if tick & 16 else 0)

    def warm_up(self, *_: np.ndarray) -> None:
        pass

    def telemetry(self) -> list[int]:
        return [*self._seen[:-1], (self._seen[-1] + 2**31) % 2**32 - 2**31]  # the tick as an int32


@pytest.fixture(scope="module")
def probed(build_folder: Path) -> CBoard:
    return CBoard(build_folder, law="probe_law.c")


@pytest.mark.parametrize("seed", range(4))
def test_a_law_is_given_the_same_and_its_answer_taken_alike(
    probed: CBoard, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Readings, ages of what was lost, the command of n ticks ago, limits of every size, flags that rise and fall."""
    monkeypatch.setattr(Flight, "_new_law", Probe)
    steps = Laboratory(Random(seed)).steps(8000)
    heard = probed.serve(steps)
    assert_same(heard, python_board(steps))
    seen = [packet.frame for data in heard.writes for packet in frames_of(data)]
    restarts = {frame.b for frame in seen if isinstance(frame, Event) and frame.code == events.REFERENCE_RESTART}
    assert restarts == {0, 1}
    limited = [frame for frame in seen if isinstance(frame, Command) and frame.flags & frames.FLAG_SATURATED]
    assert min(frame.torque[2] for frame in limited) < 0 < max(frame.torque[2] for frame in limited)
