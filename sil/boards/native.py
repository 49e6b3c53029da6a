"""The C firmware compiled for this machine, in a process of its own, over a pty or UDP on loopback."""

from __future__ import annotations

from sil.boards import BoardOrder
from sil.launched import LaunchedBoard


class NativeBoard(LaunchedBoard):
    """Launches `python -m sil.pil.native`: the firmware's sources as a library, its main loop in C."""

    module = "sil.pil.native"
    what = "native board"
    start_s = 120.0  # the first time, it compiles

    def options(self, order: BoardOrder) -> list[str]:
        """Whether to lock memory."""
        return ["--lock-memory"] if order.lock_memory else []
