"""Bench `boards`: how many times faster than real time a run in lockstep is, with each board on the other end.

ours    law mrac at T_s 0.5 s, fixed, the log on disk: in this process, in a process of its own over a pty, the C
        firmware in a process (native), and its image on an emulated Cortex-M, every instruction of it (cortex-m).
beside  the Python board over the same pty, the same run: native is to be as fast, and the emulated one costs what it
        costs.

All boards give the same frames, so the laboratory's part of a tick is the same. Times are those of the loop alone: no
start, no sealing of the log.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from sil.bench import flights
from sil.bench.book import Book, Goal, Plan
from sil.trouble import SilError

UNIT = "x real time"
BESIDE = "process"
BOARDS = ("inproc", "process", "native", "cortex-m")
GOALS = {
    "native": Goal(1.0, at_most=False),
    "cortex-m": Goal(400.0, "ours", at_most=False),
}


class Boards:
    """The bench `boards`."""

    about = "a run in lockstep with each board, mrac at T_s 0.5 s, beside the Python board over a pty"

    def expected_s(self, plan: Plan) -> float:
        return 5.0 + plan.repeats * (8.0 if plan.quick else 14.0)

    def measure(self, plan: Plan, book: Book) -> None:
        duration_s = 300 if plan.quick else 1200
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as folder:
            for repeat in plan.rounds("boards"):
                speeds = {}
                for board in BOARDS:
                    try:
                        speeds[board] = _speed(board, duration_s, Path(folder) / f"{board}{repeat}")
                    except SilError as error:  # no compiler, no unicorn: the others can be measured all the same
                        book.note(f"board {board}, left out: {error}")
                _add(book, speeds)


def _speed(board: str, duration_s: int, folder: Path) -> float:
    """Times real time of one run. Raises SilError."""
    link = "inproc" if board == "inproc" else "pty"
    keys = ("clock=lockstep", f"board={board}", f"link.url={link}", "law.form=fixed", f"duration_s={duration_s}")
    summary = flights.recorded(flights.scenario("mrac", *keys), folder)
    return float(summary["timing"]["times_real_time"])


def _add(book: Book, speeds: dict[str, float]) -> None:
    """A repeat without the board beside has no ratios, and none of its figures count."""
    if BESIDE not in speeds:
        return
    for board, speed in speeds.items():
        if board != BESIDE:
            book.line(board, UNIT, BESIDE, GOALS.get(board), True).add(speed, speeds[BESIDE])
