"""Reading a rig: what is subtracted belongs to one tick, and nothing is lost or grows when the screen is not told."""

from __future__ import annotations

import json
import math
import socket

import made
import numpy as np
import pytest

from sil.scenario import load_scenario
from sil.screen import messages
from sil.screen.reading import MOST_NEW, SAMPLES, SAMPLES_A_LOOK, Reader, plan_of
from sil.screen.watch import queue

LEAST_QUEUE = 212_992 - 32  # what Linux gives who asks for nothing


def test_attitude_is_held_against_the_reference_of_the_same_tick() -> None:
    """Protects: TELEMETRY comes a tick late; a moving satellite must not be held against an old reference."""
    rig = made.rig()
    reader = Reader(load_scenario("mrac-rs232"), rig, "reference")
    for k in range(10):
        rig.answers.telemetry = made.telemetry(k - 1, k - 1.0) if k else None
        reader.take(k, made.motion(k))
    state = reader.state(9, made.motion(9))
    assert state.attitude_deg[0] == pytest.approx(9.0)
    assert state.held_against is not None and state.held_against[0] == 8 * 0.5
    for sample in state.samples:
        assert messages.error_deg(sample) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_what_was_not_told_is_told_next_time() -> None:
    """Protects: a frame that a slow terminal made us drop loses no history; a told one is not repeated."""
    rig = made.rig()
    reader = Reader(load_scenario("mrac-rs232"), rig, "set-point")
    reader.take(0, made.motion(0))
    rig.loop.lateness_ns += [1, 2]
    for answer_ns in (3, 4):
        made.answered(rig, answer_ns)
    reader.event(0, 0x0101, 0, 1, 0)
    first, again = reader.state(0, made.motion(0)), reader.state(0, made.motion(0))
    assert first.late_ns == again.late_ns == [1, 2] and first.answer_ns == again.answer_ns == [3, 4]
    assert len(again.events) == len(again.samples) == 1
    reader.told()
    after = reader.state(0, made.motion(0))
    assert (after.late_ns, after.answer_ns, after.events, after.samples) == ([], [], [], [])
    made.answered(rig, 5)
    assert reader.state(0, made.motion(0)).answer_ns == [5]


def test_a_screen_that_is_never_told_costs_bounded_memory() -> None:
    """Protects: a stopped terminal during a run of days, at the end of which its numbers are long."""
    rig = made.rig()
    rig.loop.setpoints = lambda k: (-1_999_999_999, 123_456_789, -k)
    reader = Reader(load_scenario("mrac-rs232", ["duration_s=100000"]), rig, "set-point")
    first, last = 1_000_000, 1_005_000
    for k in range(first, last):
        reader.take(k, made.motion(k)._replace(euler_rad=np.full(3, -k / 7e5)))
        reader.event(k, 0x0101, -k, k, 0)
        rig.loop.lateness_ns.append(1_000_000_000 + k)
        made.answered(rig, 1_000_000_000 + k)
    state = reader.state(last, made.motion(last))
    assert len(state.events) == len(state.late_ns) == len(state.answer_ns) == MOST_NEW
    assert state.late_ns[-1] == state.answer_ns[-1] == 1_000_000_000 + last - 1
    assert len(state.samples) == 2 * SAMPLES
    ours, theirs = queue()
    with ours, theirs:
        assert ours.send(messages.pack(state), socket.MSG_DONTWAIT) < LEAST_QUEUE, "one datagram, on any machine"


def test_a_fast_run_is_sampled_more_coarsely() -> None:
    """Protects: in lockstep thousands of ticks pass between two looks, and looking must not cost what they cost."""
    reader = Reader(load_scenario("mrac-rs232", ["duration_s=100000"]), made.rig(), "set-point")
    for k in range(20_000):
        reader.take(k, made.motion(k))
        if k % 5000 == 4999:
            state = reader.state(k, made.motion(k))
            reader.told()
    assert 0 < len(state.samples) <= SAMPLES_A_LOOK + 1


def test_messages_survive_the_way() -> None:
    """Protects: what the painter unpacks is what was packed, numbers that are none included."""
    state = made.state(3, torque_Nm=(math.inf, 0.0, -1.0))
    back = messages.unpack(messages.pack(state))
    assert isinstance(back, messages.State)
    assert back.torque_Nm[0] == math.inf and back.counters == state.counters
    assert messages.unpack(messages.pack(messages.End())) == messages.End()


@pytest.mark.parametrize("data", [b"", b"[]", b"{}", b'["Nothing"]', b'["Line"]', b"\xff", json.dumps([1]).encode()])
def test_what_is_no_message_is_refused(data: bytes) -> None:
    """Protects: a defect shows as one ValueError."""
    with pytest.raises(ValueError):
        messages.unpack(data)


@pytest.mark.parametrize(("sets", "follows"), [([], "reference"), (["telemetry_every=0"], "set-point")])
def test_without_telemetry_attitude_is_held_against_the_set_point(sets: list[str], follows: str) -> None:
    """Protects: the heading says what the error is an error to."""
    plan = plan_of(load_scenario("mrac-rs232", sets), made.rig())
    assert plan.follows == follows and plan.wall_period_ms is None and plan.torque_max_Nm == (0.1,) * 3
