"""The C firmware as a board process of this machine: python -m sil.pil.native --link URL.

Over a serial port or a pty its main loop runs in C from start to end; over UDP the datagrams come and go through the
cable's own link, which knows whose they are.
"""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import sys
from collections.abc import Callable

from protocol.link import WRITE_TIMEOUT_S
from protocol.links import Link, LinkError, open_link
from sil.pil import child
from sil.pil.library import HostLink, LibraryError, load, source_hash

STOPPED, INTERRUPTED, CLOSED, STUCK, FAILED = range(5)  # why host_serve() returned, as in firmware/hal/host/host.h
LINK_IS_CLOSED = ctypes.c_size_t(-1).value


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 stopped by the laboratory or by a signal, 2 bad arguments or no compiler, 3 link failure."""
    options = child.parser("sil.pil.native", "The C firmware, compiled for this machine, as a board.").parse_args(argv)
    stdout = child.settle(options)
    try:
        library = load()
    except LibraryError as error:
        return child.fail(str(error), child.EXIT_USAGE)
    try:
        link = open_link(options.link, listen=True)
    except LinkError as error:
        return child.fail(str(error), child.EXIT_LINK)
    with link, _StopSignal() as stop:
        child.listening(stdout, link.url)
        trouble: list[str] = []
        served = _host_link(link, stop, trouble)
        why = library.host_serve(ctypes.byref(served), options.once)
        if why in (STOPPED, INTERRUPTED) or (why == CLOSED and (options.once or served.had_session)):
            return 0
        return child.fail(trouble[0] if trouble else _reason(options.link, why, served.error), child.EXIT_LINK)


class _StopSignal:
    """SIGTERM and SIGINT become a byte to read from `fileno()`, which the main loop in C waits for, too."""

    def __enter__(self) -> _StopSignal:
        self._read, self._write = socket.socketpair()
        self._write.setblocking(False)
        signal.set_wakeup_fd(self._write.fileno(), warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: None)
        return self

    def fileno(self) -> int:
        return self._read.fileno()

    def __exit__(self, *_: object) -> None:
        signal.set_wakeup_fd(-1)
        self._read.close()
        self._write.close()


def _host_link(link: Link, stop: _StopSignal, trouble: list[str]) -> HostLink:
    """The link as the library wants it; what a callback raises goes to `trouble`."""
    build = f"fw native {source_hash()[:8]}".encode()
    made = HostLink(fd=link.fileno(), stop_fd=stop.fileno(), datagram=link.datagram, build=build)
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
