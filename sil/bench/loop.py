"""Bench `loop`: how many times faster than real time a whole closed loop runs, beside Basilisk with a law in Python.

T_s 0.5 s and RK4 steps of 0.05 s on both sides, rigid satellite in orbit with gravity gradient, one sensor, one law.

ours    plant, wheels with limits, sensors with noise and quantisation, frames with COBS and CRC both ways, board with
        reference model and law, the transport delay of one tick; over a pty also a second process and the log on disk.
beside  Basilisk's spacecraft, gravity gradient, simpleNav and external torque in C++, a PD of three lines in Python,
        and two message recorders in memory, all in one process. No wheels, frames, delay, reference model or log.

Times are those of the loop alone: no start, no sealing of the log here, no reading of the recorders there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sil.bench import flights
from sil.bench.basilisk import Satellite
from sil.bench.book import Book, Goal, Line, Plan
from sil.bench.series import Unavailable
from sil.plants.rigid import parameters_of
from sil.sinks.nothing import Nothing

UNIT = "x real time"
BESIDE = "Basilisk"
GAINS = (0.02, 0.4)  # of the PD beside: it settles, and that is all that is asked of it
RATIO_PTY, RATIO_IN_PROCESS, TIMES_REAL_TIME = 1.0, 5.0, 5000.0


class WholeLoop:
    """The bench `loop`."""

    about = "the whole closed loop at T_s 0.5 s in lockstep, beside Basilisk with a law in Python at the same step"

    def expected_s(self, plan: Plan) -> float:
        return 5.0 + plan.repeats * (2.5 if plan.quick else 5.0)

    def measure(self, plan: Plan, book: Book) -> None:
        duration_s = 500 if plan.quick else 1000
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as folder:
            for repeat in plan.rounds("loop"):
                beside = basilisk_speed(book, duration_s)
                for line, speed in our_speeds(book, Path(folder) / f"{repeat}", duration_s, beside is not None):
                    line.add(speed, beside if line.beside_what else None)


def our_speeds(book: Book, folder: Path, duration_s: int, compared: bool) -> Iterator[tuple[Line, float]]:
    """(line, times real time) of each case."""
    beside = BESIDE if compared else ""
    keys = ("law.form=fixed", *flights.OVER_PTY, f"duration_s={duration_s}")
    goal = Goal(RATIO_PTY, at_most=False) if compared else None
    summary = flights.recorded(flights.scenario("pd", *keys), folder)
    yield book.line("sil run over a pty, pd fixed", UNIT, beside, goal, True), _speed(summary)
    for law in ("pd", "appc", "mrac"):
        scenario = flights.scenario(law, "law.form=float", *flights.IN_PROCESS, f"duration_s={duration_s}")
        ticks, wall_s = flights.unrecorded(scenario, Nothing())
        speed, case = ticks * scenario.period_s / wall_s, f"in process without log, {law} float"
        absolute, relative = (Goal(TIMES_REAL_TIME, "ours", at_most=False), Goal(RATIO_IN_PROCESS, at_most=False))
        if law == "pd" and compared:
            yield book.line(case, UNIT, beside, relative, True), speed
            yield book.line(f"{case} by itself", UNIT, "", absolute, True), speed
        else:
            yield book.line(case, UNIT, beside, absolute, True), speed


def _speed(summary: Mapping[str, Any]) -> float:
    return float(summary["timing"]["times_real_time"])


def basilisk_speed(book: Book, duration_s: int) -> float | None:
    """Times real time; None and a note where it is not installed."""
    scenario = flights.scenario("pd")
    try:
        satellite = Satellite(parameters_of(scenario), scenario.plant.step_s, GAINS, scenario.period_s)
    except Unavailable as error:
        book.note(str(error))
        return None
    return duration_s / satellite.run(duration_s)
