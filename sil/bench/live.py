"""Bench `live`: how late the ticks of a run wake up that nobody looks at, that a viewer looks at, that one is stuck on.

without  a whole `sil run` in real time over a pty with law pd
viewer   the same with `--live`, and a process on this machine that subscribes to every topic and reads (a browser that
         draws it takes far more of the machine than that)
stuck    the same, and the process never reads

Each repeat runs the three one after the other, in turn beginning with another one. No CPUs, no priority: as a user
starts it. The run starts when the viewer has subscribed.
"""

from __future__ import annotations

import importlib.util
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sil.bench import flights
from sil.bench.book import Book, Plan
from sil.bench.children import end
from sil.bench.series import Unavailable
from sil.bench.wakers import percentiles
from sil.bench.wakeup import Pace, pool, scenario_file
from sil.launched import child_environment

WITHOUT, VIEWER, STUCK = "without", "with a viewer", "with a stuck viewer"
BEHAVES = {VIEWER: "reads", STUCK: "stuck"}
WAITS_S = 60  # for the viewer
START_S = 3.0  # of a `sil run`, its board, its view and the viewer
PACES = (Pace(100, 0.01, "realtime", 8.0, 3.0), Pace(1000, 0.01, "scaled:10", 8.0, 2.0))
NEEDS = "foxglove-sdk is not installed: pip install 'attitude-sil[live]'"


class LiveView:
    """The bench `live`."""

    about = "wake-ups of a run in real time over a pty with a viewer, and with one that is stuck, beside without"

    def expected_s(self, plan: Plan) -> float:
        return plan.repeats * sum(3 * (pace.ticks(plan) / pace.rate_hz + START_S) for pace in PACES)

    def measure(self, plan: Plan, book: Book) -> None:
        if importlib.util.find_spec("foxglove") is None:
            raise Unavailable(NEEDS)
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as name:
            for repeat in range(plan.repeats):
                for pace in PACES:
                    what = f"{pace.rate_hz} Hz, repeat {repeat + 1} of {plan.repeats}"
                    with flights.left_out(book, what):
                        _one_round(plan, book, pace, repeat, what, Path(name) / f"{pace.rate_hz}-{repeat}")


def _one_round(plan: Plan, book: Book, pace: Pace, repeat: int, what: str, folder: Path) -> None:
    """The three runs, then a line per percentile and viewer."""
    file = scenario_file(folder, pace.period_s, pace.ticks(plan))
    cases = (WITHOUT, VIEWER, STUCK)
    late_us: dict[str, list[float]] = {}
    for case in (*cases[repeat % 3 :], *cases[: repeat % 3]):
        plan.doing(f"live: sil run {case}, {what}")
        late_us[case] = _flown(book, file, folder, pace, plan, case)
    if len(set(_shas(book)[-3:])) > 1:
        book.note(f"{what}: run.mcap differs (not reproducible: {_missed(book)} of 3 runs missed the clock)")
    for case in (VIEWER, STUCK):
        ours, beside = percentiles(late_us[case]), percentiles(late_us[WITHOUT])
        for name in ours:
            book.line(f"{pace.rate_hz} Hz {case}, {name}", "us", WITHOUT).add(ours[name], beside[name])
    for case in cases:
        pool(book, f"{pace.rate_hz} Hz {case}", late_us[case])


def _flown(book: Book, file: Path, folder: Path, pace: Pace, plan: Plan, case: str) -> list[float]:
    """Lateness of every tick after the first, us."""
    port = _free_port()
    shown = ("--live-at", f"127.0.0.1:{port}", "--live-wait", str(WAITS_S)) if case in BEHAVES else ()
    with _onlooker(port, case):
        run = flights.paced(
            file, folder / case.replace(" ", "-"), [f"clock.mode={pace.clock}"], pace.ticks(plan) / pace.rate_hz, shown
        )
    summary = run.summary
    told = {"reproducible": summary["reproducible"], "sha256": summary["sha256"], "live": summary.get("live")}
    book.details.setdefault("runs", []).append({"case": f"{pace.rate_hz} Hz {case}", **told})
    if case in BEHAVES and not summary["live"].get("viewers"):
        book.note(f"{pace.rate_hz} Hz {case}: no viewer came, the figures are those of a view that nobody looks at")
    return run.lateness_us[1:]


def _missed(book: Book) -> int:
    """How many of the last three runs say that they are not reproducible."""
    return sum(not run["reproducible"] for run in book.details["runs"][-3:])


def _shas(book: Book) -> list[str]:
    """Of the run.mcap of every run so far."""
    return [run["sha256"] for run in book.details["runs"]]


@contextmanager
def _onlooker(port: int, case: str) -> Iterator[None]:
    """A process that looks on; nobody, without."""
    if case not in BEHAVES:
        yield
        return
    command = [sys.executable, "-P", "-m", "sil.bench.onlooker", str(port), BEHAVES[case]]
    child = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=child_environment(), start_new_session=True
    )
    try:
        yield
    finally:
        end(child)


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])
