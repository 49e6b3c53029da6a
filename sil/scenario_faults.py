"""Faults of instruments in a scenario: which keys belong to which kind, and what contradicts what. And when they are.

The keys themselves stand in scenario_instruments.py; what faults do, in sil/sensors/faults and sil/actuators/faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from protocol import events as codes
from sil.scenario_errors import Path
from sil.scenario_events import MOST_EVENTS, Finding, Span, span, time_findings
from sil.scenario_instruments import AXES, BIASES, Actuators, Fault, Sensors

KINDS = ("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
INSTRUMENTS = ("attitude", "quaternion", "rate", "wheels", "thrusters")
ACTUATORS = ("wheels", "thrusters")
KEYS = {
    "wrong": ("scale", *BIASES),
    "slow": ("period_s",),
    "delayed": ("delay_s",),
    "intermittent": ("fraction", "on_s", "off_s"),
}
KIND_OF = {key: kind for kind, keys in KEYS.items() for key in keys}
REPLACES = ("stuck", "garbage")  # the value, whatever it would be: one of them leaves nothing for the other


class Given(NamedTuple):
    """The faults of one instrument, and where in the scenario they stand."""

    name: str  # in INSTRUMENTS
    path: Path
    faults: Sequence[Fault]
    enabled: bool


def given(sensors: Sensors, actuators: Actuators) -> tuple[Given, ...]:
    """Every instrument with its faults."""
    found = [
        Given(name, ("sensors", name, "faults"), getattr(sensors, name).faults, getattr(sensors, name).enabled)
        for name in ("attitude", "quaternion", "rate")
    ]
    found += [
        Given(name, ("actuators", name, "faults"), getattr(actuators, name).faults, actuators.kind == name)
        for name in ACTUATORS
    ]
    return tuple(found)


def notices(instruments: Sequence[Given], period_us: int, ticks: int) -> Iterator[tuple[int, int, int, int]]:
    """What the log says of faults that begin or end: (tick, code, instrument, kind)."""
    for instrument in instruments:
        a = INSTRUMENTS.index(instrument.name)
        for fault in instrument.faults:
            first, end = span(fault.at_s, fault.for_s, period_us, ticks)
            yield first, codes.FAULT_BEGINS, a, KINDS.index(fault.kind)
            if end < ticks:
                yield end, codes.FAULT_ENDS, a, KINDS.index(fault.kind)


# -- what is wrong with them -------------------------------------------------------------------------------------------


def findings(sensors: Sensors, actuators: Actuators, period_us: int, ticks: int) -> Iterator[Finding]:
    """What one fault alone, or one beside another, cannot mean."""
    for instrument in given(sensors, actuators):
        name, path, faults, enabled = instrument
        if faults and not enabled:
            yield _of_nobody(instrument, actuators)
        if len(faults) > MOST_EVENTS:
            yield Finding(path, f"at most {MOST_EVENTS} faults of an instrument", len(faults))
            continue
        when = [span(fault.at_s, fault.for_s, period_us, ticks) for fault in faults]
        for index, fault in enumerate(faults):
            here = (*path, index)
            yield from _times(here, fault, period_us, ticks)
            yield from _keys(here, fault, period_us)
            if name == "quaternion":
                yield from _of_a_quaternion(here, fault)
            if name == actuators.kind and fault.kind == "garbage":
                yield from _of_actuators(here, fault, actuators)
            for other, before in enumerate(faults[:index]):
                if _overlap(when[other], when[index]) and _share_an_axis(before, fault) and _contradict(before, fault):
                    yield Finding(
                        (*here, "kind"), f"no overlap with {path[-1]}[{other}], which is {before.kind}", fault.kind
                    )


def _of_nobody(instrument: Given, actuators: Actuators) -> Finding:
    name, path = instrument.name, instrument.path
    if name in ACTUATORS:
        return Finding(path, f"faults of the actuator that is there (actuators.kind: {name})", actuators.kind)
    return Finding(path, f"faults of a sensor that is on (sensors.{name}.enabled: true)", "false")


def _times(path: Path, fault: Fault, period_us: int, ticks: int) -> Iterator[Finding]:
    beyond = list(time_findings(path, fault.at_s, fault.for_s, period_us, ticks))
    yield from beyond
    when = span(fault.at_s, fault.for_s, period_us, ticks)
    if when.first == when.end and not beyond:
        yield Finding((*path, "for_s"), f"a time in s that covers a tick, one every {period_us / 1e6:g} s", fault.for_s)


def _keys(path: Path, fault: Fault, period_us: int) -> Iterator[Finding]:
    """Keys of another kind, and those that this kind needs."""
    kind, said = fault.kind, [key for key in KIND_OF if getattr(fault, key, None) is not None]
    for key in said:
        if KIND_OF[key] != kind:
            yield Finding((*path, key), f"no such key with {kind}: it goes with {KIND_OF[key]}", getattr(fault, key))
    if kind == "wrong" and not any(KIND_OF[key] == kind for key in said):
        bias = next(key for key in BIASES if key in type(fault).model_fields)
        yield Finding((*path, "kind"), f"scale or {bias} beside it", kind)
    if kind == "delayed" and fault.delay_s is None:
        yield Finding((*path, "delay_s"), "a number in s above 0 for delayed", None)
    if kind == "slow" and (fault.period_s is None or round(fault.period_s * 1e6) < period_us):
        yield Finding(
            (*path, "period_s"), f"a number in s, at least the run's period ({period_us / 1e6:g})", fault.period_s
        )
    if kind == "intermittent":
        at_times = (fault.on_s is not None, fault.off_s is not None)
        if at_times != ((fault.fraction is None),) * 2:
            got = " and ".join(key for key in said if KIND_OF[key] == kind) or "none of them"
            yield Finding((*path, "kind"), "fraction, or on_s and off_s, beside it", got)


def _of_a_quaternion(path: Path, fault: Fault) -> Iterator[Finding]:
    if fault.axis is not None and fault.kind != "wrong":
        yield Finding((*path, "axis"), "no axis: a quaternion is one reading (only a bias has axes)", fault.axis)
    if fault.scale is not None:
        yield Finding((*path, "scale"), "no scale of a quaternion, a bias_deg", fault.scale)


def _of_actuators(path: Path, fault: Fault, actuators: Actuators) -> Iterator[Finding]:
    limits = dict(zip(AXES, actuators.chosen.torque_max_Nm, strict=True))
    if any(limits[axis] is None for axis in fault.axis or AXES):
        yield Finding((*path, "kind"), "a torque_max_Nm, within which garbage is drawn", fault.kind)


def _contradict(one: Fault, other: Fault) -> bool:
    """Of two at a time one would have no effect; and two of a kind are one that is said wrong."""
    kinds = (one.kind, other.kind)
    return kinds[0] == kinds[1] or "off" in kinds or all(kind in REPLACES for kind in kinds)


def _overlap(one: Span, other: Span) -> bool:
    return one.first < other.end and other.first < one.end


def _share_an_axis(one: Fault, other: Fault) -> bool:
    return bool(set(one.axis or AXES) & set(other.axis or AXES))
