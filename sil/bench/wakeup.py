"""Bench `wakeup`: how late our ticks wake up, beside cyclictest at the same rate, policy, priority and CPU.

ours    a whole `sil run` in real time over a pty with law pd: lateness of every tick after the first, from its log.
        By default it does not sleep the last stretch before a deadline (`clock.spin_us`) but looks at the clock, so
        that it is on time although a wake-up is not. This is what a user gets, and the table says so.
asleep  the same with `clock.spin_us: 0`: exactly what cyclictest does, so the comparison of like with like. The goal
        is the same for both.
beside  cyclictest with as many wake-ups (sil.bench.wakers); it does nothing else, ours has a tick of work between two.

Each repeat runs one after the other. 1000 Hz is T_s 0.01 s at ten times real time: the wall clock's period counts here,
and the law's shortest is 5 ms. Ordinary scheduling with 1 ns of timer slack, then SCHED_FIFO where it is permitted.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

from sil.bench import flights
from sil.bench.book import Book, Goal, Plan
from sil.bench.children import cpus, may_use_fifo
from sil.bench.wakers import Waker, find_waker, percentiles
from sil.scenario_sections import Clock

PRIORITY = 50
RATIO_P99 = 1.5
JUDGED_FROM_HZ = 100  # below, a repeat has too few wake-ups for a p99
SPINNING, ASLEEP = f"last {Clock().spin_us} us not slept", "asleep"
START_S = 2.0  # of a `sil run` and its board
NO_FIFO = "SCHED_FIFO is not permitted here (run as root, or set rtprio in /etc/security/limits.conf): left out"


class Pace(NamedTuple):
    """One rate: T_s, clock, and how long a repeat lasts on the wall."""

    rate_hz: int
    period_s: float
    clock: str
    wall_s: float
    quick_s: float

    def ticks(self, plan: Plan) -> int:
        """Wake-ups of one repeat."""
        return round((self.quick_s if plan.quick else self.wall_s) * self.rate_hz)


PACES = (
    Pace(2, 0.5, "realtime", 10.0, 3.0),
    Pace(100, 0.01, "realtime", 12.0, 3.0),
    Pace(1000, 0.01, "scaled:10", 8.0, 2.0),
)


class Wakeup:
    """The bench `wakeup`."""

    about = (
        f"wake-ups of a run in real time over a pty, as it is by default ({SPINNING}) and {ASLEEP} to the deadline, "
        "beside cyclictest, which sleeps, at the same rate, priority and CPU"
    )

    def expected_s(self, plan: Plan) -> float:
        each = sum(3 * pace.ticks(plan) / pace.rate_hz + 2 * START_S for pace in PACES)
        return plan.repeats * len(priorities()) * each

    def measure(self, plan: Plan, book: Book) -> None:
        waker = find_waker()
        if len(priorities()) == 1:
            book.note(NO_FIFO)
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as name:
            for repeat in range(plan.repeats):
                for priority in priorities():
                    for pace in PACES:
                        what = f"{pace.rate_hz} Hz, {policy(priority)}, repeat {repeat + 1} of {plan.repeats}"
                        folder = Path(name) / f"{pace.rate_hz}-{priority}-{repeat}"
                        with flights.left_out(book, what):
                            one_round(plan, book, waker, pace, priority, what, folder)


def priorities() -> tuple[int, ...]:
    """0 (ordinary) and, where it is permitted, PRIORITY."""
    return (0, PRIORITY) if may_use_fifo(PRIORITY) else (0,)


def policy(priority: int) -> str:
    """As the table says it."""
    return f"FIFO {priority}" if priority else "ordinary"


def one_round(plan: Plan, book: Book, waker: Waker, pace: Pace, priority: int, what: str, folder: Path) -> None:
    """A run as it is, one that sleeps to its deadlines, then as many wake-ups of the bare program."""
    ticks, (lab, board) = pace.ticks(plan), cpus()
    file = scenario_file(folder, pace.period_s, ticks)
    keys = clock_keys(pace.clock, priority, lab, board)
    found: dict[str, list[float]] = {}
    for name, more in ((SPINNING, []), (ASLEEP, ["clock.spin_us=0"])):
        plan.doing(f"wakeup: sil run {name}, {what}")
        run = flights.paced(file, folder / name.replace(" ", "-"), [*keys, *more], ticks / pace.rate_hz)
        found[name] = run.lateness_us[1:]
        timing = run.summary["timing"]
        told = {key: timing[key] for key in ("late_ticks", "causes", "granted") if key in timing}
        book.details.setdefault("runs", []).append({"case": f"{what}, {name}", **told})
        for refused in (timing["granted"] or {}).get("refused", ()):
            book.note(f"refused: {refused}")
    plan.doing(f"wakeup: {waker.name}, {what}")
    beside = waker.lateness_us(1_000_000 // pace.rate_hz, ticks, priority, lab)
    case = f"{pace.rate_hz} Hz {policy(priority)}"
    for name, late_us in found.items():
        enter(book, f"{case} {name}", waker.name, late_us, beside, judged=pace.rate_hz >= JUDGED_FROM_HZ)
    pool(book, f"{case}, {waker.name}", beside)


def clock_keys(clock: str, priority: int, lab: int, board: int) -> list[str]:
    """Scenario keys of a run that is paced, pinned and, where asked for, privileged."""
    keys = [f"clock.mode={clock}", f"clock.lab_cpu={lab}", f"clock.board_cpu={board}"]
    return [*keys, f"clock.priority={priority}"] if priority else keys


def enter(book: Book, case: str, beside_name: str, ours_us: list[float], beside_us: list[float], judged: bool) -> None:
    """One repeat of one case, a line per percentile."""
    mine, other = percentiles(ours_us), percentiles(beside_us)
    for name in mine:
        goal = Goal(RATIO_P99) if judged and name == "p99" else None
        book.line(f"{case}, {name}", "us", beside_name, goal).add(mine[name], other[name])
    pool(book, f"{case}, sil", ours_us)


def pool(book: Book, whose: str, late_us: list[float]) -> None:
    """Percentiles over all repeats together: the only ones that mean something far out, or at 2 Hz."""
    everything = book.scratch.setdefault(whose, [])
    everything += late_us
    pooled = book.details.setdefault("all repeats together, us", {})
    pooled[whose] = {"wakeups": len(everything), **percentiles(everything)}


def scenario_file(folder: Path, period_s: float, ticks: int) -> Path:
    """A scenario of law pd at this period, over a pty without a modelled bit rate, TELEMETRY in 1 of 10 ticks."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "bench-pd.yaml"
    file.write_text(
        f"period_s: {period_s}\nduration_s: {period_s * ticks:.6g}\n"
        "law: {name: pd, form: fixed}\nlink: {url: pty, baud: null}\ntelemetry_every: 10\n",
        encoding="utf-8",
    )
    return file
