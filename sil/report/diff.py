"""Two runs held against each other: identical, or the first frame that differs, decoded side by side.

Frames are compared in recorded order (tick, direction, type, sequence) with all their bytes and their fate, then truth
row by row, bit for bit. CONFIG is compared word by word and reported apart, so that the first frame that differs tells
what another parameter led to. What the runs were (scenario, seed, versions, hashes) is reported beside, as is whether
the files are the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from protocol import frames
from protocol.law_tables import COMMON, LAWS, ROW_WORDS, TELEMETRY_COMMON, LawTable
from sil.plain import flat
from sil.runs import PacketRow, Run, wrapped_deg
from sil.sinks.events import describe

ABSENT = "(absent)"
_FIELDS_SHOWN = 16  # of longer frames only what differs is printed
_LINES_SHOWN = 12
_CONFIG_TYPE = 1
_CELL = 34  # characters


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
    """What `diff` found. `identical`: same CONFIG, frames, fates, truth and length; versions may still differ."""

    a: str
    b: str
    identical: bool
    same_file: bool
    ticks: tuple[int, int]
    compared_packets: int  # equal ones before the first difference, CONFIG apart
    config: list[tuple[str, Any, Any]]  # words that differ: (name, in a, in b), wire units
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
            "config": [{"word": word, "a": a, "b": b} for word, a, b in self.config],
            "identity": as_pairs(self.identity),
        }


def as_pairs(identity: Sequence[tuple[str, Any, Any]]) -> list[dict[str, Any]]:
    """The same for JSON."""
    return [{"key": key, "a": a, "b": b} for key, a, b in identity]


def diff(a: Run, b: Run) -> Difference:
    """Compare two runs."""
    equal, packet = _first_packet(a, b)
    truth = _truth(a, b)
    config = config_difference(a, b)
    return Difference(
        str(a.path),
        str(b.path),
        not config and packet is None and truth is None and len(a) == len(b),
        a.path.read_bytes() == b.path.read_bytes(),
        (len(a), len(b)),
        equal,
        config,
        packet,
        truth,
        list(identity_difference(a, b)),
    )


def text(found: Difference) -> str:
    """The difference for reading."""
    if found.identical:
        files = "same file bytes" if found.same_file else "the files differ in what the runs say of themselves"
        lines = [f"identical: {found.ticks[0]} ticks, {found.compared_packets} frames, truth bit for bit; {files}"]
    else:
        lines = [f"CONFIG differs: {word}: {x} and {y}" for word, x, y in found.config[:_LINES_SHOWN]]
        if len(found.config) > _LINES_SHOWN:
            lines.append(f"CONFIG differs in {len(found.config) - _LINES_SHOWN} words more")
        lines += [*_packet_lines(found), *_truth_lines(found)]
    return "\n".join([*lines, *identity_lines(found.identity)])


def identity_lines(identity: Sequence[tuple[str, Any, Any]]) -> list[str]:
    """What the runs were, side by side; [] where they were the same."""
    if not identity:
        return []
    lines = ["", f"{'what the runs were':<38}{'a':<36}b"]
    return [*lines, *(f"  {key:<35} {_short(x):<35} {_short(y)}" for key, x, y in identity)]


def fields_of(packet: bytes, law: LawTable | None = None) -> dict[str, Any]:
    """A packet's fields by name, words by the names of the law's table; `unreadable` where it cannot be unpacked."""
    try:
        whole = frames.unpack(packet)
    except frames.BadPacket as error:
        return {"unreadable": str(error), "bytes": packet.hex()}
    frame = whole.frame
    fields: dict[str, Any] = {"type": frames.Type(whole.type).name, "sequence": whole.sequence}
    for name, value in frame._asdict().items():
        if name == "words":
            fields |= _named_words(frame, law)
        elif name == "readings":
            names = ("euler", "quaternion", "rate")
            fields |= {n: list(r.values) + [f"age {r.age_us} us"] for n, r in zip(names, value, strict=True) if r}
        else:
            fields[name] = list(value) if isinstance(value, tuple) else value
    if isinstance(frame, frames.Event):
        fields["meaning"] = describe(frame.code, frame.a, frame.b)[1]
    return fields


def _named_words(frame: frames.Telemetry | frames.Config, law: LawTable | None) -> dict[str, int]:
    if isinstance(frame, frames.Telemetry):
        names, first = [word.name for word in (*TELEMETRY_COMMON, *(law.telemetry if law else ()))], 0
        return {names[i] if i < len(names) else f"word_{i}": value for i, value in enumerate(frame.words)}
    names, first = [word.name for word in (*COMMON, *(law.params if law else ()))], frame.offset
    return {_config_name(i, names, law): value for i, value in enumerate(frame.words, first)}


def _config_name(index: int, names: list[str], law: LawTable | None) -> str:
    """A CONFIG word's name: COMMON, the law's parameters, then guidance rows."""
    if index < len(names):
        return names[index]
    if law is None:
        return f"word_{index}"
    row, part = divmod(index - len(names), ROW_WORDS)
    return f"row {row} {('tick', 'x', 'y', 'z')[part]}"


def _law_of(run: Run) -> LawTable | None:
    return LAWS.get((run.config_words.get("law_id", 0), run.config_words.get("law_version", 0)))


def _first_packet(a: Run, b: Run) -> tuple[int, PacketDifference | None]:
    """(equal frames before it, the first difference)."""
    laws = _law_of(a), _law_of(b)
    rows = [[row for row in run.packets if row.type != _CONFIG_TYPE] for run in (a, b)]
    after = [sum(row.type == _CONFIG_TYPE for row in run.packets) for run in (a, b)]
    for count, (x, y) in enumerate(zip_longest(*rows)):
        if x is not None and y is not None and _counted(x, after[0]) == _counted(y, after[1]):
            continue
        if x is not None and y is not None and _place(x) != _place(y):
            x, y = (x, None) if _place(x) < _place(y) else (None, y)  # the earlier one is missing in the other run
        return count, _compared(x, y, laws)
    return len(rows[0]), None


def config_difference(a: Run, b: Run) -> list[tuple[str, Any, Any]]:
    """Words of CONFIG that differ: (name, in a, in b), wire units."""
    named = []
    for run in (a, b):
        law = _law_of(run)
        names = [word.name for word in (*COMMON, *(law.params if law else ()))]
        words = enumerate(run.config_words.get("words", ()))
        named.append({_config_name(i, names, law): value for i, value in words})
    x, y = named
    pairs = ((name, x.get(name, ABSENT), y.get(name, ABSENT)) for name in dict.fromkeys([*x, *y]))
    return [pair for pair in pairs if pair[1] != pair[2]]


def _counted(row: PacketRow, config_parts: int) -> tuple[Any, ...]:
    """A frame to compare: its number is counted from the end of CONFIG, whose parts may be more in one of the runs."""
    sequence = (row.sequence - config_parts) & 0xFFFF if row.direction == "up" else row.sequence
    what = row.fate, row.cause, row.packet[:2], row.packet[4:-4], row.encoded
    return row.tick, row.direction, row.type, sequence, row.copy, *what


def _place(row: PacketRow) -> tuple[int, bool, int]:
    return row.tick, row.direction == "down", row.type


def _compared(
    x: PacketRow | None, y: PacketRow | None, laws: tuple[LawTable | None, LawTable | None]
) -> PacketDifference:
    row = x or y
    assert row is not None
    pairs = zip((x, y), laws, strict=True)
    a, b = (
        {} if r is None else {**fields_of(r.packet, law), "fate": r.fate, "cause": r.cause, "copy": r.copy}
        for r, law in pairs
    )
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


def identity_difference(a: Run, b: Run) -> Iterator[tuple[str, Any, Any]]:
    """What the runs say of themselves: (key, in a, in b) where that differs."""
    x, y = ({**flat(run.meta), **flat(run.scenario, "scenario.")} for run in (a, b))
    for key in dict.fromkeys([*x, *y]):
        if x.get(key, ABSENT) != y.get(key, ABSENT):
            yield key, x.get(key, ABSENT), y.get(key, ABSENT)


# -- text --------------------------------------------------------------------------------------------------------------


def _packet_lines(found: Difference) -> Iterator[str]:
    packet = found.packet
    if packet is None:
        yield f"frames: the same ({found.compared_packets}), CONFIG apart" if found.config else "frames: the same"
        return
    yield f"differs at tick {packet.tick}: {packet.what}, after {found.compared_packets} equal frames"
    if not packet.a or not packet.b:
        yield f"  it is only in {'b' if packet.b else 'a'}"
    yield f"  {'field':<24}{'a':<36}b"
    names = list(dict.fromkeys([*packet.a, *packet.b]))
    shown = names if len(names) <= _FIELDS_SHOWN else packet.differing
    for name in shown:
        mark = "*" if name in packet.differing else " "
        yield f"{mark} {name:<24}{_cell(packet.a.get(name, ABSENT)):<36}{_cell(packet.b.get(name, ABSENT))}"
    if len(shown) < len(names):
        yield f"  ({len(names) - len(shown)} equal fields not shown)"


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


def _short(value: Any) -> str:
    """One cell of a table: what is too long for it is cut, since --json has it whole."""
    text_ = _cell(value)
    return text_ if len(text_) <= _CELL else text_[: _CELL - 1] + "…"
