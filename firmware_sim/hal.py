"""What the board needs of its hardware: a clock, a wait for frames, a watchdog. Same names as firmware/core/hal.h.

The board never asks which hal it has. `HostHal` is a workstation; a test hands in a hal whose clock it sets.
"""

from __future__ import annotations

import time
from typing import Protocol

from protocol.frames import Packet
from protocol.port import Port


class Hal(Protocol):
    """The board's hardware, four calls. Times are integer nanoseconds of a clock that never goes backwards."""

    def now(self) -> int:
        """Nanoseconds since an arbitrary start."""

    def wait(self, until_ns: int | None) -> Packet | None:
        """Sleep until a frame is there, or until `until_ns` (None: for ever); returns the frame or None."""

    def kick(self) -> None:
        """Hardware watchdog: called once per round of the main loop, so a hang (and only a hang) resets the board."""


class HostHal:
    """A workstation as the board's hardware: CLOCK_MONOTONIC, the port's poll, a watchdog that only counts."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self.kicks = 0

    def now(self) -> int:
        return time.monotonic_ns()

    def wait(self, until_ns: int | None) -> Packet | None:
        timeout_s = None if until_ns is None else max(0.0, (until_ns - time.monotonic_ns()) * 1e-9)
        return self._port.receive(timeout_s)

    def kick(self) -> None:
        self.kicks += 1
