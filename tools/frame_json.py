"""Frames as JSON objects and hex, the form that SPEC.md and the conformance vectors share."""

from __future__ import annotations

from typing import Any

from protocol import frames as f

READING_NAMES = ("euler", "quaternion", "rate")


def to_json(packet: bytes) -> dict[str, Any]:
    """{"type", "sequence", "tick" (null for NO_TICK), then the frame's own fields}."""
    got = f.unpack(packet)
    fields = dict(got.frame._asdict())
    fields.pop("tick", None)
    if "readings" in fields:
        fields["readings"] = {
            name: {"age_us": reading.age_us, "values": list(reading.values)}
            for name, reading in zip(READING_NAMES, fields["readings"], strict=True)
            if reading is not None
        }
    if "nonce" in fields:
        fields["nonce"] = f"{fields['nonce']:016x}"  # more than a JSON number holds
    head = {
        "type": f.Type(got.type).name,
        "sequence": got.sequence,
        "tick": None if got.tick == f.NO_TICK else got.tick,
    }
    return head | fields


def hex_lines(data: bytes, width: int = 32) -> str:
    """Bytes as hex pairs, `width` to the line."""
    return "\n".join(data[i : i + width].hex(" ") for i in range(0, len(data), width))
