"""Reads a running rig for the screen: what changed since the last look, in a few dozen microseconds and bounded memory.

Attitude is known at once, the reference of the same tick only with its TELEMETRY, which comes later: the last motions
are kept, so that what is subtracted belongs to one instant.
"""

from __future__ import annotations

import math
import time
from collections import deque
from typing import TYPE_CHECKING

from protocol import events
from protocol.frames import FRESH, HELD, ZERO
from sil.screen.messages import EventRow, Plan, Sample, State, Triple
from sil.signals import Motion

if TYPE_CHECKING:
    from sil.rig import Rig
    from sil.scenario import Scenario

WINDOW_S = 600.0  # simulated: a manoeuvre; what lies further back is in the log
SAMPLES = 600  # of that window
SAMPLES_A_LOOK = 50  # at most: a fast run's history is coarser, and costs no more
REMEMBERED = 64  # ticks that TELEMETRY may lag behind
MOST_NEW = 1000  # entries of one State, when the screen could not be told for a while
SHOWN = 6  # decimals of s and deg that a chart could show: what is sent is read by eyes only
DEG_PER_BAM = 360.0 / 2**32
DEG_PER_RAD = 180.0 / math.pi
SOURCES = {FRESH: "fresh", HELD: "held", ZERO: "zero"}


def plan_of(scenario: Scenario, rig: Rig) -> Plan:
    """The titles, limits and lengths of a run."""
    actuators = scenario.actuators
    period_ms = scenario.period_ns * 1e-6
    if rig.answers is None:
        law, follows = "no controller", ""
    else:
        law, follows = f"{scenario.law.name} {scenario.law.form}", "reference"
        if not scenario.telemetry_every:
            follows = "set-point"
    kind, url = rig.plugged
    baud = f" {scenario.link.baud} baud" if scenario.link.baud and kind != "none" else ""
    board = "board none" if kind == "none" else f"{kind} board over {url}{baud}" if url != kind else f"{kind} board"
    return Plan(
        scenario.name,
        (law, scenario.clock.mode, board),
        scenario.ticks * scenario.period_ns * 1e-9,
        min(scenario.ticks * scenario.period_ns * 1e-9, WINDOW_S),
        scenario.period_ns * 1e-9,
        period_ms / rig.clock.scale if rig.clock.paced else None,
        actuators.command_max,
        actuators.momentum_max_Nms,
        follows,
    )


class Reader:
    """Follows one rig. `take` once a tick; `state` as often as something is drawn."""

    def __init__(self, scenario: Scenario, rig: Rig, follows: str) -> None:
        self._rig, self._follows = rig, follows
        self._period_s = scenario.period_ns * 1e-9
        self._every = self._least = max(1, round(min(scenario.ticks, WINDOW_S / self._period_s) / SAMPLES))
        self._looked = 0  # tick of the last look
        self._patience = max(scenario.telemetry_every, 4)  # ticks to wait for TELEMETRY
        self._due = 0  # next tick of the history
        self._paired = -1  # newest tick whose attitude and reference are both known
        self._held_against: Sample | None = None
        self._recent: deque[Motion] = deque(maxlen=REMEMBERED)
        self._samples: deque[Sample] = deque(maxlen=2 * SAMPLES)
        self._events: deque[EventRow] = deque(maxlen=MOST_NEW)
        self._late_seen = self._answers_seen = 0
        self._overruns = 0
        self._began_s = 0.0  # when the first tick was over

    def take(self, tick: int, motion: Motion) -> None:
        """A tick is over; nothing is computed unless the history wants it."""
        if not self._recent:
            self._began_s = time.monotonic()
        self._recent.append(motion)
        if tick >= self._due:
            self._sample(tick, motion)

    def event(self, tick: int, code: int, a: int, b: int, origin: int) -> None:
        """Kept until the next State takes it."""
        self._overruns += code == events.OVERRUN
        self._events.append((self._time_s(tick), code, a, b, origin))

    def _sample(self, tick: int, motion: Motion) -> None:
        if not self._follows:
            self._samples.append((self._time_s(tick), _degrees(motion), None))
        elif self._pair(tick) and self._held_against is not None:
            self._samples.append(self._held_against)
        elif tick < self._due + self._patience:
            return
        else:
            self._samples.append((self._time_s(tick), _degrees(motion), None))
        self._due = tick + self._every

    def _pair(self, tick: int) -> bool:
        """Attitude and reference of the newest instant that has both; False where that is not a new one."""
        if self._follows == "set-point":
            self._held_against = self._sample_of(tick, self._recent[-1], self._rig.loop.setpoints(tick))
            return True
        telemetry = self._rig.answers.telemetry if self._rig.answers is not None else None
        if telemetry is None or telemetry.tick <= self._paired or len(telemetry.words) < 3:
            return False
        back = tick - telemetry.tick
        if not 0 <= back < len(self._recent):
            return False
        x, y, z = telemetry.words[:3]
        self._paired = telemetry.tick
        self._held_against = self._sample_of(telemetry.tick, self._recent[-1 - back], (x, y, z))
        return True

    def _sample_of(self, tick: int, motion: Motion, reference_bam: tuple[int, int, int]) -> Sample:
        x, y, z = reference_bam
        return self._time_s(tick), _degrees(motion), _shown(x * DEG_PER_BAM, y * DEG_PER_BAM, z * DEG_PER_BAM)

    def _time_s(self, tick: int) -> float:
        return round(tick * self._period_s, SHOWN)

    def state(self, tick: int, motion: Motion) -> State:
        """What is new; call `told()` when it has reached the screen, otherwise it is part of the next one too."""
        if self._follows:
            self._pair(tick)
        self._every = max(self._least, (tick - self._looked) // SAMPLES_A_LOOK)
        self._looked = tick
        loop = self._rig.loop
        acting = loop.commands.acting
        h_x, h_y, h_z = motion.momentum_B.tolist()
        late_ns = loop.lateness_ns
        return State(
            self._time_s(tick),
            time.monotonic() - self._began_s,
            _degrees(motion),
            self._held_against,
            acting.torque_Nm,
            SOURCES.get(acting.source, ""),
            (h_x, h_y, h_z),
            late_ns[max(self._late_seen, len(late_ns) - MOST_NEW) :].tolist(),
            self._new_answers_ns(),
            loop.rebased_ticks,
            self.counters(),
            list(self._samples),
            list(self._events),
        )

    def _new_answers_ns(self) -> list[int]:
        answers = self._rig.answers
        new = answers.answered - self._answers_seen if answers is not None else 0
        return list(answers.answer_ns)[-min(new, MOST_NEW) :] if answers is not None and new else []

    def told(self) -> None:
        """The last State arrived."""
        self._late_seen = len(self._rig.loop.lateness_ns)
        if self._rig.answers is not None:
            self._answers_seen = self._rig.answers.answered
        self._samples.clear()
        self._events.clear()

    def counters(self) -> dict[str, int]:
        """The names and the meaning of summary.json's `link`; empty without a board."""
        rig = self._rig
        if rig.port is None or rig.window is None or rig.answers is None:
            return {}
        port = rig.port.counters
        return {
            "missed": rig.window.missed,
            "late": rig.window.late,
            "real_misses": rig.window.real_misses,
            "overruns": self._overruns,
            "restarts": len(rig.rejoin.ticks) if rig.rejoin is not None else 0,
            "corrupted": rig.answers.corrupted,
            "crc_errors": port.crc_errors,
            "discarded_bytes": port.discarded_bytes,
            "unknown": port.unknown,
            "sequence_gaps": port.sequence_gaps,
            "duplicates": port.duplicates,
            "strangers": port.strangers,
            "strays": rig.answers.strays,
            "sent": port.sent,
            "received": port.received,
        }


def _degrees(motion: Motion) -> Triple:
    x, y, z = motion.euler_rad.tolist()
    return _shown(x * DEG_PER_RAD, y * DEG_PER_RAD, z * DEG_PER_RAD)


def _shown(x: float, y: float, z: float) -> Triple:
    return round(x, SHOWN), round(y, SHOWN), round(z, SHOWN)
