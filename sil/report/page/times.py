"""Wall-clock side of a run, from timing.mcap: lateness against the deadline and answer times, as histograms."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from protocol import frames
from protocol.frames import Type
from sil import mcap_file
from sil.lateness import Cause, histogram, percentiles_us
from sil.plain import flat
from sil.report.signals import NO_ANSWER
from sil.runs import Array, Run
from sil.sinks import layouts

_TOPICS = ("/timing", "/housekeeping/down")


def times(run: Run) -> dict[str, Any]:
    """Histograms and host of a run; {"why": one line} where timing.mcap is missing, or damaged."""
    file = run.directory / "timing.mcap"
    if not file.exists():
        return {"why": "there is no timing.mcap beside the log"}
    try:
        content = mcap_file.read(file, _TOPICS)
        rows = _rows(content.messages["/timing"])
        board = _board(content.messages["/housekeeping/down"])
    except (OSError, ValueError, mcap_file.McapError) as error:
        return {"why": f"timing.mcap cannot be read: {error}"}
    host = {key: _value(value) for key, value in content.metadata.get("host", {}).items()}
    return {
        "paced": str(host.get("clock", "lockstep")) != "lockstep",
        "limit_us": _limit_us(run),
        "lateness": _distribution(rows["lateness_ns"]),
        "answer": _distribution(rows["answer_ns"][rows["answer_ns"] != NO_ANSWER]),
        "causes": _causes(rows),
        "board": board,
        "host": [[key, str(value)] for key, value in flat(host).items() if value not in ("", None, 0)],
    }


def _rows(messages: list[mcap_file.Message]) -> Array:
    if any(len(message.data) != layouts.TIMING.size for message in messages):
        raise ValueError("its rows are of another size, from another version")
    start = len(layouts.CDR_HEADER)
    return np.frombuffer(b"".join(message.data[start:] for message in messages), layouts.TIMING.dtype)


def _distribution(times_ns: Array) -> dict[str, Any] | None:
    if not len(times_ns) or not times_ns.any():
        return None
    return {**histogram(times_ns), "percentiles_us": percentiles_us(times_ns), "ticks": len(times_ns)}


def _limit_us(run: Run) -> float | None:
    """A tick later than that is a late tick, us on the wall; None where the summary does not say."""
    limit_ms = (run.summary.get("timing") or {}).get("late_beyond_ms")
    return None if limit_ms is None else limit_ms * 1e3


def _causes(rows: Array) -> list[list[Any]]:
    """[[cause, ticks, the latest by it in us], ...] of what woke late at all."""
    found = []
    for cause in Cause:
        late = rows["lateness_ns"][rows["cause"] == cause]
        if cause is not Cause.NONE and len(late):
            found.append([cause.name.lower().replace("_", " "), len(late), float(late.max()) / 1e3])
    return found


def _board(messages: list[mcap_file.Message]) -> dict[str, Any] | None:
    """What the board said of itself in TIMING frames; None where it said nothing."""
    said = []
    for message in messages:
        _, packet = layouts.HOUSEKEEPING.unpack(message.data)
        if len(packet) > 1 and packet[1] == Type.TIMING:
            try:
                said.append(frames.unpack(packet).frame)
            except frames.BadPacket:
                continue
    if not said:
        return None
    return {
        "busy": _distribution(np.array([frame.busy_ns for frame in said], np.int64)),
        "stack_bytes": max(frame.stack_bytes for frame in said),
        "rx_errors": max(frame.rx_errors for frame in said),
        "discarded_bytes": max(frame.discarded_bytes for frame in said),
    }


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
