"""Soak: 24 simulated hours in lockstep over a bad link, the board restarted every hour: `python -m tools.soak`.

Says at the end: what was raised, how the memory of both processes went (kB per 1000 ticks, by least squares), how often
a wall-clock timeout was used, and whether every frame that was sent has exactly one fate, with its cause. Exit 1 where
something is not as it should be, and where a fault that was asked for never showed.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from protocol import events, frames
from protocol.frames import Type
from sil.rig import Rig
from sil.runner import run_scenario
from sil.scenario import Scenario, load_scenario
from sil.signals import Motion
from sil.sinks.journal import (
    Direction,
    Fate,
    Kind,
    PacketRecord,
    read_event,
    read_housekeeping,
    read_journal,
    read_packet,
)
from sil.timeline import Restart, restarts
from sil.watch import Watch

HOUR_S = 3600.0
LOOK_EVERY_ticks = 1000
SETTLED = 0.1  # of the run: what is allocated before it says nothing of a leak
SLOPE_LIMIT_kB = 16.0  # per 1000 ticks: two numbers a tick that nobody needs
STARTED_ticks = 20  # answers to a CONFIG that was sent again while the board compiled may come until then
REMEMBERED_ticks = 600  # a row may be written so many ticks later
ENOUGH_looks = 50  # for a slope that means something
SHOWN = 5


class Look(NamedTuple):
    """Resident memory at a tick, kB."""

    tick: int
    lab_kB: int
    board_kB: int


class Onlooker(Watch):
    """Looks at the memory of both processes as the run goes on."""

    def __init__(self) -> None:
        self.looks: list[Look] = []
        self.rig: Rig | None = None
        self._began_s = time.monotonic()

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        self.rig = rig

    def note(self, line: str) -> None:
        print(line, file=sys.stderr)

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        if tick % LOOK_EVERY_ticks:
            return
        board = self.rig.host.pid if self.rig is not None and self.rig.host is not None else None
        self.looks.append(Look(tick, resident_kB(os.getpid()), resident_kB(board) if board else 0))
        if tick % (20 * LOOK_EVERY_ticks) == 0:
            per_s = tick / (time.monotonic() - self._began_s)
            print(f"tick {tick} of {ticks}, {per_s:.0f} per s: {self.looks[-1]}", file=sys.stderr, flush=True)


@dataclass
class Balance:
    """What the journal says of every frame: rows by direction, type, fate and cause; what is wrong."""

    rows: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    copies: int = 0
    wrong: list[str] = field(default_factory=list)
    events: Counter[int] = field(default_factory=Counter)
    ticks: int = 0  # that have a row
    housekeeping: Counter[tuple[int, int]] = field(default_factory=Counter)
    sessions: int = 0


@dataclass
class Answer:
    """The rows of one tick, copies apart."""

    samples: int = 0
    commands: int = 0
    followers: int = 0
    expected: int = 0


def main() -> int:
    given = _arguments()
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        scenario = load_scenario(given.scenario, overrides(given.hours, given.seed, given.board))
        report = soak(scenario, given.out or Path(folder) / "run")
        print(json.dumps(report, indent=2) if given.json else text(report))
    return 1 if report["wrong"] else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.soak", description=__doc__)
    parser.add_argument("scenario", nargs="?", default="appc-rs232")
    parser.add_argument("--hours", type=float, default=24.0, help="simulated")
    parser.add_argument("--board", default="process", help="process or native")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="keep the run here")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def overrides(hours: float, seed: int, board: str) -> list[str]:
    """--set of the soak."""
    restarts = [{"at_s": at * HOUR_S, "do": "board.restart", "for_s": 2} for at in range(1, math.ceil(hours))]
    sets = [f"duration_s={hours * HOUR_S:g}", f"seed={seed}", f"board={board}", "clock=lockstep", "require=[]"]
    sets += ["metrics.diverged_deg=null", "link.faults={drop: 0.01, bit_error_rate: 1e-5}"]
    return [*sets, f"events={json.dumps(restarts)}"]


def soak(scenario: Scenario, out: Path) -> dict[str, Any]:
    """One run, looked at while it goes on and afterwards."""
    onlooker, raised, summary = Onlooker(), "", {}
    began_s = time.monotonic()
    try:
        summary = run_scenario(scenario, out, onlooker)
    except Exception:
        raised = traceback.format_exc()
    wall_s = time.monotonic() - began_s
    balance = balanced(out / "run.journal")
    timeouts = timeouts_used(balance)
    slopes = {name: slope_kB(onlooker.looks, name) for name in ("lab_kB", "board_kB")}
    wrong = [f"raised: {raised}"] if raised else []
    wrong += [f"the run: {summary['reason']}: {summary['failure']}"] if summary.get("reason") != "finished" else []
    wrong += [*missing(scenario, balance), *balance.wrong]
    wrong += too_steep(slopes) if len(onlooker.looks) >= ENOUGH_looks else []
    wrong += [f"{count} x {what}" for what, count in timeouts.items() if count]
    return {
        "scenario": scenario.name,
        "ticks": summary.get("ticks", 0),
        "sha256": summary.get("sha256", ""),
        "wall_s": round(wall_s, 1),
        "simulated_per_wall": round(summary.get("duration_s", 0.0) / wall_s),
        "sessions": balance.sessions,
        "restarts_planned": len(planned_restarts(scenario)),
        "restarts_logged": balance.events[events.BOARD_OFF],
        "slope_kB_per_1000_ticks": {name: round(value, 3) for name, value in slopes.items()},
        "memory_kB": [look._asdict() for look in (*onlooker.looks[:1], *onlooker.looks[-1:])],
        "wall_clock_timeouts": timeouts,
        "fates": {" ".join(filter(None, key)): count for key, count in sorted(balance.rows.items())},
        "copies": balance.copies,
        "link": summary.get("link", {}),
        "wrong": wrong,
    }


def planned_restarts(scenario: Scenario) -> tuple[Restart, ...]:
    return restarts(scenario.events, scenario.period_us, scenario.ticks)


def missing(scenario: Scenario, balance: Balance) -> list[str]:
    """What was asked for and does not show in the log: restarts, their sessions, ticks, faults of the link."""
    planned = planned_restarts(scenario)
    off = sum(restart.on_tick - restart.off_tick for restart in planned)
    up, down = scenario.link.models()
    causes = {cause for _, _, fate, cause in balance.rows if fate in ("dropped", "corrupted")}
    asked = {"drop": up.drop or down.drop, "bit errors": up.bit_error_rate or down.bit_error_rate}
    counts = (
        ("restarts in the log", balance.events[events.BOARD_OFF], len(planned)),
        ("sessions", balance.sessions, len(planned) + 1),
        ("ticks with frames", balance.ticks, scenario.ticks - off),
    )
    found = [f"{what}: {count}, expected {expected}" for what, count, expected in counts if count != expected]
    silent = [cause for cause, chance in asked.items() if chance and cause not in causes]
    return found + [f"no frame was lost to {cause}" for cause in silent]


def too_steep(slopes: dict[str, float]) -> list[str]:
    return [f"{name}: {slope:.1f} kB per 1000 ticks" for name, slope in slopes.items() if slope > SLOPE_LIMIT_kB]


def resident_kB(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024
    except OSError:
        return 0


def slope_kB(looks: list[Look], name: str) -> float:
    """kB per 1000 ticks by least squares, from SETTLED of the run on."""
    late = looks[int(len(looks) * SETTLED) :]
    if len(late) < 3:
        return 0.0
    ticks, values = np.array([look.tick for look in late]), np.array([getattr(look, name) for look in late])
    return float(np.polyfit(ticks / 1000.0, values, 1)[0])


def timeouts_used(balance: Balance) -> dict[str, int]:
    """What only a wall-clock timeout sends: a HELLO again, a CONFIG again (which is answered with READY again).

    In flight: before it, a board may take its time to compile.
    """
    up, down = Direction.UP, Direction.DOWN
    return {
        "HELLO again": max(0, balance.housekeeping[up, Type.HELLO] - balance.sessions + 1),
        "READY again": max(0, balance.housekeeping[down, Type.READY] - balance.sessions + 1),
    }


def balanced(journal: Path) -> Balance:
    """Every frame of every tick has one row (copies apart), and what is not delivered says why."""
    balance = Balance()
    waiting: dict[int, Answer] = {}
    off: set[int] = set()
    for record in read_journal(journal):
        if record.kind == Kind.PACKET:
            _packet(balance, waiting, record.tick, read_packet(record.payload))
        elif record.kind == Kind.SESSION:
            balance.sessions += 1
        elif record.kind == Kind.LAB_EVENT:
            code, a, _ = read_event(record.payload)
            balance.events[code] += 1
            if code in (events.BOARD_OFF, events.BOARD_RESTARTED):
                off |= set(range(a - 2, a + 8))
        elif record.kind == Kind.HOUSEKEEPING and record.tick > STARTED_ticks:
            direction, _, packet = read_housekeeping(record.payload)
            balance.housekeeping[direction, packet[1]] += 1
        elif record.kind == Kind.COMMIT and record.tick % REMEMBERED_ticks == 0:
            _judge(balance, waiting, off, (t for t in list(waiting) if t < record.tick - REMEMBERED_ticks))
    _judge(balance, waiting, off, list(waiting))
    return balance


def _packet(balance: Balance, waiting: dict[int, Answer], tick: int, record: PacketRecord) -> None:
    type_ = record.packet[1]
    fate, cause = Fate(record.fate).name.lower(), record.cause
    direction = Direction(record.direction).name.lower()
    balance.rows[direction, Type(type_).name, fate, cause] += 1
    if fate not in ("delivered", "in_flight") and not cause:
        balance.wrong.append(f"tick {tick}: {Type(type_).name} {fate} without a cause")
    if record.copy:
        balance.copies += 1
        return
    if type_ == Type.CONFIG:
        return  # of a session
    answer = waiting.setdefault(tick, Answer())
    if type_ == Type.SAMPLE:
        answer.samples += 1
    elif type_ == Type.COMMAND:
        answer.commands += 1
        answer.expected += frames.unpack(record.packet).frame.follows
    elif type_ in (Type.TELEMETRY, Type.EVENT):
        answer.followers += 1


def _judge(balance: Balance, waiting: dict[int, Answer], off: set[int], ticks: Iterable[int]) -> None:
    """A tick has one SAMPLE, one COMMAND and what that announces; around a restart some of it may not exist."""
    for tick in ticks:
        answer = waiting.pop(tick)
        balance.ticks += 1
        most_one = answer.samples <= 1 and answer.commands <= 1 and answer.followers <= answer.expected
        whole = answer.samples == answer.commands == 1 and answer.followers == answer.expected
        if not (whole or (most_one and tick in off)):
            balance.wrong.append(f"tick {tick}: {answer}")


def text(report: dict[str, Any]) -> str:
    """For a person."""
    lines = [f"{key:<26}{value}" for key, value in report.items() if key not in ("fates", "wrong", "link")]
    lines += ["fates", *(f"  {key:<48}{count:>9}" for key, count in report["fates"].items())]
    wrong = report["wrong"]
    lines += [f"wrong: {line}" for line in wrong[:SHOWN]]
    lines += [f"... and {len(wrong) - SHOWN} more"] if len(wrong) > SHOWN else []
    return "\n".join([*lines, "" if wrong else "nothing wrong"])


if __name__ == "__main__":
    sys.exit(main())
