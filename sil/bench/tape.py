"""A recorder that remembers every row it is handed, so that the rows of a real run can be played again."""

from __future__ import annotations

from typing import Any

from sil.lateness import Wake
from sil.signals import Motion, Recorder, Vector


class Tape:
    """Rows as (name of the recorder's method, arguments), in order; `packets` are those of the deterministic frames."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, tuple[Any, ...]]] = []
        self.packets: list[bytes] = []

    def session(self, tick: int) -> None:
        self.rows.append(("session", (tick,)))

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
        self.packets.append(packet)
        self.rows.append(("packet", (tick, direction, fate, packet, cause, copy, arrival_ns, encoded)))

    def housekeeping(self, direction: int, packet: bytes) -> None:
        self.rows.append(("housekeeping", (direction, packet)))

    def event(self, tick: int, code: int, a: int, b: int) -> None:
        self.rows.append(("event", (tick, code, a, b)))

    def truth(
        self, motion: Motion, applied_Nm: Vector, setpoint_bam: tuple[int, int, int], source: int, tick: int
    ) -> None:
        self.rows.append(("truth", (motion, applied_Nm, setpoint_bam, source, tick)))

    def timing(self, tick: int, wake: Wake, answer_ns: int) -> None:
        self.rows.append(("timing", (tick, wake, answer_ns)))

    def commit(self, tick: int) -> None:
        self.rows.append(("commit", (tick,)))

    def play(self, into: Recorder) -> None:
        """Hand every row to another recorder."""
        for name, arguments in self.rows:
            getattr(into, name)(*arguments)
