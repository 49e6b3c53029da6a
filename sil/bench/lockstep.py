"""Bench `lockstep`: cost per tick against a bare ping-pong of the same frame sizes over the same kind of pty.

ours    a whole run in lockstep over a pty (both processes, plant, law appc, journal), wall time divided by ticks.
beside  a child that answers N bytes with M bytes by os.read and os.write alone, median of the exchanges.

Both pairs of processes are pinned alike, once to two CPUs (`split`: plant and board work at the same time) and once to
one (`same`): placement alone changes a bare exchange by a factor of three. Trust the ratio, not the absolute figures.
"""

from __future__ import annotations

import os
import pty
import statistics
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from protocol.frames import Type
from sil.bench import flights
from sil.bench.book import Book, Plan
from sil.bench.children import ChildFailed, cpus, end
from sil.runs import Run, open_run
from sil.scenario import Scenario

BESIDE = "bare ping-pong"
EXTRA = 3  # COBS and the two zeros
WARM_UP = 200

CHILD = """
import os, sys, tty
os.sched_setaffinity(0, {int(sys.argv[4])})
fd = int(sys.argv[1])
tty.setraw(fd)
asked, answer = int(sys.argv[2]), bytes(int(sys.argv[3]))
os.write(fd, b"!")
got = 0
while True:
    try:
        data = os.read(fd, 65536)
    except OSError:
        break
    if not data:  # hung up: sometimes that is an error, sometimes the end
        break
    got += len(data)
    while got >= asked:
        got -= asked
        os.write(fd, answer)
"""


class Lockstep:
    """The bench `lockstep`."""

    about = "a tick of a run in lockstep over a pty, beside a bare ping-pong of the same bytes"

    def expected_s(self, plan: Plan) -> float:
        return 4.0 + plan.repeats * len(placements()) * (1.7 if plan.quick else 4.0)

    def measure(self, plan: Plan, book: Book) -> None:
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as name:
            folder = Path(name)
            plan.doing("lockstep: the frames of a run")
            flights.recorded(scenario(plan), folder / "first")
            up, down = frame_sizes(open_run(folder / "first"))
            book.details |= {"bytes_up": up, "bytes_down": down}
            if len(placements()) == 1:
                book.note("one CPU only: nothing can be split")
            for repeat in plan.rounds("lockstep"):
                for placement, places in placements().items():
                    one_pair(plan, book, placement, places, folder / f"{placement}{repeat}", up, down)


def placements() -> dict[str, tuple[int, int]]:
    """(laboratory's, board's) CPU of each placement this machine can offer."""
    lab, board = cpus()
    return {"same CPU": (lab, lab)} if lab == board else {"two CPUs": (lab, board), "same CPU": (lab, lab)}


def scenario(plan: Plan, *keys: str) -> Scenario:
    """The run that is measured."""
    duration = ("duration_s=250",) if plan.quick else ()
    return flights.scenario("appc", *flights.OVER_PTY, *duration, *keys)


def one_pair(plan: Plan, book: Book, placement: str, places: tuple[int, int], folder: Path, up: int, down: int) -> None:
    """A run and as many bare exchanges, right after each other, on the same CPUs."""
    lab, board = places
    summary = flights.recorded(scenario(plan, f"clock.lab_cpu={lab}", f"clock.board_cpu={board}"), folder)
    ticks = summary["ticks"]
    with pinned(lab):
        bare_us = ping_pong_us(up, down, ticks, board)
    tick_us = summary["timing"]["wall_s"] / ticks * 1e6
    book.line(placement, "us/tick", BESIDE).add(tick_us, bare_us)
    book.details.setdefault(f"times_real_time, {placement}", []).append(summary["timing"]["times_real_time"])


@contextmanager
def pinned(cpu: int) -> Iterator[None]:
    """This process on one CPU, and afterwards where it was before."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {cpu})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def ping_pong_us(up: int, down: int, exchanges: int, childs_cpu: int) -> float:
    """Median of one exchange, up bytes there and down bytes back, in us. Raises ChildFailed."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    command = [sys.executable, "-c", CHILD, *map(str, (slave, up, down, childs_cpu))]
    child = subprocess.Popen(command, start_new_session=True, pass_fds=(slave,))
    os.close(slave)  # it is the child's alone now: when that dies, a read here fails instead of waiting for ever
    try:
        os.read(master, 1)
        request, times = bytes(up), []
        for _ in range(exchanges + WARM_UP):
            began = time.perf_counter_ns()
            os.write(master, request)
            got = 0
            while got < down:
                got += len(os.read(master, 65536))
            times.append(time.perf_counter_ns() - began)
    except OSError as error:
        raise ChildFailed(f"{BESIDE}: its other end is gone: {error.strerror}") from None
    finally:
        os.close(master)
        end(child)
    return statistics.median(times[WARM_UP:]) * 1e-3


def frame_sizes(run: Run) -> tuple[int, int]:
    """Bytes on the wire per tick of this run, up and down."""
    ticks = len(run)
    up = sum(len(p.packet) + EXTRA for p in run.packets if p.type == Type.SAMPLE)
    down = sum(len(p.packet) + EXTRA for p in run.packets if p.direction == "down")
    return round(up / ticks), round(down / ticks)
