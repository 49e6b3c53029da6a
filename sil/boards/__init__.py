"""Boards: what is plugged into the other end of the cable. One file per kind, one line here; imported when named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from protocol.links import Link
from sil.plugins import load

BOARDS = {
    "process": "sil.boards.process:ProcessBoard",
    "inproc": "sil.boards.inproc:InprocBoard",
    "native": "sil.boards.native:NativeBoard",
    "cortex-m": "sil.boards.cortex_m:CortexMBoard",
    "qemu": "sil.boards.qemu:QemuBoard",
    "wired": "sil.boards.wired:WiredBoard",
}
FIRMWARE = ("native", "cortex-m", "qemu")  # the C firmware: laws of the product, in fixed point
WITHOUT_TIMER = ("cortex-m", "qemu")  # emulated: they step by SAMPLE and TICK, so in lockstep only


@dataclass(frozen=True)
class BoardOrder:
    """What a run asks of a board. `law_file`: `/abs/file.py:Class` of a user's law, or "". `log`: for its stderr.

    `once`: a board process of ours ends with its first session; else it serves until its link is closed.
    """

    link_url: str
    law_file: str
    log: Path | None
    notify: Callable[[str], None]
    lock_memory: bool = False
    once: bool = True


class BoardHost(Protocol):
    """A board that is plugged in: the lab's end of its link, and a way to see whether it lives."""

    link: Link
    pid: int | None  # of a process that is ours to place and to give a priority

    def check_alive(self) -> None:
        """Raises LinkFailure when the board is known to be gone; silence is the caller's to judge."""

    def post_mortem(self, error: Exception) -> str:
        """Why the link failed, in one line: the board's own last words where it left any, else the link's."""

    def close(self) -> None:
        """Unplug, and leave no process behind. Safe to call twice."""


def plug_in(kind: str, order: BoardOrder) -> BoardHost:
    """Start or find the board. Raises LinkFailure, LinkError."""
    board: BoardHost = load(BOARDS, "board", kind)(order)
    return board
