"""What may be on the other end of a doctor's cable: a board, a console, noise, an echo, nobody. Each in a thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from protocol import frames
from protocol.frames import Hello, Packet
from protocol.link import Link, LinkClosed, LinkError
from protocol.links import open_link
from protocol.port import Port

Behaviour = Callable[[Link], None]


@contextmanager
def far_end(behaviour: Behaviour, link: Link | None = None) -> Iterator[str]:
    """Path of a pty (URL of `link`) with `behaviour` on its other side, called again and again until the end."""
    end = link or open_link("pty", listen=False)
    over = threading.Event()

    def live() -> None:
        while not over.is_set():
            try:
                behaviour(end)
            except LinkClosed:
                over.wait(0.01)  # the doctor closed its side; it may open it again
            except LinkError:
                return

    thread = threading.Thread(target=live)
    thread.start()
    try:
        yield end.url.removeprefix("serial://")
    finally:
        over.set()
        thread.join()
        end.close()


class FakeBoard:
    """Answers HELLO as a board does, and remembers what it was sent."""

    def __init__(self, layout_hash: int = frames.LAYOUT_HASH, boot: bytes = b"") -> None:
        self.seen: list[Packet] = []
        self._layout_hash = layout_hash
        self._boot = boot
        self._port: Port | None = None

    def __call__(self, link: Link) -> None:
        if self._port is None:
            self._port = Port(link)
            link.send(self._boot)
        packet = self._port.receive(0.02)
        if packet is None:
            return
        self.seen.append(packet)
        if packet.type == frames.Type.HELLO:
            self._port.send(echo_of(packet.frame, self._layout_hash))

    @property
    def stopped(self) -> bool:
        return bool(self.seen) and self.seen[-1].type == frames.Type.STOP


def echo_of(hello: Hello, layout_hash: int = frames.LAYOUT_HASH) -> Hello:
    """A board's answer to a laboratory's HELLO."""
    flags = frames.HELLO_ECHO | frames.HELLO_OWN_TIMER
    return Hello(frames.PROTOCOL_VERSION, frames.ROLE_BOARD, flags, layout_hash, hello.nonce, 0, "fake board 7")


def babble(text: bytes) -> Behaviour:
    """Somebody who says the same thing all the time, and drops what he is told."""

    def behaviour(link: Link) -> None:
        link.send(text)
        link.receive(0.02)

    return behaviour


def echo(link: Link) -> None:
    """A loop-back plug."""
    data = link.receive(0.02)
    if data:
        link.send(data)


def nobody(link: Link) -> None:
    """Reads and says nothing."""
    link.receive(0.02)
