"""A flight as the firmware's meter wants it: what went to the board tick by tick, and what it answered."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from protocol import frames
from protocol.channel import Channel
from protocol.frames import STOP_DONE, Tick, Type
from sil.budget import SCENARIOS, SETS
from sil.rig import assemble
from sil.runs import Run
from sil.scenario import Scenario, load_scenario
from sil.sinks.journal import Direction, Fate
from sil.sinks.nothing import Nothing

MANOEUVRE_A = (
    "guidance.profile=A",
    "sensors.attitude.noise_deg=0.02",
    "law.form=fixed",
    "clock=lockstep",
    "board=inproc",
    "link.url=inproc",
    "require=[]",
)
TYPE_AT = 1  # of a packet
NUMBERS = 2**16


@dataclass(frozen=True)
class Flight:
    """`ticks`: (packet that went to the board, packets it answered)."""

    law: str
    config: tuple[bytes, ...]
    ticks: tuple[tuple[bytes, tuple[bytes, ...]], ...]

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        ticks = [(sent.hex(), [packet.hex() for packet in answer]) for sent, answer in self.ticks]
        return {"law": self.law, "config": [packet.hex() for packet in self.config], "ticks": ticks}


@dataclass
class _Row:
    tick: int
    down: bool
    delivered: bool
    packet: bytes


def fly_manoeuvre_a(law: str, *sets: str) -> Flight:
    """The whole of it with noise, by the Python board in this process, in lockstep; nothing is written."""
    return fly(load_scenario(SCENARIOS[law], [*MANOEUVRE_A, *SETS.get(law, ()), *sets]))


def fly(scenario: Scenario, channel: Channel | None = None) -> Flight:
    """A scenario in lockstep, by the board that it names; nothing is written. channel: None loses nothing."""
    kept = _Kept()
    rig = assemble(scenario, kept, None, lambda line: None, channel=channel)
    try:
        rig.loop.run(lambda: False, lambda tick, motion: None)
    finally:
        rig.stop(STOP_DONE)
    return _flight(scenario.law.name, rig.config_packets, kept.rows)


def flight_of(run: Run, scenario: Scenario) -> Flight:
    """Of a recorded run of one session, in fixed point; stale SAMPLEs and further copies are left out."""
    delivered = {(row.tick, row.direction, row.packet) for row in run.packets if row.fate == "delivered"}
    rows = [
        _Row(row.tick, row.direction == "down", (row.tick, row.direction, row.packet) in delivered, row.packet)
        for row in run.packets
        if not row.copy
    ]
    config = tuple(row.packet for row in rows if row.packet[TYPE_AT] == Type.CONFIG)
    return _flight(scenario.law.name, config, [row for row in rows if row.packet[TYPE_AT] != Type.CONFIG])


@dataclass
class _Kept(Nothing):
    """Keeps the deterministic frames of a run."""

    rows: list[_Row] = field(default_factory=list)

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
        self.rows.append(_Row(tick, direction == Direction.DOWN, fate == Fate.DELIVERED, packet))


def _flight(law: str, config: tuple[bytes, ...], rows: Iterable[_Row]) -> Flight:
    ordered = sorted(rows, key=lambda row: row.tick)
    grouped = ((tick, list(group)) for tick, group in groupby(ordered, key=lambda row: row.tick))
    return Flight(law, config, tuple(_ticks(grouped)))


def _ticks(grouped: Iterable[tuple[int, list[_Row]]]) -> Iterator[tuple[bytes, tuple[bytes, ...]]]:
    """In lockstep the board gets TICK where the link lost the SAMPLE."""
    for number, (tick, rows) in enumerate(grouped):
        sent = next(row for row in rows if not row.down)
        packet = sent.packet if sent.delivered else frames.pack(Tick(tick), number % NUMBERS)
        answer = frames.in_sequence(row.packet for row in rows if row.down)
        if answer:
            yield packet, tuple(answer)
