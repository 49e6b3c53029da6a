"""Plans, states and watched rigs made up for the tests of the screen."""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace
from typing import Any

import numpy as np

from protocol.frames import FRESH, Telemetry
from sil.answers import RECENT_ANSWERS
from sil.commands import Acting
from sil.screen.messages import Plan, Sample, State
from sil.screen.seen import Seen
from sil.signals import Motion


def plan(**changes: Any) -> Plan:
    """Ten minutes of a controlled satellite, paced at 25 ms a period."""
    made = Plan("name", ("law", "clock", "board"), 600.0, 600.0, 0.5, 25.0, (0.1,) * 3, (0.3,) * 3, "reference")
    return made._replace(**changes)


def state(k: int, **changes: Any) -> State:
    """Tick k of it."""
    t_s = 0.5 * k
    sample: Sample = (t_s, (1.0, 2.0, 3.0), (1.5, 2.0, -3.0))
    counters = {"missed": 0, "late": 0, "real_misses": 0, "crc_errors": 0, "sent": k}
    made = State(
        t_s, t_s / 20, sample[1], sample, (0.01, -0.1, 0.0), "fresh", (0.1, 0.0, -0.3), [50_000], [400_000], 0,
        counters, [sample], [],
    )  # fmt: skip
    return made._replace(**changes)


def seen(ticks: int = 100, **changes: Any) -> Seen:
    """What the painter knows after so many ticks; `changes` are the plan's."""
    made = Seen(plan(**changes))
    for k in range(ticks):
        made.take(state(k))
    return made


def motion(k: int) -> Motion:
    """Roll is k degrees."""
    return Motion(k, np.zeros(4), np.zeros(3), np.zeros(3), np.radians([float(k), 0.0, 0.0]), np.zeros(3))


def rig(board: bool = True, paced: bool = False) -> Any:
    """What a Reader looks at."""
    acting = Acting((0.01, 0.0, 0.0), FRESH, 0)
    loop = SimpleNamespace(
        lateness_ns=SimpleList(),
        rebased_ticks=0,
        commands=SimpleNamespace(acting=acting),
        setpoints=lambda k: (0, 0, 0),
    )
    clock = SimpleNamespace(paced=paced, scale=1.0)
    made = SimpleNamespace(
        loop=loop, clock=clock, answers=None, port=None, window=None, session=None, orders=None, plugged=("none", "")
    )
    if board:
        made.answers = SimpleNamespace(telemetry=None, answer_ns=deque(maxlen=RECENT_ANSWERS), answered=0, strays=0)
        made.plugged = ("process", "pty")
    return made


def telemetry(k: int, roll_deg: float) -> Telemetry:
    """The board's reference at tick k."""
    return Telemetry(k, 1, 1, (round(roll_deg * 2**32 / 360), 0, 0))


class SimpleList(list[int]):
    """A list that reads like the loop's array."""

    def __getitem__(self, place: Any) -> Any:
        part = super().__getitem__(place)
        return SimpleList(part) if isinstance(place, slice) else part

    def tolist(self) -> list[int]:
        return list(self)


def answered(rig: Any, answer_ns: int) -> None:
    """The board answered in time."""
    rig.answers.answered += 1
    rig.answers.answer_ns.append(answer_ns)
