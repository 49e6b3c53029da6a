"""Boards with a reset button, pressed by a script: in the laboratory's process, or in a thread at a link's end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from firmware_sim.board import Board
from firmware_sim.hal import HostHal
from protocol.frames import Packet, Type
from protocol.link import Link, LinkClosed
from protocol.links import open_link
from protocol.port import Port

BEFORE, COMMAND, AFTER = "before", "command", "after"  # reset before the answer, behind its COMMAND, behind all of it
HANG, DEAF = "hang", "deaf"  # takes nothing any more; does not hear this one SAMPLE


class ResetBoard:
    """A real board whose `script` says what happens at the SAMPLE of a tick, once each time it comes.

    boots: frames that it does not hear after a reset. mute: its HELLO at boot is lost. configs: resets at CONFIG.
    watchdog_s: wall time of a hang after which it is reset, None: never.
    """

    def __init__(
        self,
        link: Link,
        script: dict[int, Sequence[str]],
        boots: int = 0,
        mute: bool = False,
        configs: int = 0,
        watchdog_s: float | None = None,
    ) -> None:
        self._link = link
        self.script = {tick: list(acts) for tick, acts in script.items()}
        self.boots, self.mute, self.configs, self.watchdog_s = boots, mute, configs, watchdog_s
        self._deaf = 0
        self._hung_s: float | None = None
        self.resets = 0
        self._begin()

    def _begin(self) -> None:
        self.port = Port(self._link)
        self.board = Board(self.port, HostHal(self.port))

    @property
    def timer_ns(self) -> int | None:
        return self.board.timer_ns

    def reset(self) -> None:
        """Everything is forgotten: what was received, sequences, session."""
        self.resets += 1
        self._deaf, self._hung_s = self.boots, None
        self._begin()
        if not self.mute:
            self.board.announce()

    def run_until_idle(self) -> None:
        """Everything that has come."""
        self.look_at_watchdog()
        while (packet := self.port.receive(0.0)) is not None:
            self.handle(packet)

    def look_at_watchdog(self) -> None:
        if self._hung_s is None or self.watchdog_s is None:
            return
        if time.monotonic() - self._hung_s > self.watchdog_s:
            self.reset()

    def handle(self, packet: Packet) -> None:
        if self._hung_s is not None:
            return
        if self._deaf:
            self._deaf -= 1
            return
        acts = self.script.get(packet.tick) if packet.type == Type.SAMPLE else None
        if acts:
            self._act(acts.pop(0), packet)
        elif packet.type == Type.CONFIG and self.resets and self.configs:
            self.configs -= 1
            self.reset()
        else:
            self.board.handle(packet)

    def _act(self, act: str, packet: Packet) -> None:
        if act == HANG:
            self._hung_s = time.monotonic()
        elif act == BEFORE:
            self.reset()
        elif act == AFTER:
            self.board.handle(packet)
            self.reset()
        elif act == COMMAND:
            send = self.port.send
            self.port.send = lambda *frames: send(frames[0])  # type: ignore[method-assign]
            self.board.handle(packet)
            self.reset()


def install(bench: Any, script: dict[int, Sequence[str]], **how: Any) -> ResetBoard:
    """In place of a LabBench's in-process board; the session is opened already, and is opened again with this one."""
    host = bench.rig.host if hasattr(bench, "rig") else bench.host
    made = ResetBoard(host._port.link, script, **how)
    made.board, made.port = host.board, host._port
    host.link.pump = made.run_until_idle
    return made


@contextmanager
def served(link_url: str, script: dict[int, Sequence[str]], **how: Any) -> Iterator[tuple[str, ResetBoard]]:
    """(URL for the laboratory, board): a board in a thread at the far end of a pty or a UDP port."""
    link = open_link(link_url, listen=link_url != "pty")
    board = ResetBoard(link, script, **how)
    over = threading.Event()

    def live() -> None:
        while not over.is_set():
            try:
                packet = board.port.receive(0.005)
                board.look_at_watchdog()
                if packet is not None:
                    board.handle(packet)
                elif board.timer_ns is not None and time.monotonic_ns() >= board.timer_ns:
                    board.board.on_timer()
            except LinkClosed:
                over.wait(0.01)

    thread = threading.Thread(target=live)
    thread.start()
    try:
        yield link.url, board
    finally:
        over.set()
        thread.join()
        link.close()
