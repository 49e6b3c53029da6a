"""The board inside the laboratory's process, through frames all the same; the one file that imports firmware_sim."""

from __future__ import annotations

import traceback

from firmware_sim.board import Board, UserLawClass
from firmware_sim.hal import HostHal
from protocol.links import Link, inproc
from protocol.port import Port
from sil.boards import BoardOrder
from sil.trouble import LinkFailure, UsageError


class InprocBoard:
    """A `firmware_sim` board that runs until idle whenever the laboratory waits for a frame; its timer never fires."""

    pid = None

    def __init__(self, order: BoardOrder) -> None:
        lab_end, board_end = inproc.pair()
        self.link: Link = lab_end
        self._port = Port(board_end)
        self.board = Board(self._port, HostHal(self._port), _user_law(order.law_file))
        self._log = order.log
        lab_end.pump = self._run_until_idle

    def check_alive(self) -> None:
        """It lives as long as this process does."""

    def post_mortem(self, error: Exception) -> str:
        return str(error)

    def close(self) -> None:
        self.link.close()
        self._port.close()

    def _run_until_idle(self) -> None:
        try:
            while (packet := self._port.receive(0.0)) is not None:
                self.board.handle(packet)
        except (Exception, SystemExit) as error:
            # What ends a board process ends this board, too: the traceback for the law's author, one line for the run.
            if self._log is not None:
                self._log.write_text(traceback.format_exc(), encoding="utf-8")
            what = " ".join(str(error).split())[:200]
            raise LinkFailure(f"board: the controller ended with {type(error).__name__}: {what}") from error


def _user_law(law_file: str) -> UserLawClass | None:
    if not law_file:
        return None
    from firmware_sim.controllers.user import LawFileError, load_user_law

    try:
        return load_user_law(law_file)
    except LawFileError as error:
        raise UsageError(str(error)) from None
