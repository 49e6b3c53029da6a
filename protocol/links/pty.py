"""Link `pty`: a pseudo-terminal. The laboratory holds the master; the board opens the other side as a serial port.

Only the master is opened here, so that the kernel reports the board's closing as a hang-up; before the board opens its
side for the first time there is none. What either end writes before the other reads is kept (about 17 KiB). When the
master closes, bytes the board has not yet read are lost with it.
"""

from __future__ import annotations

import fcntl
import os
import struct
import termios
import tty

from protocol.link import Link, LinkError, StreamLink
from protocol.links import link_class

# Linux requests that the termios module does not name in every Python we run on: get the number, take the lock off.
TIOCGPTN = getattr(termios, "TIOCGPTN", 0x80045430)
TIOCSPTLCK = getattr(termios, "TIOCSPTLCK", 0x40045431)


class PtyLink(StreamLink):
    """The laboratory's end of a fresh pty, raw; `url` is what the board opens."""

    def __init__(self) -> None:
        try:
            fd = os.open("/dev/ptmx", os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
        except OSError as error:
            raise LinkError(f"pty: cannot open a pseudo-terminal: {error.strerror}") from None
        (number,) = struct.unpack("I", fcntl.ioctl(fd, TIOCGPTN, bytes(4)))
        fcntl.ioctl(fd, TIOCSPTLCK, bytes(4))
        tty.setraw(fd, termios.TCSANOW)  # on the master: it sets the pair's one line discipline
        self.peer_path = f"/dev/pts/{number}"
        self.url = f"serial://{self.peer_path}"
        super().__init__(fd, f"pty {self.peer_path}")

    @classmethod
    def open(cls, url: str, listen: bool) -> PtyLink:
        """A new pty. Raises LinkError on the board, which opens the path it is told."""
        if url != "pty":
            raise LinkError(f"link: expected pty, got {url!r}")
        if listen:
            raise LinkError("pty: the board opens what the laboratory prints, serial:///dev/pts/N")
        return cls()

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        """A pty and, on its other side, a serial port."""
        lab = cls()
        return lab, link_class("serial").open(lab.url, listen=True)
