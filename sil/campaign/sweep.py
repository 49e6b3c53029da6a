"""A sweep from its plan to its tables: START HERE. Points go to workers, records come back, whoever finishes first.

What stands in the tables depends on the plan alone: not on the number of workers, on their order, nor on how often the
sweep was interrupted.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sil.campaign import provenance, results
from sil.campaign.conditions import Conditions
from sil.campaign.plan import Point, make_plan, sets_of
from sil.campaign.pool import Order, Pool
from sil.campaign.records import FLOWN, Record, refused
from sil.campaign.results import RUNS, Results
from sil.runner import new_run_dir, next_run_dir
from sil.scenario import Scenario, load_values
from sil.stopping import StopRequests
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, SilError, UsageError

POLL_S = 0.1
MOST_WORKERS = 256
UNFINISHED = ".new"  # ending of the directory of a run that is under way


class SweepWatch:
    """What a sweep shows of itself while it goes on; this one shows nothing."""

    def planning(self, points: int, of: int) -> None:
        """So many points (or draws) were held against the scenario."""

    def begin(self, name: str, points: int, workers: int) -> None:
        """So many points are going to be flown."""

    def record(self, record: Record) -> None:
        """A point is finished."""

    def note(self, line: str) -> None:
        """Something that somebody should know now; on stderr, whatever else is shown."""
        print(line, file=sys.stderr, flush=True)

    def wait(self) -> None:
        """Called ten times a second."""

    def end(self) -> None:
        """No more points."""


def new_sweep(
    scenario: Scenario,
    conditions: Conditions,
    out: Path | None,
    watch: SweepWatch | None = None,
    wanted: Callable[[dict[str, Any]], bool] = lambda cell: True,
    name: str | None = None,
) -> Results:
    """Plan a sweep and write the plan; raises UsageError before anything is written.

    out: None: sweeps/NAME-NNN, NAME the scenario's unless said. wanted: whether a cell of the grid is flown.
    """
    plan = make_plan(scenario, conditions, (watch or SweepWatch()).planning, wanted)
    directory = new_run_dir(plan.name, out)[0] if out is not None else next_run_dir(Path("sweeps"), name or plan.name)
    opened = results.create(directory, plan)
    for point in plan.points:
        if point.refused:
            opened.add(refused(point.number, point.refused))
    return opened


def old_sweep(directory: Path, retry_failed: bool = False) -> Results:
    """A sweep that was begun; raises UsageError where what is here now would not give the results it began with."""
    opened = results.reopen(directory)
    try:
        plan = opened.plan
        scenario = load_values(plan.scenario, (), f"{directory}/{results.PLAN}", Path(plan.directory))
        provenance.refuse_changed(plan.provenance, scenario, f"--resume {directory}")
        if retry_failed:
            opened.forget_failed()
        for point in plan.points:
            if point.refused and point.number not in opened.records:
                opened.add(refused(point.number, point.refused))
    except BaseException:
        opened.close()
        raise
    return opened


def fly(
    opened: Results, workers: int | None, keep: str, watch: SweepWatch, again: Sequence[int] = ()
) -> dict[str, Any]:
    """Fly what is not finished, write the tables; returns the summary with `interrupted`, `wall_s`, `sweep_dir`.

    workers: None: one for each CPU, one alone where the clock is not lockstep. keep: none, on-fail or all. SIGINT and
    SIGTERM end the sweep: runs under way are dropped, finished points stay. again: these points only, finished or not.
    """
    began = time.monotonic()
    waiting = _chosen(opened, again) if again else [p for p in opened.plan.points if p.number not in opened.records]
    count = min(workers or default_workers(opened.plan.scenario), max(1, len(waiting)))
    _clear(opened.directory)
    watch.begin(opened.plan.name, len(waiting), count)
    interrupted = False
    try:
        with StopRequests() as stop:
            stop.hold()
            try:
                interrupted = _fly(opened, waiting, count, keep, watch, stop)
            except Exception:
                with contextlib.suppress(SilError):  # what stopped the sweep is what is told
                    opened.finish()
                raise
            summary = opened.finish()
    finally:
        watch.end()
        _clear(opened.directory)
        opened.close()
    if interrupted:
        summary["exit_code"] = EXIT_INTERRUPTED
    wall_s = time.monotonic() - began
    return {
        **summary,
        "interrupted": interrupted,
        "wall_s": wall_s,
        "workers": count,
        "sweep_dir": str(opened.directory),
    }


def _chosen(opened: Results, numbers: Sequence[int]) -> list[Point]:
    """Points that are to be flown whether they are finished or not; they keep their records until they are."""
    points = opened.plan.points
    for number in numbers:
        if not 1 <= number <= len(points):
            raise UsageError(f"--again: expected a point from 1 to {len(points)}, got {number}")
        if points[number - 1].refused:
            raise UsageError(f"--again: expected a point that can be flown, got {number}: {points[number - 1].refused}")
    return [points[number - 1] for number in sorted(set(numbers))]


def _fly(
    opened: Results, waiting: Sequence[Point], count: int, keep: str, watch: SweepWatch, stop: StopRequests
) -> bool:
    """True if somebody wanted the sweep to end before its last point."""
    setup = {"scenario": opened.plan.scenario, "directory": opened.plan.directory}
    orders = iter([_order(point, opened.directory, keep) for point in waiting])
    following = next(orders, None)
    with Pool(setup, count, opened.directory / results.LOG, watch.note) as pool:
        while not stop.asked():
            while following is not None and pool.submit(following):
                following = next(orders, None)
            if following is None and not pool.busy():
                return False
            for record in pool.poll(POLL_S):
                if stop.asked() and record.exit_code == EXIT_LINK:
                    continue  # what ends us may have ended the worker too: to be flown when the sweep goes on
                _put_in_place(opened.directory, record)
                opened.add(record)
                watch.record(record)
            watch.wait()
    return True


def default_workers(scenario: dict[str, Any]) -> int:
    """One for each CPU we may use; runs against the wall clock would make each other late, so they go one by one."""
    lockstep = scenario["clock"]["mode"] == "lockstep"
    return min(len(os.sched_getaffinity(0)), MOST_WORKERS) if lockstep else 1


def checked_workers(workers: int | None) -> int | None:
    """Raises UsageError for a number of workers nobody can mean."""
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise UsageError(f"-j: expected a number of workers from 1 to {MOST_WORKERS}, got {workers}")
    return workers


def _order(point: Point, directory: Path, keep: str) -> Order:
    folder = _folder(directory, point.number).with_suffix(UNFINISHED)
    return {"point": point.number, "sets": sets_of(point.values), "folder": str(folder.absolute()), "keep": keep}


def _folder(directory: Path, number: int) -> Path:
    return directory / RUNS / f"{number:04d}"


def _put_in_place(directory: Path, record: Record) -> None:
    """The run of a finished point takes the place of the one that was kept before; one that broke takes none."""
    folder = _folder(directory, record.point)
    if record.run_dir or record.exit_code in FLOWN:
        shutil.rmtree(folder, ignore_errors=True)
    if record.run_dir:
        folder.with_suffix(UNFINISHED).replace(folder)


def _clear(directory: Path) -> None:
    """Nothing is left of runs that did not finish."""
    runs = directory / RUNS
    for folder in runs.glob(f"*{UNFINISHED}"):
        shutil.rmtree(folder, ignore_errors=True)
    if runs.is_dir() and not any(runs.iterdir()):
        runs.rmdir()
