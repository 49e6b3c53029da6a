"""Lockstep cost per tick against a bare ping-pong of the same frame sizes over the same kind of pty, interleaved.

    python -m tools.bench.lockstep [--repeats 5] [--scenario appc-rs232] [--json]

A: a whole `sil run` in lockstep over a pty (both processes, plant, law, journal), its wall time divided by its ticks.
B: a child that answers N bytes with M bytes by os.read and os.write alone, median of the exchanges. Both processes of
either are placed by the kernel. Trust the ratio, not the absolute figures: they are the machine's.
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
import time
import tty
from pathlib import Path

import sil
from protocol.frames import Type
from sil.runs import Run

EXTRA = 3  # COBS and the two zeros
WARM_UP = 100

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


def ping_pong_us(up: int, down: int, exchanges: int) -> float:
    """Median of one exchange, up bytes there and down bytes back, in us."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    child = subprocess.Popen([sys.executable, "-c", CHILD, os.ttyname(slave), str(up), str(down)])
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
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        run = one_run(options.scenario, Path(folder) / "warm")
        up, down = frame_sizes(run)
        for repeat in range(options.repeats):
            run = one_run(options.scenario, Path(folder) / str(repeat))
            timing = run.summary["timing"]
            ours = timing["wall_s"] / run.summary["ticks"] * 1e6
            rows.append((ours, ping_pong_us(up, down, len(run)), timing["times_real_time"], timing["seal_s"]))
    ratios = [ours / bare for ours, bare, _, _ in rows]
    result = {
        "scenario": options.scenario,
        "bytes_up": up,
        "bytes_down": down,
        "ratio_median": statistics.median(ratios),
        "ratio_spread": [min(ratios), max(ratios)],
        "tick_us_median": statistics.median(row[0] for row in rows),
        "ping_pong_us_median": statistics.median(row[1] for row in rows),
        "times_real_time_median": statistics.median(row[2] for row in rows),
        "seal_s_median": statistics.median(row[3] for row in rows),
    }
    if options.json:
        print(json.dumps(result, indent=2))
        return
    print(f"{options.scenario}: {up} bytes up, {down} bytes down per tick, {options.repeats} repeats, interleaved")
    print(f"{'':14}{'sil us/tick':>12}{'ping-pong us':>14}{'ratio':>8}{'x real time':>13}")
    for number, (ours, bare, speed, _) in enumerate(rows):
        print(f"repeat {number:<7}{ours:12.1f}{bare:14.1f}{ours / bare:8.2f}{speed:13,.0f}")
    print(f"median        {result['tick_us_median']:12.1f}{result['ping_pong_us_median']:14.1f}", end="")
    print(f"{result['ratio_median']:8.2f}{result['times_real_time_median']:13,.0f}")


if __name__ == "__main__":
    main()
