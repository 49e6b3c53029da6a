"""The C firmware in QEMU's mps2-an386, in a process of its own, over a pty."""

from __future__ import annotations

from sil.boards import BoardOrder
from sil.launched import LaunchedBoard
from sil.trouble import UsageError


class QemuBoard(LaunchedBoard):
    """Launches `python -m sil.pil.qemu`: the same image as board `cortex-m`, on Debian's qemu-system-arm."""

    module = "sil.pil.qemu"
    what = "QEMU board"

    def __init__(self, order: BoardOrder) -> None:
        if order.link_url != "pty":
            raise UsageError(
                f"link: expected pty for board qemu, whose UART is a pty, got {order.link_url!r}; "
                "known: link.url=pty, or board cortex-m, which has udp, too"
            )
        super().__init__(order)

    def post_mortem(self, error: Exception) -> str:
        """With what QEMU said of a reset, where the process lives on."""
        line = super().post_mortem(error)
        said = self._last_words()
        return f"{line}: {said}" if said and said not in line else line
