"""What wakes up beside us: cyclictest (Debian package rt-tests), else a small C loop that does the same.

Both sleep to absolute deadlines of CLOCK_MONOTONIC at a given interval, policy, priority and CPU, with 1 ns of timer
slack, and leave the machine's power management alone (cyclictest would switch it off for its own time only).
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Protocol

import numpy as np

from sil.bench.children import run_child
from sil.bench.series import Unavailable

NOTHING_THERE = "neither cyclictest (apt-get install rt-tests) nor a C compiler (cc) is here: nothing to compare with"
LONGEST_US = 1_000_000  # of cyclictest's histogram; later ones count as this late
SLACK_S = 30.0


class Waker(Protocol):
    """Measures wake-ups of a program that does nothing else."""

    name: str

    def lateness_us(self, interval_us: int, count: int, priority: int, cpu: int) -> list[float]:
        """How late each of `count` wake-ups was; priority 0 is ordinary scheduling. Raises ChildFailed."""


class Cyclictest:
    """cyclictest and its histogram, whole us."""

    name = "cyclictest"

    def lateness_us(self, interval_us: int, count: int, priority: int, cpu: int) -> list[float]:
        policy = ["--policy=fifo", f"--priority={priority}", "--mlockall"] if priority else ["--policy=other"]
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as folder:
            report = Path(folder) / "cyclictest.json"
            shape = [f"--loops={count}", f"--interval={interval_us}", f"--affinity={cpu}"]
            output = [f"--histogram={LONGEST_US}", f"--json={report}"]
            command = ["cyclictest", "--quiet", "--default-system", *shape, *policy, *output]
            run_child(command, count * interval_us * 1e-6 + SLACK_S)
            return of_histogram(report.read_text())


class Sleeper:
    """sleeper.c, compiled into a folder that goes with this object."""

    name = "C loop"

    def __init__(self, compiler: str) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="sil-bench-")
        self._program = str(Path(self._folder.name) / "sleeper")
        source = Path(self._folder.name) / "sleeper.c"
        source.write_text(files("sil.bench").joinpath("sleeper.c").read_text(encoding="utf-8"), encoding="utf-8")
        run_child([compiler, "-O2", "-o", self._program, str(source)], SLACK_S)

    def lateness_us(self, interval_us: int, count: int, priority: int, cpu: int) -> list[float]:
        numbers = [str(number) for number in (interval_us, count, priority, cpu)]
        said = run_child([self._program, *numbers], count * interval_us * 1e-6 + SLACK_S)
        return [float(line) for line in said.out.split()]


def find_waker() -> Waker:
    """The best there is on this machine. Raises Unavailable."""
    if shutil.which("cyclictest"):
        return Cyclictest()
    if compiler := shutil.which("cc"):
        return Sleeper(compiler)
    raise Unavailable(NOTHING_THERE)


def of_histogram(text: str) -> list[float]:
    """The wake-ups of cyclictest's JSON report, sorted, in us; those beyond the histogram as late as the latest."""
    thread = json.loads(text)["thread"]["0"]
    found = [float(us) for us, count in thread["histogram"].items() for _ in range(int(count))]
    beyond = int(thread["cycles"]) - len(found)
    return sorted(found) + [float(thread["max"])] * max(0, beyond)


def percentiles(values_us: Sequence[float]) -> dict[str, float]:
    """p50, p99, p99.9 and max."""
    names = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
    found = np.percentile(np.asarray(values_us), list(names.values()))
    return {name: round(float(value), 3) for name, value in zip(names, found, strict=True)}
