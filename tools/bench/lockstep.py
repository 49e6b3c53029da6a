"""Lockstep cost per tick against a bare ping-pong of the same frame sizes over the same kind of pty, interleaved.

    python -m tools.bench.lockstep [--repeats 5] [--scenario appc-rs232] [--json]

A: a whole `sil run` in lockstep over a pty (both processes, plant, law, journal), its wall time divided by its ticks.
B: a child that answers N bytes with M bytes by os.read and os.write alone, median of the exchanges. Both pairs of
processes are pinned alike, once to two CPUs (`split`: plant and board work at the same time) and once to one (`same`):
placement alone changes a bare exchange by a factor of three. Trust the ratio, not the absolute figures: they are the
machine's.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty
from pathlib import Path

import sil
from protocol.frames import Type
from sil.runs import Run

EXTRA = 3  # COBS and the two zeros
WARM_UP = 200

CHILD = """
import os, sys, tty
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(fd)
asked, answer = int(sys.argv[2]), bytes(int(sys.argv[3]))
os.write(fd, b"!")
got = 0
while True:
    try:
        data = os.read(fd, 65536)
    except OSError:
        break
    got += len(data)
    while got >= asked:
        got -= asked
        os.write(fd, answer)
"""


PLACEMENTS = {"split": (0, 1), "same": (0, 0)}


class Placed:
    """While it lasts, this process runs on one CPU and every child it starts on another (or the same) one."""

    def __init__(self, placement: str) -> None:
        self._own, self._childs = PLACEMENTS[placement]
        self._over = threading.Event()

    def __enter__(self) -> Placed:
        self._before = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {self._own})
        self._thread = threading.Thread(target=self._pin_children, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        os.sched_setaffinity(0, self._before)

    def _pin_children(self) -> None:
        """Until a child is found; then the thread is gone and disturbs nothing."""
        children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
        while not self._over.wait(0.02):
            for pid in map(int, children.read_text().split()):
                os.sched_setaffinity(pid, {self._childs})
                return


def ping_pong_us(up: int, down: int, exchanges: int) -> float:
    """Median of one exchange, up bytes there and down bytes back, in us."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    child = subprocess.Popen([sys.executable, "-c", CHILD, os.ttyname(slave), str(up), str(down)])
    try:
        os.read(master, 1)
        time.sleep(0.05)  # until the child is on its CPU
        request, times = bytes(up), []
        for _ in range(exchanges + WARM_UP):
            began = time.perf_counter_ns()
            os.write(master, request)
            got = 0
            while got < down:
                got += len(os.read(master, 65536))
            times.append(time.perf_counter_ns() - began)
    finally:
        os.close(master)
        os.close(slave)
        child.wait()
    return statistics.median(times[WARM_UP:]) * 1e-3


def frame_sizes(run: Run) -> tuple[int, int]:
    """Bytes on the wire per tick of this run, up and down."""
    ticks = len(run)
    up = sum(len(p.packet) + EXTRA for p in run.packets if p.type == Type.SAMPLE)
    down = sum(len(p.packet) + EXTRA for p in run.packets if p.direction == "down")
    return round(up / ticks), round(down / ticks)


def one_run(scenario: str, folder: Path) -> Run:
    """The scenario in lockstep over a pty, recorded like any other run."""
    return sil.run(scenario, out=folder, clock="lockstep", board="process", **{"link.url": "pty"})


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--scenario", default="appc-rs232")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in PLACEMENTS}
    with tempfile.TemporaryDirectory() as folder:
        run = one_run(options.scenario, Path(folder) / "warm")
        up, down = frame_sizes(run)
        for repeat in range(options.repeats):
            for name in PLACEMENTS:
                rows[name].append(one_pair(options.scenario, Path(folder) / f"{name}{repeat}", name, up, down))
    results = {name: summary(pairs) for name, pairs in rows.items()}
    if options.json:
        print(json.dumps({"scenario": options.scenario, "bytes_up": up, "bytes_down": down, **results}, indent=2))
        return
    print(f"{options.scenario}: {up} bytes up, {down} bytes down per tick, {options.repeats} repeats, interleaved")
    for name, pairs in rows.items():
        print(f"\n{name:14}{'sil us/tick':>12}{'ping-pong us':>14}{'ratio':>8}{'x real time':>13}")
        for number, (ours, bare, speed, _) in enumerate(pairs):
            print(f"repeat {number:<7}{ours:12.1f}{bare:14.1f}{ours / bare:8.2f}{speed:13,.0f}")
        r = results[name]
        print(f"{'medians':14}{r['tick_us']:12.1f}{r['ping_pong_us']:14.1f}{r['ratio']:8.2f}{r['times_real_time']:13,.0f}")


def one_pair(scenario: str, folder: Path, placement: str, up: int, down: int) -> tuple[float, ...]:
    """(us per tick, us per bare exchange, times real time, seal time in s), one right after the other."""
    with Placed(placement):
        run = one_run(scenario, folder)
    timing = run.summary["timing"]
    with Placed(placement):
        bare_us = ping_pong_us(up, down, len(run))
    return timing["wall_s"] / run.summary["ticks"] * 1e6, bare_us, timing["times_real_time"], timing["seal_s"]


def summary(pairs: list[tuple[float, ...]]) -> dict[str, object]:
    """Medians, and the spread of the ratio."""
    ratios = [ours / bare for ours, bare, _, _ in pairs]
    names = ("tick_us", "ping_pong_us", "times_real_time", "seal_s")
    medians = {name: statistics.median(pair[i] for pair in pairs) for i, name in enumerate(names)}
    return {**medians, "ratio": statistics.median(ratios), "ratio_spread": [min(ratios), max(ratios)]}


if __name__ == "__main__":
    main()
