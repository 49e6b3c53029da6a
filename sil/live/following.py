"""A journal as it grows, tick by tick, as rows for viewers: the same rows that sil.sinks.seal puts into the log.

A tick is shown when the journal says that it is whole, which is one period after it began. A frame that arrives ticks
later is shown when it arrives, with the time of its own tick. Of ticks that are not shown, what happened once is shown
all the same: events, sessions, CONFIG.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import NamedTuple

from protocol.frames import Type
from sil.sinks import journal as jn
from sil.sinks.events import OF_THE_HOST
from sil.sinks.journal import Kind, Record
from sil.sinks.mcap_rows import RunRows, TimingRows

NO_TICK = 0xFFFFFFFF  # of a frame that belongs to its session
MOST_AT_ONCE = 1000  # ticks that are held to decide which of them are shown
_TYPE_AT = 1  # of a packet
_ONCE = (Type.EVENT, Type.CONFIG)


class Step(NamedTuple):
    """What one commit of the journal brought, by tick; normally of one."""

    tick: int
    is_tick: bool  # whole now; else the run's beginning or end
    records: dict[int, list[Record]]

    def once(self) -> Step:
        """Of it, what happened once: events, sessions, CONFIG."""
        return self._replace(records={tick: [r for r in of if _once(r)] for tick, of in self.records.items()})

    def rest(self) -> Step:
        """Of it, what there is in every tick."""
        return self._replace(records={tick: [r for r in of if not _once(r)] for tick, of in self.records.items()})


class Following:
    """Reads on in a journal and writes rows. `over`: it ends with END, and everything before was read."""

    def __init__(self, run: RunRows, timing: TimingRows) -> None:
        self._run, self._timing = run, timing
        self._records: Iterator[Record | None] = iter(())
        self._waiting: dict[int, list[Record]] = {}
        self._session_tick = 0
        self.period_ns = 0
        self.over = False

    def follow(self, records: Iterator[Record | None]) -> None:
        """Whose; None where there is nothing more for now."""
        self._records = records

    def new(self) -> list[Step]:
        """What has become whole since the last call, MOST_AT_ONCE at most: then there may be more."""
        steps: list[Step] = []
        while len(steps) < MOST_AT_ONCE and (record := next(self._records, None)) is not None:
            if record.kind == Kind.COMMIT:
                steps.append(self._whole(record.tick))
            elif record.kind in (Kind.META, Kind.END):
                self._identity(record)
            elif record.kind not in (Kind.HOST, Kind.HOUSEKEEPING):
                self._take(record)
        return steps

    def show(self, step: Step) -> None:
        """Its rows."""
        for tick, records in step.records.items():
            if records and self.period_ns:
                self._rows(tick, records)

    def time_of(self, step: Step) -> int:
        """t_k in ns."""
        return step.tick * self.period_ns

    def _rows(self, tick: int, records: list[Record]) -> None:
        t_ns = tick * self.period_ns
        self._run.tick(tick, t_ns, [record for record in records if not _of_the_host(record)])
        self._timing.tick(tick, t_ns, [record for record in records if _of_the_host(record)])
        del self._timing.answers_ns[:]  # kept for a summary that nobody makes here

    def _take(self, record: Record) -> None:
        if record.kind == Kind.SESSION:
            self._session_tick = record.tick
        tick = self._session_tick if record.tick == NO_TICK else record.tick
        self._waiting.setdefault(tick, []).append(record)

    def _whole(self, tick: int) -> Step:
        records = {k: self._waiting.pop(k) for k in sorted(self._waiting) if k <= tick}
        return Step(tick, any(record.kind == Kind.TRUTH for record in records.get(tick, ())), records)

    def _identity(self, record: Record) -> None:
        content = json.loads(record.payload)
        if record.kind == Kind.END:
            self.over = True
            return
        self.period_ns = int(content["period_ns"])
        self._run.meta(content)
        self._run.ends_at(int(content["ticks"]) * self.period_ns)  # as planned; only the log knows of a sooner end


def _of_the_host(record: Record) -> bool:
    if record.kind == Kind.LAB_EVENT:
        return jn.read_event(record.payload)[0] in OF_THE_HOST
    return record.kind == Kind.TIMING


def _once(record: Record) -> bool:
    """The record is of something that happened once, not of every tick."""
    if record.kind != Kind.PACKET:
        return record.kind in (Kind.LAB_EVENT, Kind.SESSION)
    packet = jn.read_packet(record.payload).packet
    return len(packet) > _TYPE_AT and packet[_TYPE_AT] in _ONCE
