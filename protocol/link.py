"""What every link is: bytes to the other end and back, one poll and one read per receive, and two kinds of failure."""

from __future__ import annotations

import errno
import os
import select
import time
from abc import ABC, abstractmethod

READ_SIZE = 65536
WRITE_TIMEOUT_S = 5.0
FINE_TIMEOUT_S = 0.02  # shorter waits go through select(), whose timeout is not rounded up to a millisecond


class LinkError(Exception):
    """A link cannot be opened or used; one line that names it, what is wrong and, where there are any, the choices."""


class LinkClosed(LinkError):
    """The other end, or the device, is gone."""


class Link(ABC):
    """One end of a link. `url` is what the OTHER end has to open; `datagram` says whether send() keeps boundaries."""

    datagram: bool = False
    url: str = ""
    strangers: int = 0  # datagrams from somebody else, dropped
    refused: int | None = None  # how often the network said that nobody listens at the other end; None: it never would

    @property
    def peer_url(self) -> str:
        """The same as `url`, for readers who wonder whose it is."""
        return self.url

    @classmethod
    @abstractmethod
    def open(cls, url: str, listen: bool) -> Link:
        """The end that `url` names: the board's when `listen`, else the laboratory's. Raises LinkError."""

    @classmethod
    @abstractmethod
    def pair(cls) -> tuple[Link, Link]:
        """Two connected ends on this machine (the laboratory's, the board's), as socket.socketpair gives sockets."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Hand over all of `data` (a datagram link: as one datagram). Raises LinkClosed, LinkError."""

    @abstractmethod
    def receive(self, timeout_s: float | None) -> bytes:
        """What has come; waits up to `timeout_s` (None: for ever) for the first byte. b"" when nothing came.

        Raises LinkClosed when the other end is gone and everything it sent has been read.
        """

    @abstractmethod
    def fileno(self) -> int:
        """The descriptor to poll, -1 when there is none."""

    @abstractmethod
    def close(self) -> None:
        """Give the resources back; twice is as good as once."""

    def release(self) -> None:  # noqa: B027  (only links with a peer to forget do something)
        """Forget the present peer, so that the next may come (UDP, board's end)."""

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Waiter:
    """Waits until a descriptor is readable. Never sleeps, never spins; EINTR is retried by Python."""

    def __init__(self, fd: int) -> None:
        self._fd = [fd]
        self._poll = select.poll()
        self._poll.register(fd, select.POLLIN)
        self._fine = fd < 1024

    def readable(self, timeout_s: float | None) -> bool:
        """True when there is data, an error or a hang-up to read."""
        if timeout_s is None:
            return bool(self._poll.poll())
        if self._fine and 0.0 < timeout_s < FINE_TIMEOUT_S:
            return bool(select.select(self._fd, (), (), timeout_s)[0])
        return bool(self._poll.poll(timeout_s * 1000.0 if timeout_s > 0.0 else 0))


class StreamLink(Link):
    """A byte stream on a non-blocking descriptor: the common part of pty and serial. `name` is for messages."""

    def __init__(self, fd: int, name: str) -> None:
        os.set_blocking(fd, False)
        self._fd = fd
        self._name = name
        self._waiter = Waiter(fd)

    def send(self, data: bytes) -> None:
        """One write as a rule; waits for room, at most WRITE_TIMEOUT_S, when the other end does not read."""
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            raise self._failure(error) from None
        if written < len(data):
            self._send_rest(memoryview(data)[written:])

    def _send_rest(self, rest: memoryview) -> None:
        deadline = time.monotonic() + WRITE_TIMEOUT_S
        room = select.poll()
        room.register(self._fd, select.POLLOUT)
        while rest:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                raise LinkError(f"{self._name}: the other end does not read: {len(rest)} bytes left after 5 s")
            room.poll(left_s * 1000.0)
            try:
                rest = rest[os.write(self._fd, rest) :]
            except BlockingIOError:
                continue
            except OSError as error:
                raise self._failure(error) from None

    def receive(self, timeout_s: float | None) -> bytes:
        """One poll, one read."""
        try:
            if not self._waiter.readable(timeout_s):
                return b""
            data = os.read(self._fd, READ_SIZE)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._failure(error) from None
        if not data:
            raise self._gone("closed")
        return data

    def _failure(self, error: Exception) -> LinkError:
        """Which failure an errno means: a hung-up tty says EIO, an unplugged device EIO, ENXIO or ENODEV."""
        number = getattr(error, "errno", None)
        if self._fd < 0 or number in (errno.EIO, errno.ENXIO, errno.ENODEV, errno.EBADF, errno.EPIPE):
            return self._gone(errno.errorcode.get(number or 0, "closed"))
        return LinkError(f"{self._name}: {error}")

    def _gone(self, how: str) -> LinkClosed:
        return LinkClosed(f"{self._name}: the other end is gone ({how})")

    def fileno(self) -> int:
        return self._fd

    def close(self) -> None:
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)
