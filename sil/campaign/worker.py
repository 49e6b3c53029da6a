"""A worker process of a sweep: `python -m sil.campaign.worker`. Orders come in as lines of JSON, records go out.

First line in: {"scenario", "directory"}; then one {"point", "sets", "folder", "keep"} for each point. First line out:
{"ready": true}; then a record for each, and before it {"alive": true} about once a second while ticks go by, and
{"sealing": TICKS} when they are over. It ends when nothing more comes in, and it dies with its parent.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any, TextIO

from sil.campaign.records import Record, broken, record_of, refused
from sil.runner import run_scenario
from sil.scenario import load_values
from sil.signals import Motion
from sil.sinks.journal import JournalError
from sil.trouble import EXIT_INTERRUPTED, SilError, UsageError
from sil.watch import Watch

PR_SET_PDEATHSIG = 1
ALIVE_EVERY_S = 1.0
STOPPED = "KeyboardInterrupt: the law raised it, or somebody told the worker to stop"


def main() -> None:
    """Serve one sweep. What a law prints goes to standard error: standard output is for records."""
    _die_with(int(sys.argv[1]))
    faulthandler.enable()
    records = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    try:
        setup = json.loads(sys.stdin.readline() or "null")
        print(json.dumps({"ready": True}), file=records, flush=True)
        while line := sys.stdin.readline():
            record = fly(setup, json.loads(line), Alive(records))
            print(record.line(), end="", file=records, flush=True)
    except (KeyboardInterrupt, BrokenPipeError):
        return  # the sweep is over


class Alive(Watch):
    """Says on `out` that ticks go by, so that a worker that hangs or was stopped is told apart from one that works."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._said_s = out, time.monotonic()
        self._ticks = 0  # that have gone by

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        self._ticks = tick + 1
        if time.monotonic() - self._said_s >= ALIVE_EVERY_S:
            self._say({"alive": True})

    def stage(self, name: str) -> None:
        self._say({"sealing": self._ticks} if name == "seal" else {"alive": True})

    def _say(self, what: dict[str, Any]) -> None:
        self._said_s = time.monotonic()
        print(json.dumps(what), file=self._out, flush=True)


def fly(setup: dict[str, Any], order: dict[str, Any], watch: Watch | None = None) -> Record:
    """One point, from its values to its record; its run directory is deleted unless it is to be kept.

    The order's folder ends with .new; the sweep takes that away once the record has arrived.
    """
    folder = Path(order["folder"])
    began = time.perf_counter()
    record = _flown(setup, order, folder, watch)
    reason = record.reason.replace(str(folder), "run directory")  # tables do not depend on where the sweep lies
    record = record._replace(reason=reason, wall_s=round(time.perf_counter() - began, 6))
    if folder.exists() and (order["keep"] == "all" or (order["keep"] == "on-fail" and record.exit_code != 0)):
        try:
            _say_where(folder, folder.with_suffix(""))
        except (OSError, ValueError) as error:
            print(f"{folder}: summary.json says no run_dir that will be: {error}", file=sys.stderr)
        return record._replace(run_dir=f"{folder.parent.name}/{folder.stem}")
    shutil.rmtree(folder, ignore_errors=True)
    return record


def _flown(setup: dict[str, Any], order: dict[str, Any], folder: Path, watch: Watch | None) -> Record:
    point = int(order["point"])
    try:
        scenario = load_values(setup["scenario"], order["sets"], "scenario", Path(setup["directory"]))
        summary = run_scenario(scenario, folder, watch)
        return broken(point, STOPPED) if summary["exit_code"] == EXIT_INTERRUPTED else record_of(point, summary, 0.0)
    except KeyboardInterrupt:
        return broken(point, STOPPED)
    except UsageError as error:
        return broken(point, f"{error}") if _machine_said_no(error) else refused(point, f"{error}")
    except SilError as error:
        return broken(point, f"{error}")
    except Exception as error:  # a bug of a law or of ours: this point's, not the sweep's
        traceback.print_exc()
        return broken(point, f"{type(error).__name__}: {error} (see workers.log)")


def _machine_said_no(error: BaseException) -> bool:
    """Whether a UsageError only tells of a disk that is full or the like: another time the point may fly."""
    cause = error.__cause__ or error.__context__
    return cause is not None and (isinstance(cause, OSError | JournalError) or _machine_said_no(cause))


def _say_where(folder: Path, final: Path) -> None:
    """summary.json of a kept run names the directory the run is going to have."""
    file = folder / "summary.json"
    if file.exists():
        summary = json.loads(file.read_text(encoding="utf-8")) | {"run_dir": str(final)}
        file.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _die_with(parent: int) -> None:
    """SIGKILL for us when the parent dies, however it dies (Linux); it may be dead already."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


if __name__ == "__main__":
    main()
