"""What a board process does as such: it dies with its parent, says one line on standard output, and hears signals."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from typing import IO

PR_SET_PDEATHSIG, PR_SET_TIMERSLACK = 1, 29
EXIT_USAGE, EXIT_LINK, EXIT_BOARD = 2, 3, 4


def die_with(parent: int) -> None:
    """End with the parent, whatever killed it: the kernel sees to it on Linux, elsewhere the end of the link."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            sys.exit(0)


def settle_timers() -> None:
    """Waits without Linux's 50 us of permitted lateness. A refusal is no failure."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def take_stdout() -> IO[str]:
    """Standard output for its one line, "listening URL"; file descriptor 1 is standard error from here on."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one
    stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return stdout


def say_listening(stdout: IO[str], url: str) -> None:
    """The one line; nobody has to read it."""
    with contextlib.suppress(OSError), stdout:
        print(f"listening {url}", file=stdout)


def wake_pipe(*signals: int) -> int:
    """A descriptor that becomes readable when one of these signals comes; their numbers are the bytes read from it."""
    reader, writer = os.pipe()
    for fd in (reader, writer):
        os.set_blocking(fd, False)
    for number in signals:
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    return reader


def fail(line: str, code: int) -> int:
    """One line for a person, and the exit code."""
    print(line, file=sys.stderr)
    return code
