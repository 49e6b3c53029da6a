"""`board: none`: nobody on the other end of the cable, and a torque schedule decides what acts."""

from __future__ import annotations

from protocol.frames import FRESH, NO_TICK, ZERO, Sample
from sil.commands import Acting
from sil.signals import Vector
from sil.sinks.journal import NO_ANSWER


class Scheduled:
    """Decides by a table instead of by commands; `torque_B` is (ticks, 3) in N m on the body."""

    def __init__(self, torque_B: Vector) -> None:
        self._torque_B = torque_B
        self._acting = Acting((0.0, 0.0, 0.0), ZERO, NO_TICK)
        self.notices: list[tuple[int, int, int]] = []

    @property
    def acting(self) -> Acting:
        return self._acting

    def decide(self, due: int) -> Acting:
        x, y, z = self._torque_B[due].tolist()
        self._acting = Acting((x, y, z), FRESH, due)
        return self._acting


class Nobody:
    """The other end of a cable that is not plugged in."""

    last_answer_ns = NO_ANSWER

    def send(self, sample: Sample, t_ns: int) -> None:
        """Into the void."""

    def drain(self, tick: int) -> None:
        """Nothing comes."""

    def listen(self, timeout_s: float) -> None:
        """Nothing comes."""

    def finish(self, tick: int, overdue: bool) -> None:
        """Nothing is missing."""
