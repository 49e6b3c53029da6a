"""Boards that misbehave, and plants that break: the run says so, in one line, and never hangs."""

from __future__ import annotations

import numpy as np
import pytest
from benches import StallingClock

from firmware_sim.flight import Flight
from protocol import events, frames
from protocol.frames import Command, Telemetry, Type
from sil import answers as lab_answers
from sil import rig as lab_rig
from sil import session as lab_session
from sil.session import Session
from sil.trouble import LinkFailure


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(lab_rig, "DEAD_AFTER_S", 0.3)
    monkeypatch.setattr(lab_answers, "LOOK_EVERY_S", 0.05)


@pytest.fixture
def answering(monkeypatch):
    """answering(change): every answer of the board goes through change(tick, frames) -> frames."""
    honest = Flight.step

    def install(change):
        monkeypatch.setattr(Flight, "step", lambda self, tick, sample: change(tick, honest(self, tick, sample)))

    return install


def test_an_announced_frame_that_never_comes_is_a_failure_in_lockstep(lab, answering):
    answering(lambda tick, out: [out[0]._replace(follows=out[0].follows + (tick == 10)), *out[1:]])
    with pytest.raises(LinkFailure, match="1 frames too few of the answer to tick 10"):
        lab().run()


def test_a_flood_of_repeated_commands_does_not_hide_a_missing_answer(lab, answering):
    def change(tick, out):
        return out if tick != 10 else [out[0]._replace(follows=5)] + [out[0]] * 3

    answering(change)
    with pytest.raises(LinkFailure, match="answer to tick 10"):
        lab().run()


def test_repeated_commands_are_dropped_and_counted(lab, answering):
    answering(lambda tick, out: [*out, *(f for f in out if isinstance(f, Command))])
    bench = lab()
    rows = bench.run()
    assert bench.rig.answers.strays == len(rows.samples()) - 1  # that of the last tick has nobody to take it
    assert len(rows.commands()) == len(rows.samples())


def test_lost_telemetry_in_a_paced_run_is_a_real_miss(lab, answering):
    answering(lambda tick, out: [f for f in out if not (tick == 10 and isinstance(f, Telemetry))])
    bench = lab(clock=StallingClock())
    rows = bench.run()
    assert bench.rig.window.real_misses == 1
    assert [(a, b) for _, a, b in rows.events_with(events.REAL_MISS)] == [(10, 2)]


def test_a_board_that_falls_silent_in_a_paced_run_has_failed(lab, answering):
    answering(lambda tick, out: out if tick < 30 else [])
    bench = lab(clock=StallingClock())
    with pytest.raises(LinkFailure, match="no answer to tick 30"):
        bench.run()
    assert bench.rig.window.real_misses > 0


def test_a_last_answer_that_is_not_here_in_time_is_a_real_miss(lab, answering):
    """The board gives it only after the lab has looked, while the lab waits to see whether the board lives."""
    bench = lab(clock=StallingClock())
    port, kept = bench.rig.host.board._port, []
    answering(lambda tick, out: out if tick < 39 else kept.extend(out) or [])
    honest = bench.rig.answers._await

    def late(tick):
        port.send(*kept)
        honest(tick)

    bench.rig.answers._await = late
    bench.run()
    assert bench.rig.window.real_misses == 1


def test_answers_to_ticks_far_ahead_are_bounded(lab, answering, monkeypatch):
    monkeypatch.setattr(lab_answers, "EARLY_LIMIT", 4)
    answering(lambda tick, out: [*out, *(Command(1000 + tick, (0, 0, 0), 0, 0, frames.USED) for _ in range(1))])
    bench = lab()
    bench.run()
    assert len(bench.rig.answers._early) == 4
    assert bench.rig.answers.strays > 0


@pytest.mark.parametrize(("part", "index"), [("quaternion", 0), ("rate", 4), ("momentum", 7)])
def test_a_plant_that_is_not_a_number_ends_the_run_with_an_event(lab, part, index):
    bench = lab()
    plant = bench.rig.loop.plant
    honest = plant.advance

    def advance(torque, t_ns, period_ns):
        honest(torque, t_ns, period_ns)
        if t_ns == 10 * period_ns:
            plant.state[index] = np.nan

    plant.advance = advance
    assert bench.rig.loop.run(lambda: False, lambda tick, motion: None) == (11, "diverged")
    assert bench.rows.events_with(events.PLANT_NAN) == [(11, 11, 0)]


def test_divergence_waits_for_the_last_answer_on_any_clock(lab):
    """The same packets, whether the answer to the last tick is there at once or only at the next deadline."""
    start = {"attitude_deg": [5, 5, 5], "rate_degps": [1, 0, 0]}
    wild = {"metrics": {"diverged_deg": 6.5}, "plant": {"initial": start}}
    lockstep, paced = lab(**wild), lab(clock=StallingClock(), **wild)
    assert lockstep.run().packets == paced.run().packets
    assert len(lockstep.rows.commands()) == len(lockstep.rows.samples()) < 40


def test_housekeeping_frames_are_recorded_apart(lab):
    rows = lab().run()
    kinds = [packet[1] for _, packet in rows.kept_house]
    assert Type.HELLO in kinds
    assert Type.READY in kinds
    assert Type.STOP in kinds
    assert not any(frames.is_housekeeping(packet[1]) for _, _, _, packet in rows.packets)


# -- opening a session -----------------------------------------------------------------------------------------------


def silent_board(monkeypatch, hello=None, **limits):
    """A session with a board that says hello and never gets ready. hello: fields of its HELLO."""
    from protocol.links import inproc
    from protocol.port import Port

    for name, value in limits.items():
        monkeypatch.setattr(lab_session, name, value)
    lab_end, board_end = inproc.pair()
    board = Port(board_end)

    def pump():
        while (packet := board.receive(0.0)) is not None:
            if packet.type == Type.HELLO:
                echo = packet.frame._replace(role=frames.ROLE_BOARD, flags=frames.HELLO_ECHO, build="other")
                board.send(echo._replace(**(hello or {})))

    lab_end.pump = pump
    return Port(lab_end)


def test_a_board_that_never_gets_ready_is_given_up(monkeypatch):
    port = silent_board(monkeypatch, CONFIG_EVERY_S=0.02, READY_WITHIN_S=0.2)
    notes: list[str] = []
    with pytest.raises(LinkFailure, match="not ready within"):
        Session(port, 0, lambda: None).open((1, 2, 3), 0, 1.0, notes.append)
    assert any("compiling" in note for note in notes)


def test_a_board_process_that_dies_while_configuring_is_noticed(monkeypatch):
    port = silent_board(monkeypatch, CONFIG_EVERY_S=0.02)

    def dead():
        raise LinkFailure("board: the controller process ended with signal 9")

    with pytest.raises(LinkFailure, match="signal 9"):
        Session(port, 0, dead).open((1, 2, 3), 0, 1.0, lambda note: None)


@pytest.mark.parametrize(
    ("hello", "rate_q16", "says"),
    [
        ({"protocol_version": 2}, 0, "board 'other': expected protocol 1, got 2: .* `make firmware`"),
        ({"layout_hash": 0xDEADBEEF}, 0, "expected layout a72d0d2f, got deadbeef, .* `make firmware`"),
        ({}, 65536, "expected one with its own timer for a paced clock, got one without: use --clock lockstep"),
    ],
)
def test_a_board_that_does_not_fit_is_told_from_its_hello(monkeypatch, hello, rate_q16, says):
    port = silent_board(monkeypatch, hello)
    with pytest.raises(LinkFailure, match=says):
        Session(port, rate_q16, lambda: None).open((1, 2, 3), 0, 1.0, lambda note: None)
