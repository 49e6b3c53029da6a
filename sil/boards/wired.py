"""A board that somebody else powers: real hardware on a serial port, or a controller started by hand."""

from __future__ import annotations

from protocol.links import Link, open_link
from sil.boards import BoardOrder


class WiredBoard:
    """Opens the lab's end of the link and waits; on a pty it says which device the board has to open."""

    pid = None

    def __init__(self, order: BoardOrder) -> None:
        self.link: Link = open_link(order.link_url, listen=False)
        board_url = self.link.peer_url or order.link_url
        order.notify(f"waiting for a board on {board_url}   (sil board --link {board_url})")

    def check_alive(self) -> None:
        """Nothing of ours to look after: only its silence tells."""

    def post_mortem(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        self.link.close()
