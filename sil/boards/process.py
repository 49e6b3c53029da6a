"""The default board: the Python controller in a process of its own, over a pty or UDP on loopback."""

from __future__ import annotations

from sil.boards import BoardOrder
from sil.launched import LaunchedBoard


class ProcessBoard(LaunchedBoard):
    """Launches `python -m firmware_sim` of this installation and talks to it over the link that the order names."""

    module = "firmware_sim"
    what = "controller process"

    def options(self, order: BoardOrder) -> list[str]:
        """A user's own law, and whether to lock memory."""
        law = ["--law", order.law_file] if order.law_file else []
        return [*law, *(["--lock-memory"] if order.lock_memory else [])]
