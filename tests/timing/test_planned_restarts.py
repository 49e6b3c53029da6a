"""A restart that the scenario asks for (SPEC, L18): the board is off for so long, in every clock the same."""

from __future__ import annotations

import pytest
from benches import Script, StallingClock
from reset_boards import BEFORE, install

from protocol import events, frames
from protocol.frames import FRESH, HELD, NO_TICK, RESTARTED, USED, ZERO, Type
from sil import rejoin as lab_rejoin
from sil import session as lab_session
from sil.trouble import LinkFailure

TICKS = 40


def off(at_s, for_s):
    return {"at_s": at_s, "do": "board.restart", "for_s": for_s}


def flown(lab, *planned, channel=None, **values):
    bench = lab(channel, events=planned, **values)
    return bench, bench.run()


@pytest.mark.parametrize(("first", "end"), [(0, 1), (1, 2), (3, 5), (4, 6), (10, 11), (10, 14), (10, TICKS)])
def test_the_board_is_off_for_so_many_ticks(lab, first, end):
    bench, rows = flown(lab, off(first * 0.5, (end - first) * 0.5))
    there = [k for k in range(TICKS) if not first <= k < end]
    assert [sample.tick for sample in rows.samples()] == there
    assert [command.tick for command in rows.commands()] == there
    assert rows.sessions == ([end] if end < TICKS else [])
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == [
        k for k in range(first, end) if k < TICKS - 1
    ]
    used = {command.tick: command.used for command in rows.commands()}
    if end < TICKS:
        assert used[end] == (USED if end <= 4 else RESTARTED)
    assert (bench.rig.window.real_misses, bench.rig.answers.strays) == (0, 0)


def test_the_last_torque_is_held_and_then_there_is_none(lab):
    _, rows = flown(lab, off(5, 3), hold_limit=4)
    assert rows.sources()[10:19] == [FRESH, *[HELD] * 4, ZERO, ZERO, FRESH, FRESH]
    assert rows.events_with(events.HOLD_LIMIT) == [(15, 14, 5)]
    assert [sample.ack for sample in rows.samples() if sample.tick in (16, 17)] == [9, 16]


def test_at_the_start_there_is_nothing_to_hold(lab):
    _, rows = flown(lab, off(0, 1))
    assert rows.sources()[:4] == [ZERO, ZERO, ZERO, FRESH]
    assert rows.samples()[0].ack == NO_TICK


def test_it_is_recorded_and_is_no_mishap(lab):
    """restart_limit counts what nobody asked for."""
    _, rows = flown(lab, off(5, 2), off(10, 1), restart_limit=0)
    assert rows.events_with(events.BOARD_OFF) == [(10, 10, 4), (20, 20, 2)]
    assert rows.events_with(events.BOARD_ON) == [(14, 14, 4), (22, 22, 2)]
    assert rows.events_with(events.BOARD_RESTARTED) == []
    assert rows.sessions == [14, 22]


def test_one_restart_behind_the_other(lab):
    """The board comes back for no tick at all: its session never begins."""
    bench, rows = flown(lab, off(5, 2), off(7, 1))
    assert rows.sessions == [16]
    assert bench.rig.window.real_misses == 0


def test_what_was_on_its_way_is_lost_with_the_board(lab):
    """COMMAND(9) is done 0.345 s after t_9, and the board is switched off 0.2 s after it."""
    _, rows = flown(lab, off(4.7, 2), answer_delay_s=0.345)
    fates = {frames.unpack(p).tick: fate for _, d, fate, p in rows.packets if d == 1 and p[1] == Type.COMMAND}
    assert (fates[8], fates[9], fates[14]) == (0, 2, 0)
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == [9, 10, 11, 12, 13]


def test_a_long_answer_does_not_come_out_of_the_next_session(lab):
    law = {"name": "pd"}
    _, rows = flown(lab, off(4.7, 0.5), answer_delay_s=0.45, transport_delay_ticks=4, law=law, link={"baud": 9600})
    fates = {frames.unpack(p).tick: fate for _, d, fate, p in rows.packets if d == 1 and p[1] == Type.COMMAND}
    assert {tick: fate for tick, fate in fates.items() if fate} == {9: 2}


@pytest.mark.parametrize("delay", [0, 2])
def test_other_transport_delays(lab, delay):
    law = {"name": "mrac", "params": {"design": "printed"}} if delay == 0 else {"name": "pd"}
    _, rows = flown(lab, off(5, 2), transport_delay_ticks=delay, law=law)
    assert [tick for tick, _, _ in rows.events_with(events.COMMAND_MISSED)] == [k + delay for k in range(10, 14)]
    assert rows.sources()[14 + delay :] == [FRESH] * (TICKS - 14 - delay)


def test_both_ends_agree_when_the_fresh_board_is_busy(lab):
    """At 0.3 s the board is behind for good; a fresh one begins idle, and so must the laboratory's model of it."""
    bench, _ = flown(lab, off(3, 0.6), period_s=0.3, duration_s=12, answer_delay_s=0.345, expect_missed=True)
    assert bench.rig.host.board._flight._free_at_ns == bench.rig.answers._model._free_at_ns > 0
    assert bench.rig.window.real_misses == 0


def test_a_link_that_is_down_when_the_board_is_back(lab):
    """The handshake is exempt: the session begins, and its first samples are lost."""
    down = {"at_s": 6, "do": "link.disconnect", "for_s": 4}
    _, rows = flown(lab, off(5, 2), down)
    assert rows.sessions == [14]
    lost = [frames.unpack(p).tick for _, d, fate, p in rows.packets if d == 0 and p[1] == Type.SAMPLE and fate == 2]
    assert lost == [14, 15, 16, 17, 18, 19]


# -- a paced clock ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at_s", [0, 4.7, 5])
@pytest.mark.parametrize("for_s", [0.5, 3])
def test_on_a_clock_the_same(lab, at_s, for_s):
    made = []
    for clock in (None, StallingClock()):
        bench, rows = flown(lab, off(at_s, for_s), clock=clock)
        assert bench.rig.window.real_misses == 0
        made.append((rows.packets, rows.events, rows.truths, rows.sessions))
    assert made[0] == made[1]


def slow(lab, monkeypatch, boots, *planned, **values):
    """A board that hears nothing for a while after each reset; HELLO leaves at every look."""
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.0)
    monkeypatch.setattr(lab_rejoin, "BACK_WITHIN_S", 60.0)
    bench = lab(clock=StallingClock(), events=planned, **values)
    board = install(bench, {})
    begin = bench.rig.session.again

    def again(*arguments):
        board._deaf = boots
        return begin(*arguments)

    bench.rig.session.again = again
    return bench


def test_a_board_that_is_back_in_time_costs_nothing(lab, monkeypatch):
    bench = slow(lab, monkeypatch, 8, off(5, 5))
    rows = bench.run()
    assert rows.sessions == [20]
    assert bench.rig.window.real_misses == 0


def test_slower_is_a_real_miss(lab, monkeypatch):
    bench = slow(lab, monkeypatch, 20, off(5, 2))
    rows = bench.run()
    (start,) = rows.sessions
    assert start > 14
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == list(range(10, start))
    assert bench.rig.window.real_misses == start - 14


def test_slower_at_the_end_is_one_too(lab, monkeypatch):
    bench = slow(lab, monkeypatch, 500, off(19, 0.5))
    rows = bench.run()
    assert rows.sessions == []
    assert bench.rig.window.real_misses == 1


def test_an_answer_that_has_not_come_when_the_board_is_switched_off_is_a_real_miss(lab):
    """By the model it was there; whatever the board says of it now belongs to the session before."""
    bench = lab(clock=StallingClock(), events=[off(5, 2)], transport_delay_ticks=2, law={"name": "pd"})
    receive = bench.rig.port.receive
    deaf = []

    def late(timeout_s):
        if bench.rig.answers._tick == 9 and len(deaf) < 3:
            deaf.append(timeout_s)
            return None
        return receive(timeout_s)

    bench.rig.port.receive = late
    rows = bench.run()
    assert 9 not in [command.tick for command in rows.commands()]
    assert bench.rig.window.real_misses == 1
    assert rows.sessions == [14]


# -- beside unasked ones ----------------------------------------------------------------------------------------------


def test_an_unasked_restart_counts_before_and_after_a_planned_one(lab):
    bench = lab(events=[off(5, 2)], restart_limit=2)
    install(bench, {8: [BEFORE], 20: [BEFORE]})
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(8, 8, 1), (20, 20, 2)]
    assert rows.sessions == [9, 14, 21]


def test_an_unasked_one_while_the_session_is_opened_counts(lab, monkeypatch):
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.02)
    bench = lab(events=[off(5, 2)])
    board = install(bench, {})
    honest = board.handle
    hit = []

    def handle(packet):
        if packet.type == Type.CONFIG and bench.rig.answers._tick == 10 and not hit:
            hit.append(packet)
            board.reset()
        else:
            honest(packet)

    board.handle = handle
    with pytest.raises(LinkFailure, match=r"restarted at tick 10 .*restart_limit is 0"):
        bench.run()


def test_a_board_that_does_not_come_back_ends_the_run_and_the_line_says_why(lab, monkeypatch):
    monkeypatch.setattr(lab_rejoin, "BACK_WITHIN_S", 0.3)
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.02)
    bench = lab(events=[off(5, 2)])
    board = install(bench, {})
    honest = board.handle
    board.handle = lambda packet: None if bench.rig.answers._tick == 10 else honest(packet)
    with pytest.raises(
        LinkFailure, match=r"no HELLO within 0\.3 s.* \(in the session after board\.restart, at tick 10\)"
    ):
        bench.run()


def test_a_sample_that_the_link_loses_may_be_the_first_of_the_session(lab):
    bench, rows = flown(lab, off(5, 2), channel=Script(lose_up=[14]))
    assert rows.sessions == [14]
    assert len(rows.commands()) == TICKS - 4
    assert bench.rig.window.missed == 4
