"""A recorder that keeps nothing: for runs of which only the end, or the time they take, is wanted."""

from __future__ import annotations

from sil.lateness import Wake
from sil.signals import Motion, Vector


class Nothing:
    """A `sil.signals.Recorder` whose rows are gone as soon as they are handed over."""

    def session(self, tick: int) -> None:
        """Not kept."""

    def packet(
        self,
        tick: int,
        direction: int,
        fate: int,
        packet: bytes,
        cause: str = "",
        copy: int = 0,
        arrival_ns: int = -1,
        encoded: bytes = b"",
    ) -> None:
        """Not kept."""

    def housekeeping(self, direction: int, packet: bytes) -> None:
        """Not kept."""

    def event(self, tick: int, code: int, a: int, b: int) -> None:
        """Not kept."""

    def truth(
        self, motion: Motion, applied_Nm: Vector, setpoint_bam: tuple[int, int, int], source: int, tick: int
    ) -> None:
        """Not kept."""

    def timing(self, tick: int, wake: Wake, answer_ns: int) -> None:
        """Not kept."""

    def commit(self, tick: int) -> None:
        """Nothing to write."""
