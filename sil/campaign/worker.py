"""A worker process of a sweep: `python -m sil.campaign.worker`. Orders come in as lines of JSON, records go out.

First line in: {"scenario", "directory"}; then one {"point", "sets", "folder", "keep"} for each point. First line out:
{"ready": true}; then a record for each. It ends when nothing more comes in, and it dies with its parent.
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
from typing import Any

from sil.campaign.records import Record, broken, record_of, refused
from sil.runner import run_scenario
from sil.scenario import load_values
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, SilError

PR_SET_PDEATHSIG = 1
KEEP = ("none", "on-fail", "all")


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
            record = fly(setup, json.loads(line))
            if record.exit_code == EXIT_INTERRUPTED:
                return
            print(record.line(), end="", file=records, flush=True)
    except (KeyboardInterrupt, BrokenPipeError):
        return  # the sweep is over


def fly(setup: dict[str, Any], order: dict[str, Any]) -> Record:
    """One point, from its values to its record; its run directory is deleted unless it is to be kept."""
    folder = Path(order["folder"])
    began = time.perf_counter()
    record = _flown(setup, order, folder)._replace(wall_s=round(time.perf_counter() - began, 6))
    failed = record.exit_code != 0 and record.exit_code != EXIT_INTERRUPTED
    if folder.exists() and (order["keep"] == "all" or (order["keep"] == "on-fail" and failed)):
        return record._replace(run_dir=f"{folder.parent.name}/{folder.name}")
    shutil.rmtree(folder, ignore_errors=True)
    return record


def _flown(setup: dict[str, Any], order: dict[str, Any], folder: Path) -> Record:
    point = int(order["point"])
    try:
        scenario = load_values(setup["scenario"], order["sets"], "scenario", Path(setup["directory"]))
        return record_of(point, run_scenario(scenario, folder), 0.0)
    except SilError as error:
        text = f"{error}"
        return broken(point, text) if error.exit_code == EXIT_LINK else refused(point, text)
    except Exception as error:  # a bug of a law or of ours: this point's, not the sweep's
        traceback.print_exc()
        return broken(point, f"{type(error).__name__}: {error} (see workers.log)")


def _die_with(parent: int) -> None:
    """SIGKILL for us when the parent dies, however it dies (Linux); it may be dead already."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


if __name__ == "__main__":
    main()
