"""Boards for a ladder's upper rungs, in this process: right ones, wrong ones, and one that is not to be had."""

from __future__ import annotations

from typing import Any

from firmware_sim.flight import Flight
from sil.boards import BoardOrder
from sil.boards.inproc import InprocBoard
from sil.trouble import UsageError

WRONG_AT = 37


class OffByALsb(Flight):
    """One torque of one tick is a count off."""

    def step(self, tick: int, sample: Any) -> Any:
        answer = super().step(tick, sample)
        if tick == WRONG_AT:
            x, y, z = answer[0].torque
            answer[0] = answer[0]._replace(torque=(x, y + 1, z))
        return answer


class Right(InprocBoard):
    """What a firmware should be."""


class Wrong(InprocBoard):
    """A firmware with a mistake."""

    def __init__(self, order: BoardOrder) -> None:
        super().__init__(order)
        configure = self.board._configure

        def configure_wrongly() -> Any:
            ready = configure()
            if self.board._flight is not None:
                self.board._flight.__class__ = OffByALsb
            return ready

        self.board._configure = configure_wrongly  # type: ignore[method-assign]


class Missing:
    """A board that needs something that is not installed."""

    def __init__(self, order: BoardOrder) -> None:
        raise UsageError("board cortex-m: expected unicorn, got none: pip install 'attitude-sil[pil]'")


class Dying(InprocBoard):
    """A board that is gone in the middle of the flight."""

    def __init__(self, order: BoardOrder) -> None:
        super().__init__(order)
        handle, self.left = self.board.handle, 60

        def handle_a_few(packet: Any) -> None:
            self.left -= 1
            if self.left < 0:
                raise RuntimeError("out of order")
            handle(packet)

        self.board.handle = handle_a_few  # type: ignore[method-assign]
