"""The run's recorder: rows of the loop into the journal, one write per tick. A listener, never asked for an answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from protocol import frames
from sil.lateness import Wake
from sil.signals import Motion, Vector
from sil.sinks import journal
from sil.sinks.journal import Journal, Kind

OnEvent = Callable[[int, int, int, int, int], None]  # tick, code, a, b, origin
TYPE_AT = 1  # of a packet


class JournalRecorder:
    """Writes to an open Journal; JournalError (disk full) reaches the loop, which ends the run with what is kept.

    on_event(tick, code, a, b, origin) hears of every event, the laboratory's (origin 0) and the board's (1).
    """

    def __init__(self, target: Journal, on_event: OnEvent | None = None) -> None:
        self._journal = target
        self._on_event = on_event
        self._tick = 0  # the tick under way

    def start(self, meta: Mapping[str, Any], host: Mapping[str, Any]) -> None:
        """What decides the numbers, and apart from it what describes this machine and link."""
        self._journal.add(Kind.META, 0, journal.json_payload(meta))
        self._journal.add(Kind.HOST, 0, journal.json_payload(host))

    def session(self, tick: int) -> None:
        """A board session started at this tick; its CONFIG packets follow."""
        self._journal.add(Kind.SESSION, tick, journal.json_payload({"tick": tick}))

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
        payload = journal.packet_payload(direction, fate, packet, encoded, cause, copy, arrival_ns)
        self._journal.add(Kind.PACKET, tick, payload)
        if packet[TYPE_AT] == frames.Type.EVENT and not copy and self._on_event is not None:
            event: frames.Event = frames.unpack(packet).frame
            self._on_event(tick, event.code, event.a, event.b, 1)

    def housekeeping(self, direction: int, packet: bytes) -> None:
        payload = journal.housekeeping_payload(direction, time.monotonic_ns(), packet)
        self._journal.add(Kind.HOUSEKEEPING, self._tick, payload)

    def event(self, tick: int, code: int, a: int, b: int) -> None:
        self._journal.add(Kind.LAB_EVENT, tick, journal.event_payload(code, a, b))
        if self._on_event is not None:
            self._on_event(tick, code, a, b, 0)

    def truth(
        self, motion: Motion, applied_Nm: Vector, setpoint_bam: tuple[int, int, int], source: int, tick: int
    ) -> None:
        rows = (motion.q_BN, motion.omega_BN_B, motion.momentum_B, motion.euler_rad, applied_Nm)
        q, w, h, euler, applied = (row.tolist() for row in rows)
        self._journal.add(Kind.TRUTH, tick, journal.truth_payload(q, w, h, euler, applied, setpoint_bam, source))

    def timing(self, tick: int, wake: Wake, answer_ns: int) -> None:
        late_ns, cause, work_ns, gc_ns, log_ns = wake
        self._journal.add(Kind.TIMING, tick, journal.timing_payload(late_ns, answer_ns, work_ns, gc_ns, log_ns, cause))

    def commit(self, tick: int) -> None:
        self._tick = tick
        self._journal.commit(tick)

    def end(self, tick: int, reason: str, ticks: int) -> None:
        """The last record: why the run ended, and after how many ticks."""
        self._journal.add(Kind.END, tick, journal.json_payload({"reason": reason, "ticks": ticks}))
        self._journal.commit(tick)
        self.close()

    def close(self) -> None:
        """No more rows; what was not committed is dropped."""
        self._journal.close()
