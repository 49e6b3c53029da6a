"""The C board's own timer on a fake clock, clause by clause of the timing contract; each also held against Python."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest
from c_board import CBoard, Heard, Step, assert_same, python_board
from test_sessions_in_c import flight, frames_of, sample, stream

from protocol import events, frames
from protocol.frames import Command, Event, Telemetry, Tick
from protocol.law_tables import TELEMETRY_COMMON

MS = 1_000_000
REAL_TIME, TWENTY_TIMES = 65536, 20 * 65536
DROPPED = [word.name for word in TELEMETRY_COMMON].index("dropped")


class Bench:
    """A session with a clock; `after(...)` flies it on both boards from boot."""

    def __init__(self, c_board: CBoard, rate: int = REAL_TIME, law: str = "appc", **values: float) -> None:
        timing = {"period_us": 500_000, "sample_timeout_us": 100_000}
        self._c_board = c_board
        self._opening = flight(0, law, rate, **{**timing, **values})

    def after(self, *steps: Step) -> Flown:
        whole = [*self._opening, *steps]
        heard = self._c_board.serve(whole)
        assert_same(heard, python_board(whole))
        return Flown(heard, len(self._opening))


class Flown:
    """What the board did after each step: its frames, and until when it waits then."""

    def __init__(self, heard: Heard, opening: int) -> None:
        ends = [at for at, (kind, _) in enumerate(heard.records) if kind == "U"][opening:]
        self.timers = [heard.records[at][1] for at in ends[1:]]
        self.answers = [
            [packet.frame for kind, data in heard.records[start:end] if kind == "W" for packet in frames_of(data)]
            for start, end in pairwise(ends)
        ]

    def used(self, step: int = -1) -> list[tuple[int, int]]:
        return [(frame.tick, frame.used) for frame in self.answers[step] if isinstance(frame, Command)]

    def events(self, step: int = -1) -> list[tuple[int, int, int]]:
        return [(frame.code, frame.a, frame.b) for frame in self.answers[step] if isinstance(frame, Event)]


def samples(*ticks: int) -> list[Step]:
    return [Step(stream(sample(tick))) for tick in ticks]


def at(*times_ms: int) -> list[Step]:
    return [Step(time_ns=time_ms * MS) for time_ms in times_ms]


def test_lockstep_has_no_timer(c_board: CBoard) -> None:
    flown = Bench(c_board, rate=0).after(*samples(0, 1), *at(10**6), Step(stream(Tick(2))), *samples(1))
    assert flown.timers == [None] * 5
    assert flown.answers[2] == []


def test_it_starts_with_the_first_sample_and_each_sample_rephases_it(c_board: CBoard) -> None:
    """B3: now + (T_s + sample_timeout)."""
    flown = Bench(c_board).after(*at(7), *samples(0), *at(503), *samples(1))
    assert flown.timers == [None, 607 * MS, 607 * MS, 1103 * MS]


def test_a_tick_frame_does_not_set_it(c_board: CBoard) -> None:
    flown = Bench(c_board).after(Step(stream(Tick(0))), *samples(1), *at(100), Step(stream(Tick(2))))
    assert flown.timers == [None, 600 * MS, 600 * MS, 600 * MS]


def test_it_steps_a_missing_tick_and_goes_on_at_the_period(c_board: CBoard) -> None:
    """B3: it is set T_s later than it was, however late it was looked at."""
    flown = Bench(c_board).after(*samples(0), *at(599, 600, 1105), *samples(1, 3))
    assert flown.used(1) == []
    assert flown.used(2) == [(1, frames.PROPAGATED)]
    assert flown.used(3) == [(2, frames.PROPAGATED)]
    assert flown.timers[2:4] == [1100 * MS, 1600 * MS]
    assert flown.used(4) == []
    assert flown.used(5) == [(3, frames.USED)]


def test_one_late_look_steps_every_tick_that_is_due_one_after_the_other(c_board: CBoard) -> None:
    flown = Bench(c_board).after(*samples(0), *at(1700, 1700, 1700, 1700))
    assert [flown.used(step) for step in (1, 2, 3, 4)] == [
        [(1, frames.PROPAGATED)], [(2, frames.PROPAGATED)], [(3, frames.PROPAGATED)], []
    ]  # fmt: skip


def test_a_sample_that_is_there_comes_before_the_timer_that_is_due(c_board: CBoard) -> None:
    flown = Bench(c_board).after(*samples(0), *at(599), Step(stream(sample(1))), *at(1098))
    assert flown.used(2) == [(1, frames.USED)]
    assert flown.timers[2] == 1199 * MS
    assert flown.answers[3] == []


def test_noise_does_not_keep_it_from_firing(c_board: CBoard) -> None:
    """Bytes that are no frame wake the board; the timer is then looked at as ever."""
    opening = Bench(c_board).after(*samples(0), *at(650))
    assert opening.used(1) == [(1, frames.PROPAGATED)]
    flown = Bench(c_board).after(*samples(0), *at(599), Step(b"noise"), *at(601), Step(b"\0"), Step(b"more noise\0"))
    assert [flown.used(step) for step in range(2, 6)] == [[], [(1, frames.PROPAGATED)], [], []]


@pytest.mark.parametrize(("rate", "expected_ns"), [(TWENTY_TIMES, 30 * MS), (3, 13_107_200_000_000), (2**32 - 1, 9155)])
def test_it_runs_at_the_clock_rate_of_hello(c_board: CBoard, rate: int, expected_ns: int) -> None:
    """B3: wall ns = ns * 65536 / clock_rate_q16, rounded down."""
    assert Bench(c_board, rate).after(*samples(0)).timers == [expected_ns]


def test_a_stale_sample_rephases_it_so_that_a_board_ahead_waits_for_the_lab(c_board: CBoard) -> None:
    """B7: now + ((j - k) T_s + sample_timeout)."""
    flown = Bench(c_board).after(*samples(0), *at(600, 1100, 1600), *samples(1), *at(1650), *samples(2, 3, 4))
    assert flown.timers[4] == (1600 + 3 * 500 + 100) * MS
    assert flown.timers[6] == (1650 + 2 * 500 + 100) * MS
    assert [flown.used(step) for step in (4, 6, 7, 8)] == [[], [], [], [(4, frames.USED)]]
    telemetry = next(frame for frame in flown.answers[8] if isinstance(frame, Telemetry))
    assert telemetry.words[DROPPED] == 3
    assert flown.events(8) == [(events.STALE_SAMPLE, tick, tick) for tick in (1, 2, 3)]


def test_the_link_watchdog_counts_the_timers_steps(c_board: CBoard) -> None:
    """B14: zero from step link_limit without a SAMPLE, until one comes, usable or not."""
    silent = at(*range(600, 4100, 500))
    unusable = Step(stream(sample(9)._replace(valid=0)))
    flown = Bench(c_board, law="pd", link_limit=3).after(*samples(0, 1), *silent, unusable)
    commands = [next(f for f in answer if isinstance(f, Command)) for answer in flown.answers[1:]]
    assert [bool(c.flags & frames.FLAG_WATCHDOG) for c in commands] == [False] * 3 + [True] * 5 + [False]
    assert [any(c.torque) for c in commands] == [True] * 3 + [False] * 5 + [True]
    assert (events.WATCHDOG_ON, 4, 3) in flown.events(4)
    assert (events.WATCHDOG_OFF, 9, 0) in flown.events(9)


@pytest.mark.parametrize("ahead", [1, 2, 3, 4])
def test_a_sample_ahead_of_the_timer_by_up_to_four_is_propagated_up_to(c_board: CBoard, ahead: int) -> None:
    """B8, and the timer is set once, by the SAMPLE."""
    flown = Bench(c_board).after(*samples(0), *at(600, 700), *samples(2 + ahead))
    assert flown.used() == [(2 + i, frames.PROPAGATED) for i in range(ahead)] + [(2 + ahead, frames.USED)]
    assert flown.timers[-1] == 1300 * MS


def test_a_sample_farther_ahead_restarts(c_board: CBoard) -> None:
    """B8: not even the timer answers what lies between."""
    flown = Bench(c_board).after(*samples(0), *at(600), *samples(7), *at(1200))
    assert flown.used(2) == [(7, frames.RESTARTED)]
    assert flown.events(2)[0] == (events.RESTARTED, 2, 7)
    assert flown.timers[2] == 1200 * MS
    assert flown.used(3) == [(8, frames.PROPAGATED)]


def test_timer_and_tick_frame_step_alike(c_board: CBoard) -> None:
    """B2: whatever brings a step without a SAMPLE about, it is the same step."""
    by_timer = Bench(c_board).after(*samples(*range(6)), *at(600, 1100))
    by_tick = Bench(c_board).after(*samples(*range(6)), Step(stream(Tick(6))), Step(stream(Tick(7))))
    assert by_timer.answers == by_tick.answers


def test_a_new_session_stops_it(c_board: CBoard) -> None:
    """Whatever ends a session: a new nonce, STOP."""
    for end in (frames.Hello(1, 0, 0, frames.LAYOUT_HASH, 8, REAL_TIME, "lab"), frames.Stop(0)):
        flown = Bench(c_board).after(*samples(0), Step(stream(end)), *at(10_000))
        assert flown.timers[1:] == [None, None]
        assert flown.answers[2] == []


def steps_of(answers: Sequence[Sequence[frames.Frame]]) -> list[int]:
    return [frame.tick for answer in answers for frame in answer if isinstance(frame, Command)]


def test_the_same_nonce_leaves_it_alone(c_board: CBoard) -> None:
    again = Step(stream(frames.Hello(1, 0, 0, frames.LAYOUT_HASH, 7, 0, "lab")))
    flown = Bench(c_board).after(*samples(0), again, *at(600))
    assert flown.timers == [600 * MS, 600 * MS, 1100 * MS]
    assert steps_of(flown.answers) == [0, 1]
