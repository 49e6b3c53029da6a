"""The C firmware as a board process of this machine: python -m sil.pil.native --link URL.

Over a serial port or a pty its main loop runs in C from start to end; over UDP the datagrams come and go through the
cable's own link, which knows whose they are.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import signal
import sys
from collections.abc import Callable

from protocol.link import WRITE_TIMEOUT_S
from protocol.links import Link, LinkError, open_link
from sil.pil.hosting import (
    EXIT_LINK,
    EXIT_USAGE,
    die_with,
    fail,
    say_listening,
    settle_timers,
    take_stdout,
    wake_pipe,
)
from sil.pil.library import HostLink, LibraryError, load, source_hash

STOPPED, INTERRUPTED, CLOSED, STUCK, FAILED = range(5)  # why host_serve() returned, as in firmware/hal/host/host.h
LINK_IS_CLOSED = ctypes.c_size_t(-1).value
MCL_CURRENT, MCL_FUTURE = 1, 2


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 stopped by the laboratory or by a signal, 2 bad arguments or no compiler, 3 link failure."""
    options = _parser().parse_args(argv)
    if options.parent:
        die_with(options.parent)
    stdout = take_stdout()
    settle_timers()
    if options.lock_memory:
        _lock_memory()
    try:
        library = load()
    except LibraryError as error:
        return fail(str(error), EXIT_USAGE)
    try:
        link = open_link(options.link, listen=True)
    except LinkError as error:
        return fail(str(error), EXIT_LINK)
    with link:
        trouble: list[str] = []
        served = _host_link(link, wake_pipe(signal.SIGTERM, signal.SIGINT), trouble)
        say_listening(stdout, link.url)
        why = library.host_serve(ctypes.byref(served), options.once)
        if why in (STOPPED, INTERRUPTED) or (why == CLOSED and (options.once or served.had_session)):
            return 0
        return fail(trouble[0] if trouble else _reason(link.url, why, served.error), EXIT_LINK)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sil.pil.native",
        description="The C firmware, compiled for this machine, as a board process.",
        epilog="examples: --link serial:///dev/pts/7   --link udp://127.0.0.1:5005   --link udp://0.0.0.0:5005",
    )
    parser.add_argument(
        "--link", required=True, metavar="URL", help="serial://PATH[?baud=N] or udp://HOST:PORT to listen on"
    )
    parser.add_argument(
        "--once", action="store_true", help="exit after the first session (default: serve until stopped)"
    )
    parser.add_argument("--lock-memory", action="store_true", help="mlockall: no page of this process is swapped out")
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    return parser


def _lock_memory() -> None:
    """A refusal is no failure."""
    libc = ctypes.CDLL(None, use_errno=True)
    with contextlib.suppress(AttributeError):
        if libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
            print(f"mlockall refused: {os.strerror(ctypes.get_errno())}", file=sys.stderr)


def _host_link(link: Link, stop_fd: int, trouble: list[str]) -> HostLink:
    """The link as the library wants it; what a callback raises goes to `trouble`."""
    build = f"fw native {source_hash()[:8]}".encode()
    made = HostLink(fd=link.fileno(), stop_fd=stop_fd, datagram=link.datagram, build=build)
    if link.datagram:
        made.read = HostLink.READ(_reader(link, trouble))
        made.write = HostLink.WRITE(_writer(link, trouble))
    return made


def _reader(link: Link, trouble: list[str]) -> Callable[[int, int, int], int]:
    def read(_: int, into: int, size: int) -> int:
        try:
            data = link.receive(0.0)[:size]
        except LinkError as error:
            trouble.append(str(error))
            return LINK_IS_CLOSED
        ctypes.memmove(into, data, len(data))
        return len(data)

    return read


def _writer(link: Link, trouble: list[str]) -> Callable[[int, int, int], bool]:
    def write(_: int, data: int, size: int) -> bool:
        try:
            link.send(ctypes.string_at(data, size))
        except LinkError as error:
            trouble.append(str(error))
            return False
        return True

    return write


def _reason(url: str, why: int, error: int) -> str:
    """One line, as protocol.link says it."""
    if why == STUCK:
        return f"{url}: the other end does not read: no room for an answer after {WRITE_TIMEOUT_S:g} s"
    if why == CLOSED:
        return f"{url}: the other end is gone ({os.strerror(error) if error else 'closed'})"
    return f"{url}: {os.strerror(error)}"


if __name__ == "__main__":
    sys.exit(main())
