"""The lab's half of the timing contract: what acts on [t_k, t_k+1), and what SAMPLE says about it."""

from __future__ import annotations

import numpy as np
import pytest
from benches import Script, StallingClock

from protocol import events
from protocol.frames import FRESH, HELD, NO_TICK, PROPAGATED, USED, ZERO
from sil.commands import CommandWindow, ExecutionModel

TICKS = 40


def torque_bits(bench):
    return bench.scenario.torque_bits


def test_command_k_acts_one_tick_later(lab):
    bench = lab()
    rows = bench.run()
    unit = 2.0 ** -torque_bits(bench)
    commands = {c.tick: c.torque for c in rows.commands()}
    for tick, applied, source in rows.truths[1:]:
        assert source == FRESH
        assert np.array_equal(np.array(commands[tick - 1]) * unit, applied)


def test_sample_tells_what_really_acts_and_which_command_it_is(lab):
    bench = lab(actuators={"wheels": {"torque_max_Nm": 0.002}})
    rows = bench.run()
    unit = 2.0 ** -torque_bits(bench)
    first, *rest = rows.samples()
    assert (first.ack, first.source, first.applied) == (NO_TICK, ZERO, (0, 0, 0))
    for sample, (tick, applied, _) in zip(rest, rows.truths[1:], strict=True):
        assert (sample.ack, sample.source) == (tick - 1, FRESH)
        assert np.allclose(np.array(sample.applied) * unit, applied, rtol=0, atol=unit)
    assert max(abs(value) for _, applied, _ in rows.truths for value in applied) <= 0.002  # after limits


def test_delay_zero_applies_the_command_in_its_own_tick(lab):
    bench = lab(transport_delay_ticks=0, law={"name": "mrac", "params": {"design": "printed"}})
    rows = bench.run()
    unit = 2.0 ** -torque_bits(bench)
    commands = {c.tick: c.torque for c in rows.commands()}
    for tick, applied, _ in rows.truths:
        assert np.array_equal(np.array(commands[tick]) * unit, applied)


@pytest.mark.parametrize("delay", [2, 3])
def test_longer_delays_are_the_same_variable(lab, delay):
    rows = lab(transport_delay_ticks=delay, law={"name": "pd"}).run()
    acks = [sample.ack for sample in rows.samples()]
    assert acks == [NO_TICK] * delay + list(range(TICKS - delay))


def test_a_missing_command_holds_the_previous_torque(lab):
    rows = lab(Script(lose_down=[10])).run()
    assert rows.truths[11][1] == rows.truths[10][1] != (0.0, 0.0, 0.0)
    assert rows.sources()[9:14] == [FRESH, FRESH, HELD, FRESH, FRESH]
    assert [sample.ack for sample in rows.samples()][10:13] == [9, 9, 11]
    assert rows.events_with(events.COMMAND_MISSED) == [(11, 10, 1)]


def test_misses_beyond_hold_limit_are_zero_torque_with_an_event_and_recover(lab):
    rows = lab(Script(lose_down=range(10, 16)), hold_limit=3).run()
    sources = rows.sources()
    assert sources[11:17] == [HELD, HELD, HELD, ZERO, ZERO, ZERO]
    assert sources[17] == FRESH
    assert [applied for tick, applied, _ in rows.truths if 14 <= tick <= 16] == [(0.0, 0.0, 0.0)] * 3
    assert rows.events_with(events.HOLD_LIMIT) == [(14, 13, 4)]
    assert rows.events_with(events.RECOVERED) == [(17, 16, 6)]


def test_misses_are_counted_from_the_first_command_due(lab):
    bench = lab(Script(lose_down=[0, 1]))
    rows = bench.run()
    assert rows.events_with(events.COMMAND_MISSED) == [(1, 0, 1), (2, 1, 2)]
    assert bench.rig.window.missed == 2


def test_a_late_command_is_counted_dropped_and_never_applied(lab):
    """One late answer must not leave the loop a sample behind."""
    bench = lab(Script(delay_down_ns={10: 500_000_000}))
    rows = bench.run()
    assert (bench.rig.window.late, bench.rig.window.missed) == (1, 1)
    assert [tick for tick, _, _ in rows.events_with(events.COMMAND_LATE)] == [11]
    acks = [sample.ack for sample in rows.samples()]
    assert acks[10:14] == [9, 9, 11, 12]
    assert bench.rig.window.real_misses == 0


def test_a_command_just_in_time_acts(lab):
    bench = lab(Script(delay_down_ns={10: 499_999_999}))
    bench.run()
    assert (bench.rig.window.late, bench.rig.window.missed) == (0, 0)


def test_a_lost_sample_becomes_tick_and_the_board_answers_all_the_same(lab):
    rows = lab(Script(lose_up=[10, 11])).run()
    used = {command.tick: command.used for command in rows.commands()}
    assert [used[tick] for tick in range(9, 13)] == [USED, PROPAGATED, PROPAGATED, USED]
    assert rows.sources()[1:] == [FRESH] * (TICKS - 1)


def test_0345_s_of_work_fits_a_period_of_0_4_s(lab):
    bench = lab(period_s=0.4, duration_s=16.0, answer_delay_s=0.345)
    rows = bench.run()
    assert (bench.rig.window.late, bench.rig.window.missed) == (0, 0)
    assert all(command.used == USED for command in rows.commands())


def test_0345_s_of_work_misses_every_command_at_0_3_s(lab):
    bench = lab(period_s=0.3, duration_s=12.0, answer_delay_s=0.345, hold_limit=10)
    rows = bench.run()
    assert bench.rig.window.missed == TICKS - 1
    assert FRESH not in rows.sources()
    assert all(applied == (0.0, 0.0, 0.0) for _, applied, _ in rows.truths)


def test_a_board_busy_through_its_own_answer_propagates_over_the_overrun(lab):
    rows = lab(period_s=0.3, duration_s=12.0, answer_delay_s=0.345).run()
    used = [command.used for command in rows.commands()]
    assert used[0] == USED
    assert PROPAGATED in used[1:]


def test_wire_time_at_the_modelled_baud_counts(lab):
    """A SAMPLE of 65 bytes takes 5.6 ms at 115200 bit/s; a period of 6 ms leaves no time for the answer."""
    from protocol.channel import Clear

    fine = {"period_s": 0.006, "sample_timeout_s": 0.0059, "duration_s": 0.24, "law": {"name": "pd"}}
    slow = lab(Clear(115200), **fine)
    slow.run()
    fast = lab(Clear(None), **fine)
    fast.run()
    assert slow.rig.window.late > 0
    assert fast.rig.window.late == 0


def test_one_write_per_tick(lab):
    rows = lab().run()
    assert rows.commits == [0, *range(TICKS)]


# -- real time: a lab that wakes late, a board that does not wait -----------------------------------------------------


def test_a_wake_up_more_than_a_period_late_moves_the_epoch_and_is_counted(lab):
    period = 500_000_000
    clock = StallingClock({10 * period: period + 1, 20 * period: period})
    bench = lab(clock=clock)
    rows = bench.run()
    assert clock.rebased == [10 * period]
    assert bench.rig.loop.rebased_ticks == 1
    assert rows.events_with(events.EPOCH_REBASED) == [(10, 10, (period + 1) // 1000)]
    assert [tick for tick, _, _ in rows.truths] == list(range(TICKS))  # neither skipped nor burst


def test_a_clock_that_is_never_late_gives_the_lockstep_packets(lab):
    lockstep, paced = lab().run(), lab(clock=StallingClock()).run()
    assert paced.packets == lockstep.packets


def test_a_board_whose_timer_was_faster_is_a_real_miss_and_its_early_answer_acts(lab):
    """The lab sleeps through a SAMPLE: the board steps ticks 10 to 12 alone, then the lab goes on where it was."""

    def at_wait(t_ns):
        if t_ns == 10 * 500_000_000:
            for _ in range(3):
                bench.rig.host.board.on_timer()

    bench = lab(clock=StallingClock(at_wait=at_wait))
    rows = bench.run()
    used = {command.tick: command.used for command in rows.commands()}
    assert [used[tick] for tick in range(8, 15)] == [USED, USED, PROPAGATED, PROPAGATED, PROPAGATED, USED, USED]
    assert bench.rig.window.real_misses == 3
    assert bench.rig.window.missed == 0
    assert rows.sources()[1:] == [FRESH] * (TICKS - 1)
    assert len(rows.commands()) == TICKS


# -- the pieces ------------------------------------------------------------------------------------------------------


def test_a_physically_late_command_is_a_real_miss_and_not_applied():
    window = CommandWindow(delay_ticks=1, period_ns=1000, hold_limit=3)
    window.decide(0)
    assert window.real_misses == 1  # nothing came, and the model knows no reason
    assert not window.arrive(0, (1.0, 0.0, 0.0), arrival_ns=10)
    assert window.real_misses == 1
    assert window.decide(1).torque_Nm == (0.0, 0.0, 0.0)


def test_a_modelled_miss_is_no_real_miss():
    window = CommandWindow(delay_ticks=1, period_ns=1000, hold_limit=3)
    assert not window.arrive(0, (1.0, 0.0, 0.0), arrival_ns=1000)
    window.decide(0)
    window.lost(1)
    window.decide(1)
    assert (window.real_misses, window.late, window.missed) == (0, 1, 2)


def test_the_execution_model_is_the_boards_recursion():
    model = ExecutionModel(period_ns=300, sample_timeout_ns=60, answer_delay_ns=345)
    assert [model.done_ns(tick, 0) for tick in range(4)] == [345, 690, 1035, 1380]
    idle = ExecutionModel(period_ns=400, sample_timeout_ns=60, answer_delay_ns=345)
    assert idle.done_ns(0, 5) == 350
    assert idle.done_ns(1, None) == 400 + 60 + 345
    assert idle.done_ns(2, 0) == 800 + 5 + 345  # it was busy until 805
