"""Link `inproc`: two queues of bytes in one process, and a pump that lets the board run when the lab waits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from protocol.link import Link, LinkClosed, LinkError

MAX_QUEUED = 1 << 20  # bytes; more means that nobody reads


def _no_pump() -> None:
    """Until the caller sets one, nobody runs while an end waits."""


class InprocLink(Link):
    """One end. `peer` is the other; `pump` is called once by a receive() that finds nothing, before it gives up.

    Nothing ever waits: there is no one to wait for in one process, so every timeout is 0.
    """

    url = "inproc"

    def __init__(self) -> None:
        self._inbox: deque[bytes] = deque()
        self._queued = 0
        self._closed = False
        self.peer: InprocLink = self
        self.pump: Callable[[], object] = _no_pump

    @classmethod
    def pair(cls) -> tuple[InprocLink, InprocLink]:
        """(the laboratory's end, the board's end)."""
        lab, board = cls(), cls()
        lab.peer, board.peer = board, lab
        return lab, board

    @classmethod
    def open(cls, url: str, listen: bool) -> InprocLink:
        """The laboratory's end; the board's is its `peer`."""
        if url != "inproc":
            raise LinkError(f"link: expected inproc, got {url!r}")
        if listen:
            raise LinkError("inproc: a board of its own process cannot open it; known: pty, udp, serial")
        return cls.pair()[0]

    def send(self, data: bytes) -> None:
        peer = self.peer
        if self._closed or peer._closed:
            raise LinkClosed("inproc: the other end is closed")
        if peer._queued + len(data) > MAX_QUEUED:
            raise LinkError(f"inproc: the other end does not read: {peer._queued} bytes are queued")
        peer._inbox.append(data)
        peer._queued += len(data)

    def receive(self, timeout_s: float | None) -> bytes:
        if not self._inbox and not self._closed:
            self.pump()
        if self._inbox:
            data = b"".join(self._inbox)
            self._inbox.clear()
            self._queued = 0
            return data
        if self._closed or self.peer._closed:
            raise LinkClosed("inproc: the other end is closed")
        return b""

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self._closed = True


def pair() -> tuple[InprocLink, InprocLink]:
    """(the laboratory's end, the board's end)."""
    return InprocLink.pair()
