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
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from sil.scenario_sections import Clock
from sil.trouble import UsageError

MCL_CURRENT, MCL_FUTURE = 1, 2
PR_SET_TIMERSLACK, PR_GET_TIMERSLACK = 29, 30


class Granted(NamedTuple):
    """What the machine gave, and a line for each thing that it refused."""

    priority: int | None
    board_priority: int | None
    memory_locked: bool
    lab_cpu: int | None
    board_cpu: int | None
    refused: tuple[str, ...]


@contextmanager
def granted(clock: Clock, paced: bool, board_pid: int | None) -> Iterator[Granted]:
    """Ask for all that `clock` names, for this process and, where it is ours, the board's; give it back at the end.

    Called when everything is set up: compiling and loading need no priority. The board runs one below the laboratory,
    so that a law that never returns cannot keep the laboratory from noticing; it locks its own memory (`python -m
    firmware_sim --lock-memory`). A paced run's timers have no slack (1 ns for Linux's 50 us), and its garbage collector
    looks only at what the run itself makes. Raises UsageError as refuse_impossible() does.
    """
    refuse_impossible(clock)
    refused: list[str] = []
    with ExitStack() as undo:
        _timer_slack(paced, undo)
        lab_cpu = _cpu(0, clock.lab_cpu, "clock.lab_cpu", refused, undo)
        board_cpu = _cpu(board_pid, clock.board_cpu, "clock.board_cpu", refused, undo)
        locked = _lock_memory(refused, undo) if clock.locks_memory else False
        priority, below = _priorities(clock.priority, board_pid, refused, undo)
        if paced:
            _freeze(undo)
        yield Granted(priority, below, locked, lab_cpu, board_cpu, tuple(refused))


def refuse_impossible(clock: Clock) -> None:
    """UsageError for a CPU that this process may not use; said before anything is run."""
    for key, cpu in (("clock.lab_cpu", clock.lab_cpu), ("clock.board_cpu", clock.board_cpu)):
        usable = os.sched_getaffinity(0)
        if cpu is not None and cpu not in usable:
            known = ", ".join(map(str, sorted(usable)))
            raise UsageError(f"{key}: expected a CPU this process may use, got {cpu}; known: {known}")


def _timer_slack(paced: bool, undo: ExitStack) -> None:
    """Given back last: who comes back from SCHED_FIFO has the slack he was born with."""
    libc = ctypes.CDLL(None)
    undo.callback(libc.prctl, PR_SET_TIMERSLACK, libc.prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0), 0, 0, 0)
    if paced:
        libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def _freeze(undo: ExitStack) -> None:
    gc.collect()
    if not gc.get_freeze_count():  # else somebody has frozen before us, and it is theirs to undo
        undo.callback(gc.unfreeze)
    gc.freeze()


def _cpu(pid: int | None, cpu: int | None, key: str, refused: list[str], undo: ExitStack) -> int | None:
    if cpu is None:
        return None
    if pid is None:
        refused.append(f"{key}: the board is no process of this run's; use taskset where it is started")
        return None
    try:
        before = os.sched_getaffinity(pid)
        os.sched_setaffinity(pid, {cpu})
    except OSError as error:
        refused.append(f"{key}: refused ({error.strerror})")
        return None
    if pid == 0:
        undo.callback(os.sched_setaffinity, 0, before)
    return cpu


def _priorities(
    priority: int | None, board_pid: int | None, refused: list[str], undo: ExitStack
) -> tuple[int | None, int | None]:
    """SCHED_FIFO for this thread, and one less for the board. What either starts later runs at ordinary priority."""
    if priority is None or not _fifo(0, priority, refused, undo):
        return None, None
    below = priority - 1 or None  # 0 is no real-time priority: the board's stays ordinary
    if board_pid is None or below is None or not _fifo(board_pid, below, refused, undo):
        return priority, None
    return priority, below


def _fifo(pid: int, priority: int, refused: list[str], undo: ExitStack) -> bool:
    try:
        before, parameters = os.sched_getscheduler(pid), os.sched_getparam(pid)
        os.sched_setscheduler(pid, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        refused.append(
            f"clock.priority: SCHED_FIFO {priority} refused ({error.strerror}, RLIMIT_RTPRIO {limit}); "
            f"`sil doctor` says how to permit it"
        )
        return False
    if pid == 0:
        undo.callback(_ordinary, before, parameters)
    return True


def _ordinary(policy: int, parameters: os.sched_param) -> None:
    """The policy from before. Who may raise a priority need not be allowed to clear SCHED_RESET_ON_FORK: it stays."""
    try:
        os.sched_setscheduler(0, policy, parameters)
    except PermissionError:
        os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, parameters)


def may_lock_memory() -> bool:
    """No limit stands in the way, of this allocation or of a later one."""
    return os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY


def suspended_ns() -> int:
    """How long this machine has been asleep since it booted: CLOCK_MONOTONIC, which the deadlines use, stands still."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def _lock_memory(refused: list[str], undo: ExitStack) -> bool:
    """mlockall, but only where no limit can turn a later allocation into a failure."""
    locked_before = _locked_kB()
    if may_lock_memory() and ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        if not locked_before:
            undo.callback(ctypes.CDLL(None).munlockall)
        return True
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    refused.append(f"clock.lock_memory: refused (RLIMIT_MEMLOCK {limit} bytes); `sil doctor` says how to permit it")
    return False


def _locked_kB() -> int:
    """Memory this process has locked already."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("VmLck:")), 0)
