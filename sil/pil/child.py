"""What every board process of this folder does before it serves: arguments, one line of output, an end with its parent."""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import signal
import sys
from typing import IO

PR_SET_PDEATHSIG, PR_SET_TIMERSLACK = 1, 29
MCL_CURRENT, MCL_FUTURE = 1, 2
EXIT_USAGE = 2
EXIT_LINK = 3


def parser(module: str, description: str) -> argparse.ArgumentParser:
    """The arguments that all of them have; a launcher gives --link, --once and --parent."""
    made = argparse.ArgumentParser(
        prog=f"python -m {module}",
        description=description,
        epilog="examples: --link serial:///dev/pts/7   --link udp://127.0.0.1:5005   --link udp://0.0.0.0:5005",
    )
    made.add_argument(
        "--link", required=True, metavar="URL", help="serial://PATH[?baud=N] or udp://HOST:PORT to listen on"
    )
    made.add_argument("--once", action="store_true", help="exit after the first session (default: serve until stopped)")
    made.add_argument("--lock-memory", action="store_true", help="mlockall: no page of this process is swapped out")
    made.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    return made


def settle(options: argparse.Namespace) -> IO[str]:
    """Die with the parent, keep time, and take standard output, which is returned for the one line "listening URL"."""
    if options.parent:
        _die_with(options.parent)
    stdout = _take_stdout()
    _settle_timers(options.lock_memory)
    return stdout


def listening(stdout: IO[str], url: str) -> None:
    """Say where the board listens, and no more; nobody has to read it."""
    with contextlib.suppress(OSError), stdout:
        print(f"listening {url}", file=stdout)


def fail(line: str, code: int) -> int:
    """The last line of standard error is what the laboratory shows."""
    print(line, file=sys.stderr, flush=True)
    return code


def _die_with(parent: int) -> None:
    """Die with the parent, whatever killed it: the kernel sees to it on Linux, elsewhere the end of the link."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    except (OSError, AttributeError):
        return
    if os.getppid() != parent:
        sys.exit(0)


def _take_stdout() -> IO[str]:
    """Standard output for its one line; file descriptor 1 is standard error from here on, and fills no pipe that nobody
    reads after that line. A stream that was closed takes what is written and forgets it."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one
    stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return stdout


def _settle_timers(lock_memory: bool) -> None:
    """Timers without Linux's 50 us of permitted lateness; memory locked if asked for. Refusals are no failure."""
    libc = ctypes.CDLL(None, use_errno=True)
    with contextlib.suppress(OSError, AttributeError):
        libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        if lock_memory and libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
            print(f"mlockall refused: {os.strerror(ctypes.get_errno())}", file=sys.stderr)
