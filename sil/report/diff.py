"""Two runs held against each other: identical, or the first frame that differs, decoded side by side.

Frames are compared in recorded order (tick, direction, type, sequence) with all their bytes and their fate, then truth
row by row, bit for bit. What the runs were (scenario, seed, versions, hashes) is reported beside, as is whether the
files are the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from protocol import frames
from protocol.law_tables import COMMON, LAWS, TELEMETRY_COMMON
from sil.runs import PacketRow, Run, wrapped_deg

ABSENT = "(absent)"


class PacketDifference(NamedTuple):
    """The first frame that differs: its fields in both runs; `differing` names those with other values."""

    tick: int
    what: str  # such as "COMMAND, down"
    a: dict[str, Any]
    b: dict[str, Any]
    differing: list[str]


class TruthDifference(NamedTuple):
    """Where the motion departs and how far it got, over the ticks that both runs have."""

    first_tick: int
    max_attitude_deg: float
    max_attitude_tick: int
    max_rate_radps: float
    max_torque_Nm: float


class Difference(NamedTuple):
    """What `diff` found. `identical`: same frames, fates, truth and length; versions may differ all the same."""

    a: str
    b: str
    identical: bool
    same_file: bool
    ticks: tuple[int, int]
    compared_packets: int  # equal ones before the first difference
    packet: PacketDifference | None
    truth: TruthDifference | None
    identity: list[tuple[str, Any, Any]]  # (key, in a, in b)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: what is not a number is null."""
        truth = self.truth._asdict() if self.truth else {}
        return {
            **self._asdict(),
            "packet": self.packet._asdict() if self.packet else None,
            "truth": {key: value if np.isfinite(value) else None for key, value in truth.items()} or None,
            "identity": [{"key": key, "a": a, "b": b} for key, a, b in self.identity],
        }


def diff(a: Run, b: Run) -> Difference:
    """Compare two runs."""
    equal, packet = _first_packet(a, b)
    truth = _truth(a, b)
    return Difference(
        str(a.path),
        str(b.path),
        packet is None and truth is None and len(a) == len(b),
        a.path.read_bytes() == b.path.read_bytes(),
        (len(a), len(b)),
        equal,
        packet,
        truth,
        list(_identity(a, b)),
    )


def text(found: Difference) -> str:
    """The difference for reading."""
    if found.identical:
        files = "same file bytes" if found.same_file else "the files differ in what the runs say of themselves"
        lines = [f"identical: {found.ticks[0]} ticks, {found.compared_packets} frames, truth bit for bit; {files}"]
    else:
        lines = list(_packet_lines(found)) + list(_truth_lines(found))
    if found.identity:
        lines += ["", f"{'what the runs were':<36}{'a':<28}b"]
        lines += [f"  {key:<34}{_cell(x):<28}{_cell(y)}" for key, x, y in found.identity]
    return "\n".join(lines)


def fields_of(packet: bytes) -> dict[str, Any]:
    """A packet's fields by name, TELEMETRY and CONFIG words by their table's names; `unreadable` where it is none."""
    try:
        whole = frames.unpack(packet)
    except frames.BadPacket as error:
        return {"unreadable": str(error), "bytes": packet.hex()}
    frame = whole.frame
    fields: dict[str, Any] = {"type": frames.Type(whole.type).name, "sequence": whole.sequence}
    for name, value in frame._asdict().items():
        if name == "words":
            fields |= _named_words(frame)
        elif name == "readings":
            names = ("euler", "quaternion", "rate")
            fields |= {n: list(r.values) + [f"age {r.age_us} us"] for n, r in zip(names, value, strict=True) if r}
        else:
            fields[name] = list(value) if isinstance(value, tuple) else value
    return fields


def _named_words(frame: frames.Telemetry | frames.Config) -> dict[str, int]:
    if isinstance(frame, frames.Telemetry):
        law = LAWS.get((frame.law_id, frame.law_version))
        names = [word.name for word in (*TELEMETRY_COMMON, *(law.telemetry if law else ()))]
        first = 0
    else:
        names, first = [word.name for word in COMMON], frame.offset
    place = enumerate(frame.words, first)
    return {names[i] if i < len(names) else f"word_{i}": value for i, value in place}


def _first_packet(a: Run, b: Run) -> tuple[int, PacketDifference | None]:
    """(equal frames before it, the first difference)."""
    for count, (x, y) in enumerate(zip_longest(a.packets, b.packets)):
        if x == y:
            continue
        if x is not None and y is not None and _place(x) != _place(y):
            x, y = (x, None) if _place(x) < _place(y) else (None, y)  # the earlier one is missing in the other run
        return count, _compared(x, y)
    return len(a.packets), None


def _place(row: PacketRow) -> tuple[int, bool, int, int]:
    return row.tick, row.direction == "down", row.type, row.sequence


def _compared(x: PacketRow | None, y: PacketRow | None) -> PacketDifference:
    row = x or y
    assert row is not None
    a, b = ({} if r is None else {**fields_of(r.packet), "fate": r.fate} for r in (x, y))
    if x is not None and y is not None and x.encoded != y.encoded:
        a["encoded"], b["encoded"] = x.encoded.hex(), y.encoded.hex()
    names = dict.fromkeys([*a, *b])
    differing = [name for name in names if a.get(name, ABSENT) != b.get(name, ABSENT)]
    try:
        type_name = frames.Type(row.type).name
    except ValueError:
        type_name = f"type 0x{row.type:02x}"
    return PacketDifference(row.tick, f"{type_name}, {row.direction}", a, b, differing)


def _truth(a: Run, b: Run) -> TruthDifference | None:
    ticks, rows_a, rows_b = np.intersect1d(a.tick, b.tick, return_indices=True)
    x, y = a.truth[rows_a], b.truth[rows_b]
    unequal = np.flatnonzero([p != q for p, q in zip(_bits(x), _bits(y), strict=True)])
    if not unequal.size:
        return None
    attitude = np.abs(wrapped_deg(x["euler_deg"] - y["euler_deg"])).max(axis=1)
    worst = int(np.argmax(np.where(np.isfinite(attitude), attitude, np.inf)))
    return TruthDifference(
        int(ticks[unequal[0]]),
        float(attitude[worst]),
        int(ticks[worst]),
        float(np.abs(x["omega_bn_b_radps"] - y["omega_bn_b_radps"]).max()),
        float(np.abs(x["applied_nm"] - y["applied_nm"]).max()),
    )


def _bits(rows: Any) -> list[bytes]:
    size = rows.dtype.itemsize
    data = rows.tobytes()
    return [data[i : i + size] for i in range(0, len(data), size)]


def _identity(a: Run, b: Run) -> Iterator[tuple[str, Any, Any]]:
    x, y = ({**_flat(run.meta), **_flat(run.scenario, "scenario.")} for run in (a, b))
    for key in dict.fromkeys([*x, *y]):
        if x.get(key, ABSENT) != y.get(key, ABSENT):
            yield key, x.get(key, ABSENT), y.get(key, ABSENT)


def _flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[prefix + str(key)] = value
    return flat


# -- text --------------------------------------------------------------------------------------------------------------


def _packet_lines(found: Difference) -> Iterator[str]:
    packet = found.packet
    if packet is None:
        yield f"same frames ({found.compared_packets})"
        return
    yield f"differs at tick {packet.tick}: {packet.what}, after {found.compared_packets} equal frames"
    if not packet.a or not packet.b:
        yield f"  it is only in {'b' if packet.b else 'a'}"
    yield f"  {'field':<20}{'a':<40}b"
    for name in dict.fromkeys([*packet.a, *packet.b]):
        mark = "*" if name in packet.differing else " "
        yield f"{mark} {name:<20}{_cell(packet.a.get(name, ABSENT)):<40}{_cell(packet.b.get(name, ABSENT))}"


def _truth_lines(found: Difference) -> Iterator[str]:
    if found.ticks[0] != found.ticks[1]:
        yield f"ticks: {found.ticks[0]} and {found.ticks[1]}"
    truth = found.truth
    if truth is None:
        yield "truth: the same bit for bit over the common ticks"
        return
    yield (
        f"truth differs from tick {truth.first_tick} on: attitude by up to {truth.max_attitude_deg:.3g} deg (tick "
        f"{truth.max_attitude_tick}), rate {truth.max_rate_radps:.3g} rad/s, torque {truth.max_torque_Nm:.3g} N m"
    )


def _cell(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
