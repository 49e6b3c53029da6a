"""Bench `recorder`: rows per second into the journal, and ticks per second of sealing it, beside the bytes alone.

Rows are those of a real run (law appc, fixed, its telemetry included), handed to the recorder as the loop hands them.
Beside it: the same bytes in as many writes to the same folder; for sealing, reading the journal's bytes and writing as
many as the two logs have, with the same fsync.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from sil.bench import flights
from sil.bench.book import Book, Plan
from sil.bench.tape import Tape
from sil.sinks.journal import Journal
from sil.sinks.recorder import JournalRecorder
from sil.sinks.seal import seal

LOGS = ("run.mcap", "timing.mcap")


class RecorderAndSeal:
    """The bench `recorder`."""

    about = "rows into run.journal, and run.mcap made of it, beside writing the same bytes"

    def expected_s(self, plan: Plan) -> float:
        return 2.0 + plan.repeats * (0.5 if plan.quick else 1.6)

    def measure(self, plan: Plan, book: Book) -> None:
        duration = f"duration_s={500 if plan.quick else 2000}"
        tape = Tape()
        ticks, _ = flights.unrecorded(flights.scenario("appc", *flights.IN_PROCESS, duration), tape)
        with tempfile.TemporaryDirectory(prefix="sil-bench-") as name:
            folder = Path(name)
            flights.recorded(flights.scenario("appc", *flights.IN_PROCESS, duration), folder / "run")
            for repeat in plan.rounds("recorder"):
                done = journal_rows(tape, folder / f"{repeat}")
                book.line("rows into run.journal", "rows/s", "same bytes, same writes", more=True).add(
                    len(tape.rows) / done.ours_s, len(tape.rows) / done.beside_s
                )
                sealed = sealing(folder / "run")
                book.line("sealing to run.mcap", "ticks/s", "same bytes copied", more=True).add(
                    ticks / sealed.ours_s, ticks / sealed.beside_s
                )
            book.details |= {"rows": len(tape.rows), "ticks": ticks, "journal_bytes": done.size}
            book.details["log_bytes"] = sealed.size


class Timed(NamedTuple):
    """Seconds of both, and the bytes they had in common."""

    ours_s: float
    beside_s: float
    size: int


def journal_rows(tape: Tape, folder: Path) -> Timed:
    """All rows of the tape into a journal, then its bytes in as many writes."""
    folder.mkdir()
    recorder = JournalRecorder(Journal(folder / "rows"))
    began = time.perf_counter()
    tape.play(recorder)
    ours_s = time.perf_counter() - began
    recorder.close()
    data = (folder / "rows").read_bytes()
    writes = sum(name == "commit" for name, _ in tape.rows)
    size = len(data) // writes
    file = os.open(folder / "bare", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        began = time.perf_counter()
        for at in range(0, len(data), size):
            os.write(file, data[at : at + size])
        return Timed(ours_s, time.perf_counter() - began, len(data))
    finally:
        os.close(file)


def sealing(folder: Path) -> Timed:
    """run.journal of this run directory to its logs again, then as many bytes read and written."""
    began = time.perf_counter()
    seal(folder)
    ours_s = time.perf_counter() - began
    sizes = [(folder / name).stat().st_size for name in LOGS]
    began = time.perf_counter()
    data = (folder / "run.journal").read_bytes()
    for size in sizes:
        with open(folder / "bare", "wb") as file:
            file.write(data[:size] if size <= len(data) else data + bytes(size - len(data)))
            file.flush()
            os.fsync(file.fileno())
    return Timed(ours_s, time.perf_counter() - began, sum(sizes))
