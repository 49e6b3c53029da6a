"""The controller process: python -m firmware_sim --link URL. Serves sessions until its link or its parent is gone."""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import gc
import os
import signal
import sys
import traceback
from typing import IO

PR_SET_PDEATHSIG, PR_SET_TIMERSLACK = 1, 29
MCL_CURRENT, MCL_FUTURE = 1, 2
EXIT_LINK = 3
EXIT_LAW = 4


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 stopped by the laboratory or by a signal, 2 bad arguments, 3 link failure, 4 the law raised."""
    options = _parser().parse_args(argv)
    if options.parent:
        _die_with(options.parent)
    stdout = _take_stdout()
    _settle_timers(options.lock_memory)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))

    from firmware_sim.board import Board
    from firmware_sim.hal import HostHal
    from protocol.links import LinkClosed, LinkError, open_link
    from protocol.port import Port

    user_law = None
    if options.law:
        from firmware_sim.controllers.user import LawFileError, load_user_law

        try:
            user_law = load_user_law(options.law)
        except LawFileError as error:
            return _fail(str(error), 2)
    try:
        link = open_link(options.link, listen=True)
    except LinkError as error:
        return _fail(str(error), EXIT_LINK)
    with contextlib.suppress(OSError), stdout:  # nobody has to read it
        print(f"listening {link.url}", file=stdout)
    port = Port(link)
    board = Board(port, HostHal(port), user_law, configured=_freeze)
    try:
        board.serve(once=options.once)
    except LinkClosed as error:
        return 0 if options.once or board.stopped else _fail(str(error), EXIT_LINK)
    except KeyboardInterrupt:
        return 0
    except Exception as error:
        # A law that raises ends the board, loudly: the traceback for its author, the last line for the laboratory.
        traceback.print_exc()
        return _fail(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}", EXIT_LAW)
    finally:
        port.close()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="firmware_sim",
        description="The controller of the testbed in its own process: the law, its own timer, nothing of the plant.",
        epilog="examples: --link serial:///dev/pts/7   --link udp://127.0.0.1:5005   --link udp://0.0.0.0:5005",
    )
    parser.add_argument(
        "--link", required=True, metavar="URL", help="serial://PATH[?baud=N] or udp://HOST:PORT to listen on"
    )
    parser.add_argument("--law", metavar="FILE.py:CLASS", help="a law of your own, as the scenario names it")
    parser.add_argument(
        "--once", action="store_true", help="exit after the first session (default: serve until stopped)"
    )
    parser.add_argument("--lock-memory", action="store_true", help="mlockall: no page of this process is swapped out")
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    return parser


def _take_stdout() -> IO[str]:
    """Standard output for its one line, "listening URL"; file descriptor 1 is standard error from here on.

    So a law may print, while it is loaded and in flight: its text comes before no "listening", and fills no pipe that
    nobody reads after that line. A stream that was closed takes what is written and forgets it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one
    stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return stdout


def _die_with(parent: int) -> None:
    """Die with the parent, whatever killed it: the kernel sees to it on Linux, elsewhere the end of the link."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    except (OSError, AttributeError):
        return
    if os.getppid() != parent:
        sys.exit(0)


def _settle_timers(lock_memory: bool) -> None:
    """Timers without Linux's 50 us of permitted lateness; memory locked if asked for. Refusals are no failure."""
    libc = ctypes.CDLL(None, use_errno=True)
    with contextlib.suppress(OSError, AttributeError):
        libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        if lock_memory and libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
            print(f"mlockall refused: {os.strerror(ctypes.get_errno())}", file=sys.stderr)


def _freeze() -> None:
    """What is there once a law is configured stays: the garbage collector need not look at it in flight."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def _fail(line: str, code: int) -> int:
    print(line, file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
