"""Two runs held against each other within tolerances: the same run on another machine, or not.

On another machine the plant's cosines differ in their last bit: truth departs by some 1e-12 deg. Mostly every reading
is then still rounded to the same integer, and every frame has the same bytes. Where one is not, it is one LSB off, a
sensor's of 24 bits being 2e-5 deg, and the loop answers it: attitudes of the built-in scenarios then depart by up to
1e-4 deg, torques by 1e-5 N m. The tolerances by default let that pass with a factor of ten to spare.

What is counted has to be equal: CONFIG, the frames with their ticks and fates, flags, events, counters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from protocol import frames
from sil.report.diff import as_pairs, config_difference, identity_difference, identity_lines
from sil.runs import Array, PacketRow, Run, wrapped_deg
from sil.trouble import UsageError

TELEMETRY = "telemetry"
DEFAULTS: Mapping[str, float | None] = MappingProxyType(
    {
        "attitude_deg": 1e-3,
        "q_BN": 2e-5,
        "omega_radps": 2e-5,
        "momentum_Nms": 1e-4,
        "applied_Nm": 1e-4,
        "setpoint_deg": 1e-6,
        "command_Nm": 1e-4,
        "reading_deg": 1e-3,
        "reading_q": 2e-5,
        "reading_radps": 2e-5,
        TELEMETRY: None,  # of a word's peak; shown but not judged: an innovation of one LSB is all of it
    }
)
_ANGLES = ("attitude_deg", "setpoint_deg", "reading_deg")
_READINGS = {"reading_deg": "euler_deg", "reading_q": "quaternion", "reading_radps": "rate_radps"}
_COUNTERS = ("samples_lost", "overruns", "dropped", "saturations")
_COMMAND_FIELDS = ("flags", "used", "follows")
_SAMPLE_FIELDS = ("ack", "transit_us", "age_us", "source", "present", "valid")
_CONFIG_TYPE = 1
_WORDS_SHOWN = 4


class Departure(NamedTuple):
    """How far a signal departs: at most `largest` (infinite: a number in one run only), at `tick`.

    tolerance None: not judged. beyond_tick: the first tick beyond the tolerance, None: there is none.
    """

    signal: str
    largest: float
    tick: int | None  # None: it does not depart
    tolerance: float | None
    beyond_tick: int | None


class Closeness(NamedTuple):
    """What `close` found. unequal: what has to be equal and is not, in words. within: nothing is unequal or beyond."""

    a: str
    b: str
    within: bool
    ticks: tuple[int, int]
    frames: int  # of a
    frames_other_bytes: int  # at the same place, with other content
    unequal: list[str]
    departures: list[Departure]
    identity: list[tuple[str, Any, Any]]  # what the runs say of themselves: (key, in a, in b)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: what is not finite is null."""
        found = [departure._asdict() for departure in self.departures]
        for departure in found:
            departure["largest"] = departure["largest"] if math.isfinite(departure["largest"]) else None
        return {**self._asdict(), "departures": found, "identity": as_pairs(self.identity)}


def tolerances(texts: Sequence[str]) -> dict[str, float | None]:
    """DEFAULTS with `NAME=VALUE` texts put in. Raises UsageError."""
    result = dict(DEFAULTS)
    for text_ in texts:
        name, _, value = text_.partition("=")
        if name not in DEFAULTS:
            raise UsageError(f"--tolerance: expected a signal, got {name!r}; known: {', '.join(DEFAULTS)}")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (0 <= number < math.inf):
            raise UsageError(f"--tolerance {name}: expected a number not below 0, got {value!r}")
        result[name] = number
    return result


def close(a: Run, b: Run, allowed: Mapping[str, float | None] = DEFAULTS) -> Closeness:
    """Hold b against a, at their common ticks."""
    unequal = list(_unequal(a, b))
    departures = [] if a.period_ns != b.period_ns else list(_departures(a, b, allowed))
    rows = [_counted(run) for run in (a, b)]
    return Closeness(
        str(a.path),
        str(b.path),
        not unequal and all(departure.beyond_tick is None for departure in departures),
        (len(a), len(b)),
        len(rows[0]),
        sum(x.packet[:2] + x.packet[4:-4] != y.packet[:2] + y.packet[4:-4] for x, y in zip(*rows, strict=False)),
        unequal,
        departures,
        list(identity_difference(a, b)),
    )


def text(found: Closeness) -> str:
    """The same for reading."""
    same = "CONFIG, frames and their fates, flags, counters and events are the same"
    unjudged = any(each.largest and each.tolerance is None for each in found.departures)
    verdict = f"{'within' if found.within else 'BEYOND'} tolerances: {found.ticks[0]} ticks, {found.frames} frames"
    lines = [verdict + ("; TELEMETRY departs and is not judged" if unjudged else "")]
    lines += [f"differs: {line}" for line in found.unequal] or [same]
    if not any(line.startswith(("frames", "period")) for line in found.unequal):
        lines.append(_bytes_line(found))
    if found.departures:
        lines += ["", f"{'signal':<26}{'largest departure':>19}{'at tick':>9}{'tolerance':>11}{'beyond from':>13}"]
    for signal, largest, tick, tolerance, beyond in found.departures:
        of = " of peak" if signal.startswith(TELEMETRY) and largest else ""
        row = f"{signal:<26}{_number(largest) + of:>19}{'-' if tick is None else tick:>9}"
        row += f"{'-' if tolerance is None else format(tolerance, 'g'):>11}"
        lines.append(row + (f"{'tick ' + str(beyond):>13}" if beyond is not None else ""))
    return "\n".join([*lines, *identity_lines(found.identity)])


# -- what has to be equal ----------------------------------------------------------------------------------------------


def _unequal(a: Run, b: Run) -> Iterator[str]:
    if a.period_ns != b.period_ns:
        yield f"period: {a.period_s:g} s and {b.period_s:g} s; nothing else was compared"
        return
    if len(a) != len(b):
        yield f"ticks: {len(a)} and {len(b)}"
    config = config_difference(a, b)
    yield from (f"CONFIG: {word}: {x} and {y}" for word, x, y in config[:_WORDS_SHOWN])
    if len(config) > _WORDS_SHOWN:
        yield f"CONFIG: {len(config) - _WORDS_SHOWN} words more"
    places = [[(row.tick, row.direction, row.type, row.fate) for row in _counted(run)] for run in (a, b)]
    if places[0] != places[1]:
        yield f"frames: {len(places[0])} and {len(places[1])}, {_first(places[0], places[1])}"
    events = [[(e.tick, e.origin, e.code, e.a, e.b) for e in run.events] for run in (a, b)]
    if events[0] != events[1]:
        yield f"events: {len(events[0])} and {len(events[1])}, the first other one at tick {_first_tick(*events)}"
    yield from _fields("COMMAND", a.commands, b.commands, _COMMAND_FIELDS)
    yield from _fields("SAMPLE", a.samples, b.samples, _SAMPLE_FIELDS)
    yield from _fields("truth", a.truth, b.truth, ("source",))
    yield from _counters(a, b)


def _counted(run: Run) -> list[PacketRow]:
    """Frames apart from CONFIG, which may come in other parts."""
    return [row for row in run.packets if row.type != _CONFIG_TYPE]


def _first(x: list[tuple[int, str, int, str]], y: list[tuple[int, str, int, str]]) -> str:
    """Where two lists of frames part."""
    at = next((i for i, (p, q) in enumerate(zip(x, y, strict=False)) if p != q), min(len(x), len(y)))
    said = [
        f"{_type_name(p[at][2])} {p[at][1]} {p[at][3]} at tick {p[at][0]}" if at < len(p) else "none" for p in (x, y)
    ]
    return f"the first others are {said[0]} and {said[1]}"


def _type_name(number: int) -> str:
    try:
        return frames.Type(number).name
    except ValueError:
        return f"type 0x{number:02x}"


def _first_tick(x: list[tuple[Any, ...]], y: list[tuple[Any, ...]]) -> int:
    at = next((i for i, (p, q) in enumerate(zip(x, y, strict=False)) if p != q), min(len(x), len(y)))
    return min(int(rows[at][0]) for rows in (x, y) if at < len(rows))


def _fields(what: str, x: Array, y: Array, names: Sequence[str]) -> Iterator[str]:
    """Integer fields of rows for the same ticks."""
    if not np.array_equal(x["tick"], y["tick"]):
        return  # the frames differ, or the number of ticks: said already
    for name in names:
        unlike = x[name] != y[name]
        other = np.flatnonzero(unlike.any(axis=1) if unlike.ndim == 2 else unlike)
        if other.size:
            yield f"{what} {name}: {other.size} times, first at tick {int(x['tick'][other[0]])}"


def _counters(a: Run, b: Run) -> Iterator[str]:
    """Where both runs have the TELEMETRY; that it is missing in one of them is a difference of the frames."""
    for name in _COUNTERS:
        if name in a.telemetry and name in b.telemetry:
            ticks, rows_a, rows_b = np.intersect1d(a.tick, b.tick, return_indices=True)
            x, y = a[name][rows_a], b[name][rows_b]
            other = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & (x != y))
            if other.size:
                yield f"TELEMETRY {name}: first at tick {int(ticks[other[0]])}"


# -- what may depart ---------------------------------------------------------------------------------------------------


def _departures(a: Run, b: Run, allowed: Mapping[str, float | None]) -> Iterator[Departure]:
    for name, (tick, x, y) in _pairs(a, b):
        relative = name.startswith(TELEMETRY)
        scale = 1.0 / (max(_peak(x), _peak(y)) or 1.0) if relative else 1.0
        apart = _apart(x, y, name in _ANGLES) * scale
        apart = apart.reshape(len(tick), -1).max(axis=1, initial=0.0)
        worst = int(np.argmax(apart)) if apart.any() else None
        limit = allowed[TELEMETRY if relative else name]
        beyond = np.flatnonzero(apart > limit) if limit is not None else np.empty(0, int)
        yield Departure(
            name,
            float(apart[worst]) if worst is not None else 0.0,
            int(tick[worst]) if worst is not None else None,
            limit,
            int(tick[beyond[0]]) if beyond.size else None,
        )


def _peak(values: Array) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _pairs(a: Run, b: Run) -> Iterator[tuple[str, tuple[Array, Array, Array]]]:
    """(signal, (ticks, values in a, values in b)), signals without any values left out."""
    tick, rows_a, rows_b = np.intersect1d(a.tick, b.tick, return_indices=True)
    for name in DEFAULTS:
        if name in _READINGS:
            ticks, in_a, in_b = np.intersect1d(a.samples["tick"], b.samples["tick"], return_indices=True)
            pair = ticks, a.samples[_READINGS[name]][in_a], b.samples[_READINGS[name]][in_b]
        elif name != TELEMETRY:
            pair = tick, a[name][rows_a], b[name][rows_b]
        else:
            continue
        if np.isfinite(pair[1]).any() or np.isfinite(pair[2]).any():
            yield name, pair
    words = [word for word in a.telemetry if word in b.telemetry and word not in _COUNTERS]
    for word in dict.fromkeys(word.rpartition("_")[0] if word[-2:] in ("_x", "_y", "_z") else word for word in words):
        parts = [part for part in words if part == word or part.rpartition("_")[0] == word]
        columns = [np.column_stack([run[part][rows] for part in parts]) for run, rows in ((a, rows_a), (b, rows_b))]
        yield f"{TELEMETRY} {word}", (tick, columns[0], columns[1])


def _apart(x: Array, y: Array, angle: bool = False) -> Array:
    """|x - y|; 0 where neither is a number, infinite where only one is."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(wrapped_deg(x - y)) if angle else np.abs(x - y)
    difference = np.where((x == y) | (np.isnan(x) & np.isnan(y)), 0.0, difference)
    return np.where(np.isnan(difference), np.inf, difference)


def _number(value: float) -> str:
    return "0" if value == 0 else "in one run only" if math.isinf(value) else f"{value:.3g}"


def _bytes_line(found: Closeness) -> str:
    if not found.frames_other_bytes:
        departs = any(departure.largest for departure in found.departures)
        return "every frame has the same bytes" + (": only the plant's arithmetic departs" if departs else "")
    return f"{found.frames_other_bytes} of {found.frames} frames have other bytes"
