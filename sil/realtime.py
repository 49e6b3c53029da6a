"""What a paced run asks of the machine: a priority, memory that stays in RAM, a CPU of its own, a quiet collector.

Nothing here decides a byte of the log; it decides how late a tick wakes up. What the machine does not permit is not an
error: the run goes on and says what was refused, and its lateness speaks for itself.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from sil.scenario_sections import Clock
from sil.trouble import UsageError

MCL_CURRENT, MCL_FUTURE = 1, 2


class Granted(NamedTuple):
    """What the machine gave, and a line for each thing that it refused."""

    priority: int | None
    memory_locked: bool
    lab_cpu: int | None
    board_cpu: int | None
    refused: tuple[str, ...]


@contextmanager
def granted(clock: Clock, paced: bool, board_pid: int | None) -> Iterator[Granted]:
    """Ask for all that `clock` names, for this process and, where it is ours, the board's; give it back at the end.

    Called when everything is set up: compiling and loading need no priority. The board locks its own memory
    (`python -m firmware_sim --lock-memory`). A paced run's garbage collector looks only at what the run itself makes.
    Raises UsageError as refuse_impossible() does.
    """
    refuse_impossible(clock)
    refused: list[str] = []
    undo: list[Callable[[], None]] = []
    try:
        lab_cpu = _cpu(0, clock.lab_cpu, "clock.lab_cpu", refused, undo)
        board_cpu = _cpu(board_pid, clock.board_cpu, "clock.board_cpu", refused, undo)
        locked = _lock_memory(refused, undo) if clock.locks_memory else False
        priority = _priority(clock.priority, board_pid, refused, undo)
        if paced:
            gc.collect()
            gc.freeze()
            undo.append(gc.unfreeze)
        yield Granted(priority, locked, lab_cpu, board_cpu, tuple(refused))
    finally:
        for step in reversed(undo):
            step()


def refuse_impossible(clock: Clock) -> None:
    """UsageError for a CPU that this process may not use; said before anything is run."""
    for key, cpu in (("clock.lab_cpu", clock.lab_cpu), ("clock.board_cpu", clock.board_cpu)):
        usable = os.sched_getaffinity(0)
        if cpu is not None and cpu not in usable:
            known = ", ".join(map(str, sorted(usable)))
            raise UsageError(f"{key}: expected a CPU this process may use, got {cpu}; known: {known}")


def _cpu(pid: int | None, cpu: int | None, key: str, refused: list[str], undo: list[Callable[[], None]]) -> int | None:
    if cpu is None:
        return None
    if pid is None:
        refused.append(f"{key}: the board is no process of this run's; use taskset where it is started")
        return None
    before = os.sched_getaffinity(pid)
    os.sched_setaffinity(pid, {cpu})
    if pid == 0:
        undo.append(lambda: os.sched_setaffinity(0, before))
    return cpu


def _priority(
    priority: int | None, board_pid: int | None, refused: list[str], undo: list[Callable[[], None]]
) -> int | None:
    """SCHED_FIFO for this thread and for the board. What either starts later runs at ordinary priority again."""
    if priority is None:
        return None
    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    policy, wanted = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority)
    try:
        os.sched_setscheduler(0, policy, wanted)
        undo.append(lambda: os.sched_setscheduler(0, before, parameters))
        if board_pid is not None:
            os.sched_setscheduler(board_pid, policy, wanted)
    except OSError as error:
        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        refused.append(
            f"clock.priority: SCHED_FIFO {priority} refused ({error.strerror}, RLIMIT_RTPRIO {limit}); "
            f"`sil doctor` says how to permit it"
        )
        return None
    return priority


def may_lock_memory() -> bool:
    """No limit stands in the way, of this allocation or of a later one."""
    return os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY


def suspended_ns() -> int:
    """How long this machine has been asleep since it booted: CLOCK_MONOTONIC, which the deadlines use, stands still."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def _lock_memory(refused: list[str], undo: list[Callable[[], None]]) -> bool:
    """mlockall, but only where no limit can turn a later allocation into a failure."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    libc = ctypes.CDLL(None, use_errno=True)
    if may_lock_memory() and libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        undo.append(libc.munlockall)
        return True
    refused.append(f"clock.lock_memory: refused (RLIMIT_MEMLOCK {limit} bytes); `sil doctor` says how to permit it")
    return False
