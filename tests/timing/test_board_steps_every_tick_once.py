"""The board's half of the timing contract: every tick is stepped exactly once and answered, whatever arrives."""

from __future__ import annotations

import math

import pytest
from benches import BoardBench, FakeHal, commands, events_of, make_sample, telemetry

from firmware_sim.board import Board
from firmware_sim.controllers.compiled import CompiledLaw
from firmware_sim.flight import EVENTS_PER_ANSWER, Flight
from protocol import config, events, frames
from protocol.frames import Hello
from protocol.law_tables import TELEMETRY_COMMON

LOST, OVERRUNS, DROPPED = (
    [word.name for word in TELEMETRY_COMMON].index(name) for name in ("samples_lost", "overruns", "dropped")
)


def used(answers):
    return [(command.tick, command.used) for command in commands(answers)]


def test_a_sample_is_answered_with_its_tick(bench):
    board = bench()
    for tick in range(5):
        assert used(board.sample(tick)) == [(tick, frames.USED)]


def test_the_answer_is_command_then_telemetry_then_events_and_command_counts_them(bench):
    board = bench(telemetry_every=2)
    for tick in range(6):
        answer = board.sample(tick, valid=0 if tick == 5 else 7)
        names = [type(frame).__name__ for frame in answer]
        assert names == sorted(names, key=["Command", "Telemetry", "Event"].index)
        assert answer[0].follows == len(answer) - 1
        assert bool(telemetry(answer)) == (tick % 2 == 0)


def test_tick_steps_without_a_sample_and_is_answered(bench):
    board = bench()
    for tick in range(6):
        board.sample(tick)
    answer = board.tick(6)
    assert used(answer) == [(6, frames.PROPAGATED)]
    assert [e.code for e in events_of(answer)] == [events.SAMPLE_LOST]


def test_a_law_without_a_model_repeats_its_last_command_and_flags_it(bench):
    board = bench("pd")
    for tick in range(4):
        last = commands(board.sample(tick, readings=make_sample(0).readings))[-1]
    answer = commands(board.tick(4))
    assert answer[0].used == frames.REPEATED
    assert answer[0].torque == last.torque != (0, 0, 0)


def test_a_law_with_a_model_propagates_and_does_not_reuse_the_stale_reading(bench):
    """If the stale reading were taken as fresh, a second board that does get it again would answer the same."""
    lossy, reused = bench(), bench()
    for tick in range(12):
        reading = (11930465 + 400_000 * tick * tick, 0, 0)
        sample = make_sample(tick)
        sample = sample._replace(readings=(sample.readings[0]._replace(values=reading), *sample.readings[1:]))
        lossy.send(sample)
        reused.send(sample)
    stale = sample._replace(tick=12)
    lossy_answer, reused_answer = commands(lossy.tick(12)), commands(reused.send(stale))
    assert lossy_answer[0].used == frames.PROPAGATED
    assert lossy_answer[0].torque != reused_answer[0].torque


def test_an_invalid_reading_counts_as_lost(bench):
    board = bench()
    for tick in range(6):
        board.sample(tick)
    answer = board.sample(6, valid=6)  # Euler angles invalid
    assert used(answer) == [(6, frames.PROPAGATED)]
    assert [e.code for e in events_of(answer)] == [events.READING_INVALID, events.SAMPLE_LOST]


def test_a_sample_for_a_tick_already_stepped_is_counted_and_dropped(bench):
    board = bench()
    board.sample(0)
    board.tick(1)
    assert board.sample(1) == []
    answer = board.sample(2)
    assert used(answer) == [(2, frames.USED)]
    assert telemetry(answer)[0].words[DROPPED] == 1
    assert events.STALE_SAMPLE in [e.code for e in events_of(answer)]


@pytest.mark.parametrize("ahead", [1, 2, 3, 4])
def test_a_sample_ahead_by_up_to_four_is_propagated_up_to(bench, ahead):
    board = bench()
    board.sample(0)
    answer = board.sample(1 + ahead)
    assert used(answer) == [(1 + i, frames.PROPAGATED) for i in range(ahead)] + [(1 + ahead, frames.USED)]


def test_a_sample_further_ahead_restarts_bumplessly(bench):
    board = bench()
    for tick in range(10):
        before = commands(board.sample(tick))[-1]
    assert before.torque != (0, 0, 0)
    answer = board.sample(15)
    assert used(answer) == [(15, frames.RESTARTED)]
    restarted = [e for e in events_of(answer) if e.code == events.RESTARTED]
    assert [(e.a, e.b) for e in restarted] == [(10, 15)]
    assert commands(answer)[0].torque == (0, 0, 0)  # appc begins with four quiet samples
    assert used(board.sample(16)) == [(16, frames.USED)]


def test_a_restart_keeps_counters_and_events_that_wait(bench):
    board = bench(period_us=300_000, answer_delay_us=345_000)
    board.sample(0)
    board.sample(1)  # overrun
    for _ in range(EVENTS_PER_ANSWER):
        board.sample(0)  # stale
    answer = board.sample(20)
    assert used(answer) == [(20, frames.RESTARTED)]
    words = telemetry(answer)[0].words
    assert (words[LOST], words[OVERRUNS], words[DROPPED]) == (1, 1, EVENTS_PER_ANSWER)
    assert [e.code for e in events_of(answer)] == [events.RESTARTED, *[events.STALE_SAMPLE] * (EVENTS_PER_ANSWER - 1)]


def test_a_restart_keeps_the_model_of_busy_time(bench):
    """The lab's own recursion (B13) is not reset either."""
    board = bench(period_us=300_000, answer_delay_us=6_000_000)
    board.sample(0)
    (command,) = commands(board.sample(10))
    assert command.used == frames.RESTARTED
    assert command.flags & frames.FLAG_OVERRUN


def test_an_answer_has_at_most_sixteen_events(bench):
    board = bench()
    board.sample(0)
    for _ in range(EVENTS_PER_ANSWER + 4):
        board.sample(0)
    answer = board.tick(1)  # adds SAMPLE_LOST
    assert EVENTS_PER_ANSWER == 16
    assert len(events_of(answer)) == EVENTS_PER_ANSWER
    assert answer[0].follows == len(answer) - 1
    assert telemetry(answer)[0].words[DROPPED] == EVENTS_PER_ANSWER + 4


def test_arithmetic_saturation_is_an_event_as_its_flag_rises(bench):
    """mrac unwraps angles and holds them to +-8 rad."""
    board = bench("mrac")
    flags, told = [False], []
    for tick in range(200):
        turn = round(0.05 * tick / (2 * math.pi) * 2**32)
        bam = (turn + 2**31) % 2**32 - 2**31
        plain = make_sample(tick)
        readings = (plain.readings[0]._replace(values=(bam, 0, 0)), *plain.readings[1:])
        answer = board.send(plain._replace(readings=readings))
        flags.append(bool(commands(answer)[0].flags & frames.FLAG_ARITHMETIC))
        told += [e.a for e in events_of(answer) if e.code == events.ARITHMETIC_SATURATION]
    rises = [tick for tick in range(200) if flags[tick + 1] and not flags[tick]]
    assert told == rises != []


def test_identification_resumes_after_three_consecutive_good_samples(bench):
    board = bench()
    for tick in range(30):
        board.sample(tick)
    assert not commands(board.sample(30))[0].flags & frames.FLAG_IDENTIFICATION_PAUSED
    board.tick(31)
    paused = [bool(commands(board.sample(t))[0].flags & frames.FLAG_IDENTIFICATION_PAUSED) for t in range(32, 37)]
    assert paused == [True, True, False, False, False]


def test_the_link_watchdog_commands_zero_after_link_limit_ticks_and_recovers(bench):
    board = bench(link_limit=5)
    for tick in range(10):
        board.sample(tick)
    silent = [commands(board.tick(tick))[0] for tick in range(10, 18)]
    flagged = [bool(c.flags & frames.FLAG_WATCHDOG) for c in silent]
    assert flagged == [False] * 4 + [True] * 4
    assert all(c.torque == (0, 0, 0) for c in silent[4:])
    answer = board.sample(18)
    assert not commands(answer)[0].flags & frames.FLAG_WATCHDOG
    assert events.WATCHDOG_OFF in [e.code for e in events_of(answer)]


def test_lockstep_has_no_timer(bench):
    board = bench()
    board.sample(0)
    assert board.board.timer_ns is None


def test_the_timer_fires_sample_timeout_after_the_expected_arrival_and_each_sample_rephases_it(bench):
    board = bench(clock_rate_q16=65536, period_us=500_000, sample_timeout_us=100_000)
    board.hal.time_ns = 1_000
    board.sample(0)
    assert board.board.timer_ns == 1_000 + 600_000_000
    board.hal.time_ns = 503_000_000  # 3 ms of drift
    board.sample(1)
    assert board.board.timer_ns == 503_000_000 + 600_000_000


def test_the_timer_steps_a_missing_tick_and_goes_on_at_the_period(bench):
    board = bench(clock_rate_q16=65536, period_us=500_000, sample_timeout_us=100_000)
    board.sample(0)
    assert used(board.timer()) == [(1, frames.PROPAGATED)]
    assert board.board.timer_ns == 600_000_000 + 500_000_000
    assert used(board.timer()) == [(2, frames.PROPAGATED)]
    assert board.sample(1) == []  # too late: stepped already
    assert used(board.sample(3)) == [(3, frames.USED)]


def test_the_timer_runs_at_the_clock_rate_of_hello(bench):
    board = bench(clock_rate_q16=20 * 65536, period_us=500_000, sample_timeout_us=100_000)
    board.sample(0)
    assert board.board.timer_ns == 600_000_000 // 20


def test_a_stale_sample_rephases_the_timer_so_that_a_board_ahead_waits_for_the_lab(bench):
    """The lab stood still for three periods and goes on where it was; the board must not stay ahead for ever."""
    board = bench(clock_rate_q16=65536, period_us=500_000, sample_timeout_us=100_000)
    board.sample(0)
    for _ in range(3):
        board.timer()
    assert board.sample(1) == []
    assert board.board.timer_ns == board.hal.time_ns + 3 * 500_000_000 + 100_000_000
    assert board.sample(2) == board.sample(3) == []
    assert used(board.sample(4)) == [(4, frames.USED)]


def test_an_overrun_is_counted_and_propagated_over(bench):
    """T_s 0.3 s, 0.345 s of work: sample 1 finds the one-deep mailbox taken."""
    board = bench(period_us=300_000, answer_delay_us=345_000)
    assert used(board.sample(0)) == [(0, frames.USED)]
    answer = board.sample(1)
    assert used(answer) == [(1, frames.PROPAGATED)]
    assert commands(answer)[0].flags & frames.FLAG_OVERRUN
    assert telemetry(answer)[0].words[OVERRUNS] == 1
    assert events.OVERRUN in [e.code for e in events_of(answer)]


def test_no_overrun_when_the_work_fits_the_period(bench):
    board = bench(period_us=400_000, answer_delay_us=345_000)
    assert [used(board.sample(tick)) for tick in range(5)] == [[(tick, frames.USED)] for tick in range(5)]


def test_busy_time_is_computed_from_ticks_and_transit(bench):
    """The second sample would arrive 1 ms too early but for its longer way."""
    board = bench(period_us=300_000, answer_delay_us=301_000)
    board.sample(0, transit_us=0)
    assert used(board.sample(1, transit_us=1_000)) == [(1, frames.USED)]


# -- session ---------------------------------------------------------------------------------------------------------


def test_the_same_nonce_is_only_answered_again_and_a_new_one_resets():
    board = BoardBench().open(nonce=7)
    board.sample(0)
    (hello,) = board.hello(7)
    assert hello.flags & frames.HELLO_CONFIGURED
    assert used(board.sample(1)) == [(1, frames.USED)]
    (hello,) = board.hello(8)
    assert hello.nonce == 8
    assert not hello.flags & frames.HELLO_CONFIGURED


def test_an_unconfigured_board_answers_anything_with_hello():
    board = BoardBench()
    for answer in (board.sample(0), board.tick(0), board.configure()[:1]):
        (hello,) = answer
        assert isinstance(hello, frames.Hello)
        assert not hello.flags & frames.HELLO_ECHO
    board.hello(7)
    (hello,) = board.sample(0)  # greeted, yet not configured
    assert isinstance(hello, frames.Hello)


def test_config_is_idempotent():
    board = BoardBench()
    board.hello(7)
    board.lab.reset()
    first = board.configure()[-1]
    again = board.configure()
    assert first.status == frames.READY_OK
    assert all(ready == first for ready in again)
    assert used(board.sample(0)) == [(0, frames.USED)]


@pytest.mark.parametrize("form", ["fixed", "float"])
@pytest.mark.parametrize("law", ["appc", "mrac", "pd"])
def test_warm_up_leaves_no_trace(bench, monkeypatch, law, form):
    """READY means compiled and warm, yet every answer is that of a flight that was never warmed up."""
    calls = []
    warm_up = CompiledLaw.warm_up
    monkeypatch.setattr(CompiledLaw, "warm_up", lambda self, *arrays: calls.append(warm_up(self, *arrays)))
    warm = bench(law, form=form)
    assert len(calls) == 1
    monkeypatch.setattr(Flight, "_warm_up", lambda self: None)
    cold = bench(law, form=form)
    assert len(calls) == 1
    for tick in range(10):
        assert warm.sample(tick) == cold.sample(tick)
    assert warm.tick(10) == cold.tick(10)


class Rounds(FakeHal):
    """A hal that hands out scripted packets, and notes at each wait how often the watchdog was kicked by then."""

    def __init__(self, *packets):
        super().__init__()
        self.packets, self.kicks_by_round = list(packets), []

    def wait(self, until_ns):
        self.kicks_by_round.append(self.kicks)
        return self.packets.pop(0)


def test_the_hardware_watchdog_is_kicked_once_per_round_whatever_comes():
    hello = frames.Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, 7, 0, "test")
    stop = frames.Stop(frames.STOP_DONE)
    hal = Rounds(None, frames.unpack(frames.pack(hello, 0)), None, None, frames.unpack(frames.pack(stop, 1)))
    board = Board(BoardBench().port, hal)
    board.serve(once=True)
    assert board.stopped
    assert hal.kicks_by_round == [1, 2, 3, 4, 5]


def test_stop_forgets_the_session(bench):
    board = bench()
    board.send(frames.Stop(frames.STOP_DONE))
    assert board.board.stopped
    (hello,) = board.sample(0)
    assert isinstance(hello, frames.Hello)


def test_a_bad_word_is_named_by_its_index():
    board = BoardBench()
    board.words = (*board.words[:3], 5, *board.words[4:])  # period_us: 5 us
    board.hello(7)
    board.lab.reset()
    (ready,) = board.configure()
    assert (ready.status, ready.index) == (frames.READY_BAD_WORD, 3)


def test_a_law_that_supports_one_delay_refuses_others():
    board = BoardBench("appc", transport_delay_ticks=2)
    board.hello(7)
    board.lab.reset()
    (ready,) = board.configure()
    assert ready.status == frames.READY_LAW_REFUSES


def test_what_comes_behind_a_hello_in_the_same_read_is_of_the_new_session(bench):
    """A burst of HELLO and what follows may arrive in one read: nothing of it is forgotten with the old session."""
    board = bench()
    board.sample(0)
    hello = Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, 99, 0, "test")
    answers = board.send(hello, *config.split(board.words), make_sample(0))
    assert [type(frame).__name__ for frame in answers][:3] == ["Hello", "Ready", "Command"]
