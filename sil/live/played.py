"""A run that is over, played as it went: its journal's records, each tick when its time has come."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator

from sil.sinks.journal import JournalReader, Kind, Record


def finished(reader: JournalReader) -> bool:
    """The journal ends with END."""
    return any(record.kind == Kind.END for record in reader)


def played(records: Iterable[Record | None], speed: float) -> Iterator[Record | None]:
    """These records, `speed` times real time; None wherever the next one is not due yet."""
    began_s, period_s = time.monotonic(), 0.0
    for record in records:
        if record is not None and record.kind == Kind.META:
            period_s = json.loads(record.payload)["period_ns"] * 1e-9
        while record is not None and record.kind == Kind.COMMIT and _due_s(record, period_s, speed, began_s) > 0:
            yield None
        yield record


def _due_s(record: Record, period_s: float, speed: float, began_s: float) -> float:
    """Wall time until this tick is due."""
    return began_s + record.tick * period_s / speed - time.monotonic()
