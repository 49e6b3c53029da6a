"""Link `udp`: one packet per datagram. The board listens, the laboratory connects a fresh socket for every session."""

from __future__ import annotations

import errno
import select
import socket
import time
from abc import abstractmethod
from typing import Any
from urllib.parse import urlsplit

from protocol import frames
from protocol.link import Link, LinkClosed, LinkError, Waiter

STOP = bytes((frames.Type.STOP,))
PEER_SILENCE_S = 3.0  # after this, a HELLO from somebody else takes the board over
STRANGERS_AT_ONCE = 16  # datagrams; between them the peer gets its turn
FRUITLESS_READS = 16  # after the time is up: whoever floods the port does not prolong a wait for ever


class UdpLink(Link):
    """What both ends share: a bound or connected non-blocking socket."""

    datagram = True

    def __init__(self, sock: socket.socket, name: str, wait_for: int | None = None) -> None:
        sock.setblocking(False)
        self._socket = sock
        self._name = name
        self._waiter = Waiter(sock.fileno() if wait_for is None else wait_for)
        self.strangers = 0
        self.refused: int = 0

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
        fruitless = 0
        while True:
            try:
                if not self._waiter.readable(timeout_s):
                    return b""
                data = self._read()
            except (OSError, ValueError) as error:
                raise self._failure(error) from None
            if data:
                return data
            fruitless += 1
            if timeout_s is not None:
                timeout_s = max(0.0, deadline - time.monotonic())
                if timeout_s == 0.0 and fruitless >= FRUITLESS_READS:
                    return b""

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

    The peer has a socket of its own, connected to it, so that however much strangers send, it is their socket that
    overflows, and no frame of the session is lost for want of room.
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
        self._to_peer: socket.socket | None = None  # None where that cannot be had
        self._connected: Any = None  # the address it is connected to
        self._reply_to: Any = None  # the address the next send() goes to
        self._heard_s = 0.0
        self.unsent = 0  # nobody to send to
        self._epoll = select.epoll()
        self._epoll.register(sock, select.EPOLLIN)
        super().__init__(sock, self.url, self._epoll.fileno())

    def release(self) -> None:
        """The session is over: the next HELLO, from wherever, is welcome. Answers still go to the last sender."""
        self._peer = None

    def fileno(self) -> int:
        return -1 if self._epoll.closed else self._epoll.fileno()

    def close(self) -> None:
        self._epoll.close()
        if self._to_peer is not None:
            self._to_peer.close()
        super().close()

    def send(self, data: bytes) -> None:
        if self._reply_to is None:
            self.unsent += 1
            return
        try:
            if self._to_peer is not None and self._connected == self._reply_to:
                self._to_peer.send(data)
            else:
                self._socket.sendto(data, self._reply_to)
        except ConnectionRefusedError:
            self.refused += 1
        except OSError as error:
            raise self._failure(error) from None

    def _read(self) -> bytes:
        """The next datagram that counts. Nobody's socket is emptied before the other one is looked at."""
        for _ in range(STRANGERS_AT_ONCE):
            data, sender = self._take(self._socket)
            if sender is None:
                break
            if self._counts(data, sender):
                return data
        if self._to_peer is None:
            return b""
        data, sender = self._take(self._to_peer)
        return data if sender is not None and self._counts(data, sender) else b""

    def _take(self, sock: socket.socket) -> tuple[bytes, Any]:
        """(datagram, its sender); sender None: nothing there."""
        try:
            return sock.recvfrom(2048)
        except ConnectionRefusedError:
            self.refused += 1
        except BlockingIOError:
            pass
        return b"", None

    def _counts(self, data: bytes, sender: Any) -> bool:
        """Whether this datagram may be read: the peer's, or one that is welcome."""
        if sender != self._peer:
            return self._welcome(data, sender)
        self._heard_s = time.monotonic()
        if data[1:2] == STOP and frames.has_right_crc(data):
            self.release()
        return True

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
            self._connect(sender)
        return True

    def _connect(self, peer: Any) -> None:
        """A socket on the same port for this peer alone: the kernel hands it what the peer sends.

        The port is shared for this moment only, so that a second board on it is still refused.
        """
        if self._to_peer is not None:
            if self._connected == peer:
                return
            self._to_peer.close()
            self._to_peer = None
        made = socket.socket(self._socket.family, socket.SOCK_DGRAM)
        try:
            self._share_port(True)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            made.setblocking(False)
            made.bind(self._socket.getsockname())
            made.connect(peer)
        except OSError:
            made.close()  # one socket for all will do
            return
        finally:
            self._share_port(False)
        self._to_peer, self._connected = made, peer
        self._epoll.register(made, select.EPOLLIN)

    def _share_port(self, shared: bool) -> None:
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(shared))


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
