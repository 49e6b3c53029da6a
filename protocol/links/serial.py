"""Link `serial`: a serial port, raw, 8N1, no flow control, DTR and RTS inactive; or the board's side of a pty."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import struct
import termios
import tty
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

import serial as pyserial

from protocol.link import Link, LinkError, StreamLink

DEFAULT_BAUD = 115200
PTY_MAJORS = range(136, 144)  # Linux: /dev/pts/*
TIOCGICOUNT = getattr(termios, "TIOCGICOUNT", 0x545D)
ICOUNT = struct.Struct("20i")  # cts dsr rng dcd rx tx frame overrun parity brk buf_overrun, nine reserved


class LineErrors(NamedTuple):
    """What a UART's driver has counted since it was loaded; `buffer_overrun` is the kernel's buffer, not the chip's."""

    framing: int
    overrun: int
    parity: int
    breaks: int
    buffer_overrun: int


class SerialLink(StreamLink):
    """Both ends of a cable open their own port this way.

    A pty has neither baud rate nor modem lines and may already hold what the other end wrote: it is only made raw. A
    real port is opened through pyserial, exclusively, and drained.
    """

    def __init__(self, path: str, baud: int = DEFAULT_BAUD) -> None:
        self.baud = baud
        self._port: pyserial.Serial | None = None
        self.url = f"serial://{path}?baud={baud}"
        try:
            is_pty = _is_pty(path)
            fd = _open_pty(path) if is_pty else self._open_port(path)
        except (OSError, ValueError, termios.error) as error:
            raise LinkError(f"serial {path}: cannot open: {_reason(error)}") from None
        super().__init__(fd, f"serial {path}")

    def _open_port(self, path: str) -> int:
        port = pyserial.Serial(baudrate=self.baud, timeout=0, exclusive=True)  # 8N1, no flow control by default
        port.port = path
        port.dtr = False
        port.rts = False
        port.open()
        port.reset_input_buffer()
        self._port = port
        return int(port.fileno())

    @classmethod
    def open(cls, url: str, listen: bool) -> SerialLink:
        """`serial:///dev/X?baud=N`; the same at either end."""
        return cls(*parse_url(url))

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        """The two sides of a pty, the laboratory on the port, the board on the master."""
        master, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        lab = cls(os.ttyname(slave))
        os.close(slave)
        return lab, _Master(master, "serial (pair)")

    def line_errors(self) -> LineErrors | None:
        """The driver's counters, or None where there are none: a pty, and some USB adapters."""
        try:
            counts = ICOUNT.unpack(fcntl.ioctl(self._fd, TIOCGICOUNT, bytes(ICOUNT.size)))
        except OSError:
            return None
        return LineErrors(*counts[6:11])

    def close(self) -> None:
        if self._port is not None:
            self._fd = -1
            self._port.close()
            self._port = None
        super().close()


class _Master(StreamLink):
    """The far side of SerialLink.pair()."""

    @classmethod
    def open(cls, url: str, listen: bool) -> Link:
        raise LinkError("serial: the master of a pair cannot be opened by name")

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        return SerialLink.pair()


def parse_url(url: str) -> tuple[str, int]:
    """(path, baud) of serial:///dev/X?baud=N. Raises LinkError when it is none."""
    parts = urlsplit(url)
    query = parse_qs(parts.query, keep_blank_values=True)
    baud = query.pop("baud", [str(DEFAULT_BAUD)])[0]
    if parts.scheme != "serial" or parts.netloc or not parts.path or query or not baud.isdigit() or int(baud) == 0:
        raise LinkError(f"link: expected serial:///dev/X?baud=N, got {url!r}")
    return parts.path, int(baud)


def _is_pty(path: str) -> bool:
    status = os.stat(path)
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) in PTY_MAJORS


def _open_pty(path: str) -> int:
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    tty.setraw(fd, termios.TCSANOW)  # TCSANOW: the default would throw away what is already there
    return fd


def _reason(error: Exception) -> str:
    """One line, without the errno and the path that pyserial repeats."""
    number = getattr(error, "errno", None)
    if number == errno.EWOULDBLOCK:
        return "another program has it open"
    return os.strerror(number) if number else str(error).splitlines()[0]
