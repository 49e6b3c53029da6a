"""A board that restarts in mid-run (SPEC, L14 to L16): the run goes on or ends, as the scenario says."""

from __future__ import annotations

import pytest
from benches import Script, StallingClock
from reset_boards import AFTER, BEFORE, COMMAND, DEAF, HANG, install

from protocol import events, frames
from protocol.frames import FRESH, HELD, RESTARTED, USED, ZERO, Type
from sil import answers as lab_answers
from sil import rejoin as lab_rejoin
from sil import rig as lab_rig
from sil import session as lab_session
from sil.trouble import LinkFailure

TICKS = 40


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(lab_rig, "DEAD_AFTER_S", 0.6)
    monkeypatch.setattr(lab_answers, "LOOK_EVERY_S", 0.02)
    monkeypatch.setattr(lab_answers, "ASK_AFTER_S", 0.1)
    monkeypatch.setattr(lab_rejoin, "BACK_WITHIN_S", 0.3)
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.02)


def used_of(rows):
    return {command.tick: command.used for command in rows.commands()}


# -- lockstep: simulated time stands still meanwhile ------------------------------------------------------------------


@pytest.mark.parametrize("tick", [0, 1, 2, 3, 4, 5, 10, TICKS - 2])
def test_a_reset_costs_one_command_and_the_next_tick_opens_a_new_session(lab, tick):
    bench = lab(restart_limit=1)
    board = install(bench, {tick: [BEFORE]})
    rows = bench.run()
    assert board.resets == 1
    assert rows.events_with(events.BOARD_RESTARTED) == [(tick, tick, 1)]
    assert rows.events_with(events.COMMAND_MISSED) == [(tick + 1, tick, 1)]
    assert rows.sessions == [tick + 1]
    assert [sample.tick for sample in rows.samples()] == list(range(TICKS))
    assert [command.tick for command in rows.commands()] == [k for k in range(TICKS) if k != tick]
    assert used_of(rows)[tick + 1] == (USED if tick + 1 <= 4 else RESTARTED)
    assert (bench.rig.window.missed, bench.rig.window.real_misses, bench.rig.answers.strays) == (1, 0, 0)


def test_the_torque_is_held_over_the_lost_command(lab):
    bench = lab(restart_limit=1)
    install(bench, {10: [BEFORE]})
    rows = bench.run()
    assert rows.truths[11][1] == rows.truths[10][1] != (0.0, 0.0, 0.0)
    assert rows.sources()[9:14] == [FRESH, FRESH, HELD, FRESH, FRESH]
    assert [sample.ack for sample in rows.samples()][10:13] == [9, 9, 11]  # never an answer to another tick


def test_without_a_command_yet_the_torque_is_zero(lab):
    bench = lab(restart_limit=1)
    install(bench, {0: [BEFORE]})
    rows = bench.run()
    assert rows.sources()[:3] == [ZERO, ZERO, FRESH]
    assert rows.truths[1][1] == (0.0, 0.0, 0.0)


def test_no_hold_no_torque(lab):
    bench = lab(restart_limit=1, hold_limit=0)
    install(bench, {10: [BEFORE]})
    rows = bench.run()
    assert rows.truths[11][1] == (0.0, 0.0, 0.0)
    assert rows.events_with(events.HOLD_LIMIT) == [(11, 10, 1)]


@pytest.mark.parametrize("tick", [0, 3, 10])
def test_a_command_that_came_before_the_reset_acts_though_its_telemetry_is_lost(lab, tick):
    bench = lab(restart_limit=1)
    install(bench, {tick: [COMMAND]})
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(tick, tick, 1)]
    assert rows.events_with(events.COMMAND_MISSED) == []
    assert rows.sources()[1:] == [FRESH] * (TICKS - 1)
    telemetry = [frames.unpack(p).tick for _, d, _, p in rows.packets if d == 1 and p[1] == Type.TELEMETRY]
    assert telemetry == [k for k in range(TICKS) if k != tick]
    assert bench.rig.window.real_misses == 0


def test_a_reset_between_two_ticks_loses_the_sample_that_nobody_took(lab):
    bench = lab(restart_limit=1)
    install(bench, {10: [AFTER]})
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(11, 11, 1)]
    assert rows.sessions == [12]


def test_the_new_session_has_sequences_and_config_of_its_own_and_another_nonce(lab):
    bench = lab(restart_limit=1)
    install(bench, {10: [BEFORE]})
    rows = bench.run()
    config = [(tick, frames.unpack(p).sequence) for tick, _, _, p in rows.packets if p[1] == Type.CONFIG]
    parts = len(config) // 2
    assert config == [(0, n) for n in range(parts)] + [(11, n) for n in range(parts)]
    sequences = {f.tick: f.sequence for f in map(frames.unpack, (p for *_, p in rows.packets)) if f.type == Type.SAMPLE}
    assert (sequences[10], sequences[11], sequences[12]) == (parts + 10, parts, parts + 1)
    hellos = [frames.unpack(p).frame for _, p in rows.kept_house if p[1] == Type.HELLO]
    assert len({hello.nonce for hello in hellos if hello.role == frames.ROLE_LAB}) == 2


@pytest.mark.parametrize(("first", "second"), [(10, 20), (10, 11), (0, 1), (3, 4), (4, 5)])
def test_twice(lab, first, second):
    bench = lab(restart_limit=2)
    install(bench, {first: [BEFORE], second: [BEFORE]})
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(first, first, 1), (second, second, 2)]
    assert rows.sessions == [first + 1, second + 1]
    assert bench.rig.window.missed == 2


@pytest.mark.parametrize("delay", [0, 2])
def test_other_transport_delays(lab, delay):
    law = {"name": "mrac", "params": {"design": "printed"}} if delay == 0 else {"name": "pd"}
    bench = lab(restart_limit=1, transport_delay_ticks=delay, law=law)
    install(bench, {10: [BEFORE]})
    rows = bench.run()
    assert rows.events_with(events.COMMAND_MISSED) == [(10 + delay, 10, 1)]
    assert rows.sources()[10 + delay] == HELD
    assert rows.sources()[11 + delay :] == [FRESH] * (TICKS - 11 - delay)
    assert rows.sessions == [11]


def test_a_sample_that_the_link_loses_may_be_the_first_of_a_session(lab):
    bench = lab(Script(lose_up=[11]), restart_limit=1)
    install(bench, {10: [BEFORE]})
    rows = bench.run()
    assert rows.sessions == [11]
    assert len(rows.commands()) == TICKS - 1


@pytest.mark.parametrize("act", [BEFORE, COMMAND])
def test_at_the_last_tick_the_board_has_to_come_back_and_no_session_is_recorded(lab, act):
    bench = lab(restart_limit=1)
    board = install(bench, {TICKS - 1: [act]})
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(TICKS - 1, TICKS - 1, 1)]
    assert rows.sessions == []
    assert board.board._ready is not None


# -- the execution model of both ends ---------------------------------------------------------------------------------


@pytest.mark.parametrize("tick", [0, 1, 2, 3, 4, 5, 10])
@pytest.mark.parametrize(("period_s", "answer_delay_s"), [(0.4, 0.345), (0.3, 0.345)])
def test_both_ends_agree_when_the_fresh_board_is_busy(lab, tick, period_s, answer_delay_s):
    """At 0.3 s the board is behind for good; a fresh one begins idle, and so must the laboratory's model of it."""
    bench = lab(restart_limit=1, period_s=period_s, duration_s=TICKS * period_s, answer_delay_s=answer_delay_s)
    board = install(bench, {tick: [BEFORE]})
    flights = []
    honest = board.handle
    board.handle = lambda packet: (honest(packet), flights.append(board.board._flight))
    rows = bench.run()
    flight = next(each for each in reversed(flights) if each is not None)
    assert flight._free_at_ns == bench.rig.answers._model._free_at_ns > 0
    assert bench.rig.window.real_misses == 0
    overruns = [command.tick for command in rows.commands() if command.flags & frames.FLAG_OVERRUN]
    assert len(overruns) > 20 if period_s < answer_delay_s else len(overruns) <= 1


# -- too often, or never again ----------------------------------------------------------------------------------------


def test_by_default_the_first_restart_ends_the_run(lab):
    bench = lab()
    install(bench, {10: [BEFORE]})
    with pytest.raises(
        LinkFailure, match=r"^board: restarted at tick 10 \(it says HELLO unasked\); restart_limit is 0"
    ):
        bench.run()
    assert bench.rows.events_with(events.BOARD_RESTARTED) == [(10, 10, 1)]


def test_one_restart_too_many_ends_the_run_and_the_line_names_them(lab):
    bench = lab(restart_limit=2)
    install(bench, {tick: [BEFORE] for tick in (10, 12, 19)})
    with pytest.raises(LinkFailure, match=r"restarted 3 times, at ticks 10, 12, 19 .*restart_limit is 2"):
        bench.run()
    assert bench.rows.sessions == [11, 13]


def test_a_storm_is_told_by_its_first_and_last_ticks(lab):
    bench = lab(restart_limit=20)
    install(bench, {tick: [BEFORE] for tick in range(5, 40)})
    with pytest.raises(LinkFailure, match=r"restarted 21 times, at ticks 5, 6, 7, \.\.\., 23, 24, 25 "):
        bench.run()


def test_restarts_while_the_session_is_opened_count(lab):
    bench = lab(restart_limit=3)
    install(bench, {10: [BEFORE]}, configs=100)
    with pytest.raises(LinkFailure, match=r"restarted 4 times, at ticks 10, 10, 10, 10 .*restart_limit is 3"):
        bench.run()
    assert len(bench.rows.events_with(events.BOARD_RESTARTED)) == 4


def test_a_board_that_needs_several_attempts_gets_them(lab):
    bench = lab(restart_limit=3)
    install(bench, {10: [BEFORE]}, configs=2)
    rows = bench.run()
    assert [b for *_, b in rows.events_with(events.BOARD_RESTARTED)] == [1, 2, 3]
    assert rows.sessions == [11]


@pytest.mark.parametrize("clock", [None, StallingClock()])
def test_a_board_that_does_not_come_back_ends_the_run(lab, clock):
    bench = lab(restart_limit=3, clock=clock)
    install(bench, {10: [BEFORE]}, boots=10**9)
    with pytest.raises(LinkFailure, match="restarted at tick 10, and did not come back: no HELLO within"):
        bench.run()


def test_a_board_that_is_never_ready_again_ends_the_run(lab, monkeypatch):
    monkeypatch.setattr(lab_session, "READY_WITHIN_S", 0.2)
    monkeypatch.setattr(lab_session, "CONFIG_EVERY_S", 0.05)
    bench = lab(restart_limit=3)
    board = install(bench, {10: [BEFORE]})
    honest = board.handle
    board.handle = lambda packet: None if packet.type == Type.CONFIG else honest(packet)
    with pytest.raises(LinkFailure, match="restarted at tick 10, and did not come back: not ready within"):
        bench.run()


# -- hangs ------------------------------------------------------------------------------------------------------------


def test_a_hang_for_ever_is_called_one(lab):
    bench = lab(restart_limit=3)
    install(bench, {10: [HANG]})
    with pytest.raises(LinkFailure, match=r"^board: it hangs: no answer to tick 10 in 0\.6 s, and no watchdog has"):
        bench.run()
    assert bench.rows.events_with(events.BOARD_RESTARTED) == []


def test_a_watchdog_that_resets_a_hanging_board_in_time_is_a_restart(lab):
    bench = lab(restart_limit=1)
    install(bench, {10: [HANG]}, watchdog_s=0.1)
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(10, 10, 1)]
    assert rows.sessions == [11]


def test_without_leave_to_go_on_it_ends_the_run(lab):
    bench = lab()
    install(bench, {10: [HANG]}, watchdog_s=0.1)
    with pytest.raises(LinkFailure, match="restarted at tick 10"):
        bench.run()


def test_a_board_whose_hello_at_boot_is_lost_is_asked(lab):
    """Over UDP a board that restarted has nobody to say HELLO to, and in lockstep nothing else would be sent to it."""
    bench = lab(restart_limit=1)
    install(bench, {10: [BEFORE]}, mute=True)
    rows = bench.run()
    assert rows.sessions == [11]


def test_a_lost_frame_is_not_called_a_hang(lab):
    bench = lab(restart_limit=1)
    install(bench, {10: [DEAF]})
    with pytest.raises(LinkFailure, match=r"no answer to tick 10 in 0\.6 s, though it is there and in session"):
        bench.run()


# -- a paced clock goes on --------------------------------------------------------------------------------------------


def test_on_a_clock_a_quick_restart_costs_what_it_costs_in_lockstep(lab):
    """The board is ready again before the next tick is due."""
    made = {}
    for name, clock in (("lockstep", None), ("paced", StallingClock())):
        bench = lab(restart_limit=1, clock=clock)
        install(bench, {10: [BEFORE]})
        made[name] = bench.run()
        assert bench.rig.window.real_misses == 0
    assert made["paced"].packets == made["lockstep"].packets
    assert made["paced"].events == made["lockstep"].events
    assert made["paced"].truths == made["lockstep"].truths


def slow_boot(lab, monkeypatch, boots, **values):
    """A paced run whose board hears nothing for a while after its reset at tick 10; HELLO leaves at every look."""
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.0)
    monkeypatch.setattr(lab_rejoin, "BACK_WITHIN_S", 60.0)
    bench = lab(restart_limit=1, clock=StallingClock(), **values)
    return bench, install(bench, {10: [BEFORE]}, boots=boots)


def test_on_a_clock_ticks_go_on_while_the_board_boots(lab, monkeypatch):
    bench, _ = slow_boot(lab, monkeypatch, boots=12)
    rows = bench.run()
    (start,) = rows.sessions
    assert start > 13
    assert [tick for tick, *_ in rows.truths] == list(range(TICKS))  # neither skipped nor burst
    assert [sample.tick for sample in rows.samples()] == [*range(11), *range(start, TICKS)]
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == list(range(10, start))
    assert rows.sources()[11 : start + 1] == [HELD] * (start - 10)
    assert rows.sources()[start + 1 :] == [FRESH] * (TICKS - start - 1)
    assert used_of(rows)[start] == RESTARTED
    assert bench.rig.window.real_misses == 0
    assert bench.rig.loop.rebased_ticks == 0


def test_held_too_long_is_zero_until_the_board_is_back(lab, monkeypatch):
    bench, _ = slow_boot(lab, monkeypatch, boots=12, hold_limit=2)
    rows = bench.run()
    (start,) = rows.sessions
    assert rows.sources()[11 : start + 1] == [HELD, HELD] + [ZERO] * (start - 12)
    assert rows.events_with(events.HOLD_LIMIT) == [(13, 12, 3)]
    assert rows.events_with(events.RECOVERED) == [(start + 1, start, start - 10)]


def test_a_run_that_ends_while_the_board_boots_waits_for_it(lab, monkeypatch):
    bench, board = slow_boot(lab, monkeypatch, boots=200)
    rows = bench.run()
    assert rows.sessions == []
    assert len(rows.truths) == TICKS
    assert board.board._ready is not None


def test_who_interrupts_does_not_wait_for_a_board_that_boots(lab, monkeypatch):
    monkeypatch.setattr(lab_answers, "INTERRUPTED_WAIT_ns", 50_000_000)
    bench, _ = slow_boot(lab, monkeypatch, boots=10**9)
    ticks = iter(range(TICKS))
    assert bench.rig.loop.run(lambda: next(ticks) == 20, lambda tick, motion: None) == (20, "interrupted")


def test_on_a_clock_a_hang_that_a_watchdog_ends_has_no_real_misses_left(lab):
    """While it hung they looked like misses of the clock; now it is known whose they were."""
    bench = lab(restart_limit=1, clock=StallingClock())
    board = install(bench, {10: [HANG]})
    bench.rig.clock.at_wait = lambda t_ns: board.reset() if t_ns == 16 * 500_000_000 else None
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(15, 15, 1)]
    assert rows.sessions == [16]
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == list(range(10, 16))
    assert bench.rig.window.real_misses == 0


def test_early_answers_of_the_board_that_is_gone_are_no_answers(lab):
    """Its timer was faster: it had answered ticks 10 to 12 when it restarted. That is none of the new session's."""
    bench = lab(restart_limit=1, clock=StallingClock())
    board = install(bench, {})

    def at_wait(t_ns):
        if t_ns == 10 * 500_000_000:
            for _ in range(3):
                board.board.on_timer()
            bench.rig.answers.listen(0.0)
            bench.rig.answers.listen(0.0)
            board.reset()

    bench.rig.clock.at_wait = at_wait
    rows = bench.run()
    assert rows.events_with(events.BOARD_RESTARTED) == [(9, 9, 1)]
    assert rows.sessions == [10]
    assert rows.sources()[1:] == [FRESH] * (TICKS - 1)  # COMMAND(9) had come, SAMPLE(10) had not left
    assert used_of(rows)[10] == RESTARTED
    assert bench.rig.answers.strays == 0
