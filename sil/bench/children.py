"""Starts the programs that are measured: no orphan is left whatever happens to us, and Ctrl-C is ours to handle."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sil.trouble import SilError

PR_SET_PDEATHSIG, PR_SET_TIMERSLACK = 1, 29
ENDS_WITHIN_S = 5.0


class ChildFailed(SilError):
    """A program that is measured did not end well; one line."""


class Said(NamedTuple):
    """What a program printed, and its exit code."""

    out: str
    err: str
    code: int

    @property
    def last_words(self) -> str:
        """Why it ended, as far as it said so."""
        lines = [line.strip() for line in (self.err or self.out).splitlines() if line.strip()]
        return f"exit code {self.code}: {lines[-1] if lines else 'it said nothing'}"


def run_child(
    command: Sequence[str],
    timeout_s: float,
    good: Sequence[int] = (0,),
    environment: Mapping[str, str] | None = None,
) -> Said:
    """What `command` said; its exit code must be one of `good`. environment: None for ours.

    The child gets 1 ns of timer slack, like our own processes, and SIGTERM when this process dies. When the wait ends
    by an exception (Ctrl-C), the child is ended first. Raises ChildFailed.
    """
    _prctl(PR_SET_TIMERSLACK, 1)  # here: what a child has at its birth is what it falls back to after asking for FIFO
    try:
        child = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=environment,
            start_new_session=True,
            preexec_fn=_settle,
        )
    except OSError as error:
        raise ChildFailed(f"{command[0]}: {error.strerror or error}") from None
    finally:
        _prctl(PR_SET_TIMERSLACK, 0)  # the default again
    try:
        out, err = child.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise ChildFailed(f"{command[0]}: expected it to end within {timeout_s:g} s") from None
    finally:
        end(child)
    said = Said(out, err, child.returncode)
    if said.code not in good:
        raise ChildFailed(f"{command[0]}: {said.last_words}")
    return said


def sil_command(*arguments: str) -> list[str]:
    """`sil ARGUMENTS` of this installation."""
    return [sys.executable, "-P", "-c", "from sil.cli import main; main()", *arguments]


def _settle() -> None:
    """In the child, before it becomes the program."""
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _prctl(what: int, value: int) -> None:
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(what, int(value), 0, 0, 0)


def end(child: subprocess.Popen[Any]) -> None:
    """See to it that it is gone: asked first, killed then."""
    if child.poll() is None:
        child.terminate()
        try:
            child.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
    for stream in (child.stdout, child.stderr):
        if stream:
            stream.close()


def may_use_fifo(priority: int) -> bool:
    """Whether this machine lets us have SCHED_FIFO; asked by trying, and given back."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    os.sched_setscheduler(0, *before)
    return True


def cpus() -> tuple[int, int]:
    """(laboratory's, board's) CPU among those we may use; the same one where there is only one.

    The laboratory gets the last, since interrupts tend to go to the first.
    """
    allowed = sorted(os.sched_getaffinity(0))
    return allowed[-1], allowed[0]
