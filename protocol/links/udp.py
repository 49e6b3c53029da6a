"""Link `udp`: one packet per datagram. The board listens, the laboratory connects a fresh socket for every session."""

from __future__ import annotations

import errno
import socket
import time
from abc import abstractmethod
from typing import Any
from urllib.parse import urlsplit

from protocol import frames
from protocol.link import Link, LinkClosed, LinkError, Waiter

STOP = bytes((frames.Type.STOP,))
PEER_SILENCE_S = 3.0  # after this, a HELLO from somebody else takes the board over


class UdpLink(Link):
    """What both ends share: a bound or connected non-blocking socket."""

    datagram = True

    def __init__(self, sock: socket.socket, name: str) -> None:
        sock.setblocking(False)
        self._socket = sock
        self._name = name
        self._waiter = Waiter(sock.fileno())
        self.strangers = 0
        self.refused = 0  # "nobody listens there", as the network told us

    @classmethod
    def open(cls, url: str, listen: bool) -> UdpLink:
        """`udp://HOST:PORT`: the laboratory connects there, the board binds it (port 0: any free one, see `.url`)."""
        host, port = _parse(url)
        return UdpBoard(host, port) if listen else UdpLab(host, port)

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        """A board on a free loopback port and a laboratory connected to it."""
        board = UdpBoard("127.0.0.1", 0)
        return UdpLab("127.0.0.1", board.port), board

    def receive(self, timeout_s: float | None) -> bytes:
        """The next datagram that counts; waits on over refusals, strangers and empty ones until the time is up."""
        deadline = time.monotonic() + timeout_s if timeout_s else 0.0
        while True:
            try:
                if not self._waiter.readable(timeout_s):
                    return b""
                data = self._read()
            except (OSError, ValueError) as error:
                raise self._failure(error) from None
            if data:
                return data
            if timeout_s:
                timeout_s = max(0.0, deadline - time.monotonic())

    @abstractmethod
    def _read(self) -> bytes:
        """One datagram, or b"" when what woke us does not count."""

    def _failure(self, error: Exception) -> LinkError:
        if self._socket.fileno() < 0:
            return LinkClosed(f"{self._name}: closed")
        return LinkError(f"{self._name}: {getattr(error, 'strerror', None) or error}")

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


class UdpLab(UdpLink):
    """The laboratory's end: a connected socket, so the kernel drops strangers and reports a board that is not there."""

    def __init__(self, host: str, port: int) -> None:
        self.url = f"udp://{_bracket(host)}:{port}"
        self._heard = False
        try:
            family, kind, number, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            sock = socket.socket(family, kind, number)
            sock.connect(address)
        except OSError as error:
            raise LinkError(f"{self.url}: cannot reach: {error.strerror}") from None
        super().__init__(sock, self.url)

    def send(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            self._refusal()  # an earlier datagram's; it took this one's place, so once more
            self._send_again(data)
        except OSError as error:
            raise self._failure(error) from None

    def _send_again(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            self._refusal()
        except OSError as error:
            raise self._failure(error) from None

    def _read(self) -> bytes:
        try:
            data = self._socket.recv(2048)
        except ConnectionRefusedError:
            self._refusal()
            return b""
        except BlockingIOError:
            return b""
        if data:
            self._heard = True
        return data

    def _refusal(self) -> None:
        """Not fatal while the board has yet to come up; once it has spoken, it is gone."""
        self.refused += 1
        if self._heard:
            raise LinkClosed(f"{self._name}: the board is gone (nobody listens there any more)")


class UdpBoard(UdpLink):
    """The board's end. Serves the peer whose HELLO it took last, until STOP, release() or PEER_SILENCE_S of silence.

    Without a peer it answers whoever sends a packet with a right CRC: so a lab learns that the board restarted.
    """

    def __init__(self, host: str, port: int) -> None:
        name = f"udp://{_bracket(host)}:{port}"
        try:
            family, kind, number, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            sock = socket.socket(family, kind, number)
            sock.bind(address)
        except OSError as error:
            why = "the port is busy" if error.errno == errno.EADDRINUSE else error.strerror
            raise LinkError(f"{name}: cannot listen: {why}") from None
        self.host, self.port = host, sock.getsockname()[1]
        self.url = f"udp://{_bracket(host)}:{self.port}"
        self._peer: Any = None  # the address that owns the session
        self._reply_to: Any = None  # the address the next send() goes to
        self._heard_s = 0.0
        self.unsent = 0  # nobody to send to
        super().__init__(sock, self.url)

    def release(self) -> None:
        """The session is over: the next HELLO, from wherever, is welcome. Answers still go to the last sender."""
        self._peer = None

    def send(self, data: bytes) -> None:
        if self._reply_to is None:
            self.unsent += 1
            return
        try:
            self._socket.sendto(data, self._reply_to)
        except ConnectionRefusedError:
            self.refused += 1
        except OSError as error:
            raise self._failure(error) from None

    def _read(self) -> bytes:
        try:
            data, sender = self._socket.recvfrom(2048)
        except ConnectionRefusedError:
            self.refused += 1
            return b""
        except BlockingIOError:
            return b""
        if sender == self._peer:
            self._heard_s = time.monotonic()
            if data[1:2] == STOP and frames.has_right_crc(data):
                self.release()
            return data
        return data if self._welcome(data, sender) else b""

    def _welcome(self, data: bytes, sender: Any) -> bool:
        """Whether a datagram from somebody who is not the peer may be read."""
        busy = self._peer is not None and time.monotonic() - self._heard_s < PEER_SILENCE_S
        right = frames.MIN_PACKET <= len(data) <= frames.MAX_PACKET and frames.has_right_crc(data)
        hello = right and data[1] == frames.Type.HELLO
        if not right or (self._peer is not None and (busy or not hello)):
            self.strangers += 1
            return False
        self._reply_to = sender
        if hello:
            self._peer, self._heard_s = sender, time.monotonic()
        return True


def _parse(url: str) -> tuple[str, int]:
    """(host, port) of udp://HOST:PORT."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or port is None or parts.scheme != "udp" or parts.path or parts.query:
        raise LinkError(f"link: expected udp://HOST:PORT, got {url!r}")
    return host, port


def _bracket(host: str) -> str:
    return f"[{host}]" if ":" in host else host
