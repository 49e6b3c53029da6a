"""The runs that benches measure: in this process without a log, or a whole `sil run` with everything a run leaves."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from protocol.frames import STOP_DONE
from sil.bench.book import Book
from sil.bench.children import ChildFailed, run_child, sil_command
from sil.launched import child_environment
from sil.rig import assemble
from sil.runner import run_scenario
from sil.scenario import Scenario, load_scenario
from sil.signals import Recorder
from sil.sinks.journal import JournalReader, Kind, read_timing

IN_PROCESS = ("clock=lockstep", "board=inproc", "link.url=inproc")
OVER_PTY = ("clock=lockstep", "board=process", "link.url=pty")
BUILT_IN = {"pd": "pd-root-locus", "mrac": "mrac-rs232", "appc": "appc-rs232"}
EXIT_CODES = (0, 1, 3)  # a benchmark measures runs whose requirements fail or whose timing is degraded, too
START_S = 60.0


def scenario(law: str, *keys: str) -> Scenario:
    """The built-in scenario of this law, with overrides."""
    return load_scenario(BUILT_IN[law], list(keys))


def unrecorded(of: Scenario, recorder: Recorder) -> tuple[int, float]:
    """(ticks, seconds of the loop alone) of a run in this process; rows go to `recorder`, no run directory is made."""
    rig = assemble(of, recorder, None, lambda line: None)
    try:
        began = time.perf_counter()
        ticks, _ = rig.loop.run(lambda: False, lambda tick, motion: None)
        return ticks, time.perf_counter() - began
    finally:
        rig.stop(STOP_DONE)


def recorded(of: Scenario, folder: Path) -> dict[str, Any]:
    """The summary of a run of this process into `folder`. A wish to end it (Ctrl-C) ends the series.

    Raises ChildFailed as whole() does.
    """
    summary = run_scenario(of, folder)
    if summary["reason"] == "interrupted":
        raise KeyboardInterrupt
    return whole(summary)


def whole(summary: dict[str, Any]) -> dict[str, Any]:
    """This summary. Raises ChildFailed if the run was cut short: few ticks have few misses, and that is no merit."""
    if summary["reason"] == "finished" and not summary["failure"]:
        return summary
    got = f"{summary['reason']} after {summary['ticks']} ticks"
    raise ChildFailed(": ".join(filter(None, (f"sil run: expected it to finish, got {got}", summary["failure"]))))


@contextmanager
def left_out(book: Book, what: str) -> Iterator[None]:
    """A repeat in which something failed is noted and has no figures; the next one can be measured all the same."""
    try:
        yield
    except ChildFailed as error:
        book.note(f"{what}, left out: {error}")


class Paced(NamedTuple):
    """A `sil run` with a clock: its summary, and how late each tick woke up, in us."""

    summary: dict[str, Any]
    lateness_us: list[float]


def paced(file: Path, folder: Path, keys: Sequence[str], wall_s: float, options: Sequence[str] = ()) -> Paced:
    """`sil run FILE` in a process of its own, as a user starts it. Raises ChildFailed, also for a run cut short."""
    sets = [part for key in keys for part in ("--set", key)]
    command = sil_command("run", str(file), "--out", str(folder), "--json", *sets, *options)
    said = run_child(command, wall_s + START_S, EXIT_CODES, child_environment())
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ChildFailed(f"sil run: {said.last_words}") from None
    return Paced(whole(summary), lateness_us(folder / "run.journal"))


def lateness_us(journal: Path) -> list[float]:
    """How late each tick of this log woke up, in us."""
    return [read_timing(record.payload)[0] * 1e-3 for record in JournalReader(journal) if record.kind == Kind.TIMING]
