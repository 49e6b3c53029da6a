"""Bench `fast`: commands that miss their tick in a fast loop, beside cyclictest's wake-ups later than a period.

ours    `sil run`: law pd, T_s 0.01 s in real time, a minute, over a pty without a modelled bit rate, TELEMETRY in 1 of
        10 ticks. `missed`: ticks at which the command due had not come. `real misses`: these, and ticks at which the
        board's own timer fired (2 ms) though the SAMPLE was there in time by the model: the run is not reproducible.
beside  cyclictest at 100 Hz in the minute after it: wake-ups later than a period, which would have been a miss for
        anybody, and later than 2 ms, which would have let anybody's board run into its timer.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from sil.bench import flights
from sil.bench.book import Book, Goal, Plan
from sil.bench.children import cpus
from sil.bench.wakers import Waker, find_waker
from sil.bench.wakeup import NO_FIFO, START_S, clock_keys, policy, priorities, scenario_file

PERIOD_S = 0.01
TIMEOUT_S = 0.2 * PERIOD_S  # of the board's own timer, as a scenario has it by default
TOLD = ("late_ticks", "rebased_ticks", "causes", "granted")  # of a run, in the details
MOST_REPEATS = 2  # each takes two minutes per policy
EXCESS = 1.0


class FastLoop:
    """The bench `fast`."""

    about = "missed commands of law pd at T_s 0.01 s, beside cyclictest's wake-ups later than that period"

    def expected_s(self, plan: Plan) -> float:
        return self._repeats(plan) * len(priorities()) * (2 * wall_s(plan) + START_S)

    def measure(self, plan: Plan, book: Book) -> None:
        waker = find_waker()
        if len(priorities()) == 1:
            book.note(NO_FIFO)
        if self._repeats(plan) < plan.repeats:
            book.note(f"{self._repeats(plan)} repeats at most: a repeat takes two minutes")
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as name:
            for repeat in range(self._repeats(plan)):
                for priority in priorities():
                    what = f"{policy(priority)}, repeat {repeat + 1} of {self._repeats(plan)}"
                    with flights.left_out(book, what):
                        one_pair(plan, book, waker, priority, what, Path(name) / f"{priority}-{repeat}")

    @staticmethod
    def _repeats(plan: Plan) -> int:
        return min(plan.repeats, MOST_REPEATS)


def wall_s(plan: Plan) -> float:
    """How long a run lasts."""
    return 5.0 if plan.quick else 60.0


def one_pair(plan: Plan, book: Book, waker: Waker, priority: int, what: str, folder: Path) -> None:
    """A run, then cyclictest for as long."""
    ticks, (lab, board) = round(wall_s(plan) / PERIOD_S), cpus()
    plan.doing(f"fast: sil run, {what}")
    keys = clock_keys("realtime", priority, lab, board)
    run = flights.paced(scenario_file(folder, PERIOD_S, ticks), folder / "run", keys, wall_s(plan))
    plan.doing(f"fast: {waker.name}, {what}")
    late_us = waker.lateness_us(round(PERIOD_S * 1e6), ticks, priority, lab)
    link, timing = run.summary["link"], run.summary["timing"]
    goal = Goal(EXCESS, of="excess", judged="each")
    for case, ours, limit_us, judge in (
        (f"missed in {wall_s(plan):g} s", link["missed"], PERIOD_S * 1e6, goal),
        (f"real misses in {wall_s(plan):g} s", link["real_misses"], TIMEOUT_S * 1e6, None),
    ):
        beside_what = f"{waker.name} > {limit_us * 1e-3:g} ms"
        beyond = sum(late > limit_us for late in late_us)
        book.line(f"{policy(priority)}, {case}", "ticks", beside_what, judge).add(ours, beyond)
    answer = timing["answer_us"]
    book.line(f"{policy(priority)}, answer p99", "us").add(answer["p99"])
    book.line(f"{policy(priority)}, answer max", "us").add(answer["max"])
    told = {name: timing[name] for name in TOLD if name in timing}
    book.details.setdefault("runs", []).append({"policy": policy(priority), **told})
