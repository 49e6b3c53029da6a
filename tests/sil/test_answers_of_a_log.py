"""Answers read back from a log or kept from a flight stand in the order in which the board gave them."""

from __future__ import annotations

import pytest

from protocol import frames
from protocol.frames import Command, Event, Sample, Telemetry, Type
from sil.budget.flight import _flight, _Row
from sil.fates import Stale
from sil.replay import _recorded
from sil.runs import PacketRow

TICK = 32767
SAMPLE = frames.pack(Sample(TICK, *[(0, 0, 0)] * 3, TICK - 1, 0, frames.FRESH, 0, (None, None, None)), 5)


def answer(first: int) -> list[bytes]:
    told = (Command(TICK, (1, 2, 3), 0, 2, frames.USED), Telemetry(TICK, 1, 1, (0,)), Event(TICK, 1, 2, 3))
    return [frames.pack(frame, (first + place) % 2**16) for place, frame in enumerate(told)]


@pytest.mark.parametrize("first", [0, 65533, 65534, 65535])
def test_over_the_end_of_the_numbers(first: int) -> None:
    """After four and a half hours at T_s 0.5 s: COMMAND is number 65535 and its TELEMETRY number 0."""
    given = answer(first)
    rows = [PacketRow(TICK, "up", Type.SAMPLE, 5, "delivered", SAMPLE, b"")]
    rows += [PacketRow(TICK, "down", packet[1], 0, "delivered", packet, b"") for packet in reversed(given)]
    model = Stale(), 500_000_000
    assert _recorded(TICK, rows, model, open_end=False, last=False).answer == tuple(given)
    kept = [_Row(TICK, False, True, SAMPLE), *(_Row(TICK, True, True, packet) for packet in reversed(given))]
    assert _flight("pd", (), kept).ticks == ((SAMPLE, tuple(given)),)
