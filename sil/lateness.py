"""Why a tick woke up late: own work, garbage collection, the log's write, an answer that came, or the machine.

Only a paced loop keeps this account. It costs a few clock reads a tick and decides nothing.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any, NamedTuple, ParamSpec

import numpy as np
import numpy.typing as npt

P = ParamSpec("P")
HISTOGRAM_EDGES_us = tuple(digit * 10**power for power in range(7) for digit in (1, 2, 5))


class Cause(IntEnum):
    """What took most of the time that a tick was late by."""

    NONE = 0  # on time, or not paced
    MACHINE = 1  # asleep or stopped: the kernel woke the process late, or gave the CPU to another one
    OWN_WORK = 2  # the tick before computed too long
    GARBAGE_COLLECTION = 3  # of Python
    LOG_WRITE = 4  # the journal's write to the kernel
    LATE_ANSWER = 5  # a frame that came just before the deadline was being taken
    LINK_WRITE = 6  # the link took no more: its other end does not read


class Wake(NamedTuple):
    """The account of one wake-up, in ns: how late, why, and what the tick before took of the laboratory's time."""

    late_ns: int
    cause: Cause
    work_ns: int  # CPU time of the tick before
    gc_ns: int
    log_ns: int


QUIET = Wake(0, Cause.NONE, 0, 0, 0)


class Account:
    """Follows one loop: `listening(...)` around each wait for frames, `call(...)` of what may block, `woke(...)`.

    Time in which the tick neither computed nor was in a call that is known to block was taken by the machine.
    """

    def __init__(
        self, now: Callable[[], int] = time.monotonic_ns, cpu_now: Callable[[], int] = time.thread_time_ns
    ) -> None:
        self._now, self._cpu_now = now, cpu_now
        self._woke_ns = self._woke_cpu_ns = 0  # when the tick under way began
        self._slept_ns = self._work_ns = 0  # when it was over, and the CPU time it took
        self._listened_ns = self._listened_cpu_ns = 0  # end of the last wait for frames, and its CPU time
        self._listened_gc_ns = self._gc_began_ns = self._gc_ns = 0
        self._in_call_ns = dict.fromkeys((Cause.LOG_WRITE, Cause.LINK_WRITE, Cause.OWN_WORK), 0)
        self._before = QUIET

    def __enter__(self) -> Account:
        gc.callbacks.append(self._collecting)
        return self

    def __exit__(self, *_: object) -> None:
        gc.callbacks.remove(self._collecting)

    def _collecting(self, phase: str, _: dict[str, Any]) -> None:
        if phase == "start":
            self._gc_began_ns = self._now()
        else:
            self._gc_ns += self._now() - self._gc_began_ns

    def call(self, cause: Cause, function: Callable[P, object], *arguments: P.args, **named: P.kwargs) -> None:
        """function(*arguments); the time in it, also where it waits, is `cause`'s: LOG_WRITE, LINK_WRITE, OWN_WORK."""
        began = self._now()
        function(*arguments, **named)
        self._in_call_ns[cause] += self._now() - began

    def rebased(self) -> None:
        """The epoch moved: the lateness of this tick is forgiven, and explains none that comes after."""
        self._before = QUIET

    def sleeps(self) -> None:
        """The tick's work is over; what follows is waiting."""
        self._slept_ns = self._listened_ns = self._now()
        self._work_ns = self._cpu_now() - self._woke_cpu_ns
        self._listened_cpu_ns = 0

    def listening(self, listen: Callable[[float], None]) -> Callable[[float], None]:
        """The same wait for frames, with an eye on when it ended and what it computed."""

        def watched(timeout_s: float) -> None:
            began, gc_ns = self._cpu_now(), self._gc_ns
            listen(timeout_s)
            self._listened_cpu_ns, self._listened_gc_ns = self._cpu_now() - began, self._gc_ns - gc_ns
            self._listened_ns = self._now()

        return watched

    def woke(self, late_ns: int) -> Wake:
        """The next tick begins `late_ns` after its deadline."""
        now = self._now()
        log_ns = self._in_call_ns[Cause.LOG_WRITE]
        wake = Wake(late_ns, self._cause(late_ns, now - late_ns), self._work_ns, self._gc_ns, log_ns)
        self._before, self._woke_ns, self._woke_cpu_ns = wake, now, self._cpu_now()
        self._gc_ns = 0
        for each in self._in_call_ns:
            self._in_call_ns[each] = 0
        return wake

    def _cause(self, late_ns: int, deadline_ns: int) -> Cause:
        if late_ns <= 0:
            return Cause.NONE
        if self._slept_ns <= deadline_ns:
            return self._cause_of_waiting(self._listened_ns - deadline_ns)
        over_ns = self._slept_ns - deadline_ns
        if self._before.late_ns >= over_ns:
            return self._before.cause  # the tick before began late, and did nothing else wrong
        in_call = self._in_call_ns
        away_ns = self._slept_ns - self._woke_ns - self._work_ns - sum(in_call.values())
        spent = {
            Cause.OWN_WORK: max(self._work_ns - self._gc_ns, in_call[Cause.OWN_WORK]),
            Cause.GARBAGE_COLLECTION: self._gc_ns,
            Cause.LOG_WRITE: in_call[Cause.LOG_WRITE],
            Cause.LINK_WRITE: in_call[Cause.LINK_WRITE],
            Cause.MACHINE: away_ns,
        }
        return max(spent, key=spent.__getitem__)

    def _cause_of_waiting(self, overran_ns: int) -> Cause:
        """The tick was over in time; the last wait for frames ended `overran_ns` after the deadline, or before it."""
        if overran_ns <= 0:
            return Cause.MACHINE
        if 2 * self._listened_gc_ns > overran_ns:
            return Cause.GARBAGE_COLLECTION
        return Cause.LATE_ANSWER if 2 * self._listened_cpu_ns > overran_ns else Cause.MACHINE


def of_run(
    lateness_ns: Sequence[int], caused: Sequence[int], period_ns: float, max_lateness_ms: float | None
) -> dict[str, Any]:
    """What summary.json says of a run's wake-ups; `period_ns` is one period on the wall.

    A tick is late beyond max_lateness_ms, or beyond a period (the epoch moves then), whichever is less. `causes` counts
    what stood behind the late ticks, and behind the latest hundredth of all ticks. All empty or 0 in lockstep.
    """
    late_ns, cause = np.asarray(lateness_ns, np.int64), np.asarray(caused, np.uint8)
    limit_ns = min(period_ns, math.inf if max_lateness_ms is None else max_lateness_ms * 1e6)
    late = late_ns > limit_ns
    latest = np.zeros(len(late_ns), bool)
    latest[np.argsort(late_ns, kind="stable")[len(late_ns) - -(-len(late_ns) // 100) :]] = True
    return {
        "wakeup_us": percentiles_us(late_ns),
        "late_ticks": int(late.sum()),
        "late_fraction": float(late.mean()) if len(late) else 0.0,
        "late_beyond_ms": limit_ns * 1e-6 if math.isfinite(limit_ns) else None,
        "wakeup_histogram": histogram(late_ns),
        "causes": {"late_ticks": _counted(cause[late]), "latest_percent": _counted(cause[latest])},
    }


def percentiles_us(times_ns: Sequence[int] | npt.NDArray[np.int64]) -> dict[str, float | None]:
    """p50, p99, p99.9 and max of times in ns, as us; None where nothing was measured (lockstep has no wake-ups)."""
    names = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
    if not len(times_ns):
        return dict.fromkeys(names)
    values = np.percentile(np.asarray(times_ns) * 1e-3, list(names.values()))
    return {name: round(float(value), 3) for name, value in zip(names, values, strict=True)}


def histogram(lateness_ns: Sequence[int] | npt.NDArray[np.int64]) -> dict[str, list[int]]:
    """Counts of wake-ups by lateness: up to edges_us[0], up to edges_us[1], ..., and the last count beyond them all."""
    edges = np.array(HISTOGRAM_EDGES_us) * 1000
    counts = np.bincount(np.searchsorted(edges, np.asarray(lateness_ns, np.int64)), minlength=len(edges) + 1)
    return {"edges_us": list(HISTOGRAM_EDGES_us), "counts": counts.tolist()}


def _counted(cause: npt.NDArray[np.uint8]) -> dict[str, int]:
    return {each.name.lower(): int((cause == each).sum()) for each in Cause if each is not Cause.NONE}
