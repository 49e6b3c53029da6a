"""Boards with one mistake each, in this process: what `sil board-test` has to find. `Host` plugs one in as a board.

A mistake is a few lines of a subclass of the Python board, of its flight, its port or its parts of CONFIG.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from firmware_sim.board import Board
from firmware_sim.flight import Flight
from firmware_sim.hal import HostHal
from protocol.codec import StreamDecoder
from protocol.config import Assembly
from protocol.frames import Ready
from protocol.links import Link, inproc
from protocol.port import Port
from sil.boards import BoardOrder


class Host:
    """A board in this process that runs whenever the laboratory waits, and says HELLO at boot."""

    pid = None
    wrong: ClassVar[Wrong]

    def __init__(self, order: BoardOrder) -> None:
        lab, end = inproc.pair()
        self.link: Link = lab
        lab.send = self._at_once(lab.send)  # type: ignore[method-assign]
        self._end = end
        self.port = self.wrong.port(end)
        self.board = self.wrong.board(self.port, HostHal(self.port))
        self.board.wrong = self.wrong  # type: ignore[attr-defined]
        lab.pump = self._run
        self.wrong.boot(self.board)

    def _at_once(self, send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """A write is a read on the other side, as on a slow line."""

        def send_and_run(data: bytes) -> None:
            send(data)
            self._run()

        return send_and_run

    def _run(self) -> None:
        while (packet := self.port.receive(0.0)) is not None:
            self.board.handle(packet)

    def check_alive(self) -> None:
        """As long as the test."""

    def post_mortem(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        self.link.close()
        self._end.close()


class Mistaken(Board):
    """A board whose flight and parts are of the mistake's classes."""

    wrong: Wrong

    def _forget(self) -> None:
        super()._forget()
        if hasattr(self, "wrong"):
            self._assembly.__class__ = self.wrong.assembly

    def _configure(self) -> Ready:
        ready = super()._configure()
        if self._flight is not None:
            self._flight.__class__ = self.wrong.flight
        return ready


@dataclass(frozen=True)
class Wrong:
    """One mistake: what is wrong, which checks have to say so, and the classes that make it."""

    what: str
    checks: tuple[str, ...]
    board: type[Board] = Mistaken
    flight: type[Flight] = Flight
    port: type[Port] = Port
    assembly: type[Assembly] = Assembly
    boot: Callable[[Board], None] = Board.announce

    @property
    def groups(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(check.partition(":")[0] for check in self.checks))


WRONG: list[Wrong] = []


def wrong(what: str, *checks: str, **classes: Any) -> Callable[[type], type]:
    """A decorator: this class is the mistake."""

    def keep(made: type) -> type:
        for base, name in ((Board, "board"), (Flight, "flight"), (Port, "port"), (Assembly, "assembly")):
            if issubclass(made, base):
                WRONG.append(Wrong(what, checks, **{name: made, **classes}))
        return made

    return keep


class Saying(Port):
    """A port that alters what the board says."""

    def say(self, frame: Any) -> Iterable[Any]:
        """What is sent instead."""
        return (frame,)

    def send(self, *out: Any) -> tuple[bytes, ...]:
        return super().send(*(said for frame in out for said in self.say(frame)))


class Hearing(Port):
    """A port that alters a packet before it looks at it; the CRC is made right again."""

    def hear(self, packet: bytearray) -> None:
        """Alter it in place."""

    def _take(self, raw: bytes) -> None:
        altered = bytearray(raw)
        self.hear(altered)
        super()._take(bytes(altered))


class Decoding(Port):
    """A port with another decoder."""

    Decoder: type[StreamDecoder] = StreamDecoder

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self._decoder = self.Decoder()
