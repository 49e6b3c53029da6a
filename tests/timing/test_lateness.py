"""Why a tick was late: each cause is made on purpose with clocks that a test sets, and has to be told apart."""

from __future__ import annotations

import gc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.lateness import Account, Cause, HISTOGRAM_EDGES_us, histogram, of_run, percentiles_us

PERIOD_ns = 10_000_000
MS = 1_000_000


class Times:
    """A wall clock and this thread's CPU time; `work` moves both, `away` the wall only."""

    def __init__(self) -> None:
        self.wall_ns = self.cpu_ns = 0

    def work(self, ns: int) -> None:
        self.wall_ns += ns
        self.cpu_ns += ns

    def away(self, ns: int) -> None:
        self.wall_ns += ns


class Bench:
    """An account that is followed tick by tick; deadlines are whole periods."""

    def __init__(self) -> None:
        self.times = Times()
        self.account = Account(lambda: self.times.wall_ns, lambda: self.times.cpu_ns)
        self.tick = 0
        self.wake()

    def wake(self, late_ns: int = 0):
        """Sleep to the next deadline and `late_ns` beyond, or not at all when it has passed already."""
        deadline_ns = self.tick * PERIOD_ns
        self.times.wall_ns = max(self.times.wall_ns, deadline_ns + late_ns)
        self.tick += 1
        return self.account.woke(self.times.wall_ns - deadline_ns)


def test_a_sleeper_woken_late_blames_the_machine():
    bench = Bench()
    bench.times.work(MS)
    bench.account.sleeps()
    wake = bench.wake(3 * MS)
    assert (wake.late_ns, wake.cause, wake.work_ns) == (3 * MS, Cause.MACHINE, MS)


def test_on_time_blames_nobody():
    bench = Bench()
    bench.account.sleeps()
    assert bench.wake().cause is Cause.NONE


def test_computing_past_the_deadline_is_own_work():
    bench = Bench()
    bench.times.work(12 * MS)
    bench.account.sleeps()
    wake = bench.wake()
    assert (wake.late_ns, wake.cause, wake.work_ns) == (2 * MS, Cause.OWN_WORK, 12 * MS)


def test_standing_still_during_the_work_blames_the_machine():
    """SIGSTOP, or another process on this CPU: wall time passes, CPU time does not."""
    bench = Bench()
    bench.times.work(MS)
    bench.times.away(5000 * MS)
    bench.account.sleeps()
    assert bench.wake().cause is Cause.MACHINE


def test_a_slow_write_of_the_log():
    bench = Bench()
    bench.times.work(MS)
    bench.account.call(Cause.LOG_WRITE, bench.times.away, 15 * MS)
    bench.account.sleeps()
    wake = bench.wake()
    assert (wake.cause, wake.log_ns) == (Cause.LOG_WRITE, 15 * MS)


def test_garbage_collection():
    bench = Bench()
    with bench.account:
        (callback,) = [each for each in gc.callbacks if getattr(each, "__self__", None) is bench.account]
        bench.times.work(MS)
        callback("start", {})
        bench.times.work(14 * MS)
        callback("stop", {})
    bench.account.sleeps()
    wake = bench.wake()
    assert (wake.cause, wake.gc_ns) == (Cause.GARBAGE_COLLECTION, 14 * MS)
    assert bench.account._collecting not in gc.callbacks


def test_an_answer_taken_across_the_deadline():
    bench = Bench()
    bench.times.work(MS)
    bench.account.sleeps()
    bench.times.away(8 * MS)
    bench.account.listening(lambda timeout_s: bench.times.work(2 * MS))(0.001)
    assert bench.wake().cause is Cause.LATE_ANSWER


def test_a_wait_for_answers_that_the_kernel_ends_late_blames_the_machine():
    bench = Bench()
    bench.times.work(MS)
    bench.account.sleeps()
    bench.account.listening(lambda timeout_s: bench.times.away(11 * MS))(0.009)
    assert bench.wake().cause is Cause.MACHINE


def test_lateness_that_is_carried_over_keeps_its_cause():
    """Tick 1 wakes 9.5 ms late and then works its usual 1 ms: that tick 2 is late too is not its own doing."""
    bench = Bench()
    bench.account.sleeps()
    bench.wake(19 * MS // 2)
    bench.times.work(MS)
    bench.account.sleeps()
    wake = bench.wake()
    assert (wake.late_ns, wake.cause) == (MS // 2, Cause.MACHINE)


@pytest.mark.parametrize("cause", [Cause.LINK_WRITE, Cause.OWN_WORK])
def test_a_call_that_waits_is_not_the_machines_fault(cause: Cause):
    """A board that does not read its pty, a view that sleeps: no CPU time passes, and still nobody stopped us."""
    bench = Bench()
    bench.times.work(MS)
    bench.account.call(cause, bench.times.away, 13 * MS)
    bench.account.sleeps()
    assert bench.wake().cause is cause


def test_garbage_collection_while_a_frame_is_taken():
    bench = Bench()
    with bench.account:
        bench.account.sleeps()
        bench.times.away(8 * MS)

        def collect(timeout_s: float) -> None:
            bench.account._collecting("start", {})
            bench.times.work(5 * MS)
            bench.account._collecting("stop", {})

        bench.account.listening(collect)(0.001)
        assert bench.wake().cause is Cause.GARBAGE_COLLECTION


def test_a_moved_epoch_forgives_what_came_before():
    """After one long stop, a tick that computes too long is own work again, however late the stopped one was."""
    bench = Bench()
    bench.times.away(5000 * MS)
    bench.account.sleeps()
    assert bench.wake().cause is Cause.MACHINE
    bench.account.rebased()
    bench.tick = bench.times.wall_ns // PERIOD_ns + 2
    bench.times.wall_ns = (bench.tick - 1) * PERIOD_ns
    bench.account.woke(0)
    for _ in range(3):
        bench.times.work(25 * MS)
        bench.account.sleeps()
        assert bench.wake().cause is Cause.OWN_WORK


@given(st.lists(st.integers(0, 10**11), max_size=300))
def test_the_histogram_counts_every_wake_up_once(late_ns: list[int]):
    made = histogram(late_ns)
    assert sum(made["counts"]) == len(late_ns)
    assert made["counts"][0] == sum(late <= 1000 for late in late_ns)
    assert made["counts"][-1] == sum(late > HISTOGRAM_EDGES_us[-1] * 1000 for late in late_ns)


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=300), st.floats(0.001, 2000))
def test_late_is_beyond_the_limit_or_a_period(late_ns: list[int], limit_ms: float):
    made = of_run(late_ns, [Cause.MACHINE] * len(late_ns), PERIOD_ns, limit_ms)
    limit_ns = min(limit_ms * 1e6, PERIOD_ns)
    assert made["late_ticks"] == sum(late > limit_ns for late in late_ns) == made["causes"]["late_ticks"]["machine"]
    assert made["late_fraction"] == pytest.approx(made["late_ticks"] / len(late_ns))
    assert sum(made["causes"]["latest_percent"].values()) == -(-len(late_ns) // 100)
    assert made["wakeup_us"]["max"] == pytest.approx(max(late_ns) * 1e-3, abs=1e-3)


def test_lockstep_has_no_wake_ups():
    made = of_run((), (), float("inf"), None)
    assert made["late_ticks"] == 0 and made["late_fraction"] == 0.0 and made["late_beyond_ms"] is None
    assert percentiles_us([])["p99"] is None
