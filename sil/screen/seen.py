"""What the process that draws knows of the run: the newest state, and bounded histories of what came before."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from sil.screen.messages import EventRow, Plan, Sample, State, Triple, error_deg
from sil.sinks.events import describe

TIMES = 2000  # wake-ups and answers that percentiles are taken of
EVENTS = 100
SAMPLES = 4000
NEAR = 4  # an event of a kind that is among the last few is counted there


class Past(NamedTuple):
    """One instant of the history, deg."""

    t_s: float
    attitude: Triple
    reference: Triple | None
    error: Triple | None


@dataclass
class Happening:
    """One or several events of one kind; time and numbers are the last one's."""

    t_s: float
    code: int
    a: int
    b: int
    origin: int
    count: int = 1

    @property
    def who(self) -> str:
        return "board" if self.origin else "laboratory"

    def words(self) -> tuple[str, str]:
        """(level, text)."""
        return describe(self.code, self.a, self.b)


class Times:
    """The last wall times of one kind, in ms, and the worst of all."""

    def __init__(self) -> None:
        self._last: deque[float] = deque(maxlen=TIMES)
        self.worst = 0.0

    def add(self, times_ns: Iterable[int]) -> None:
        for time_ns in times_ns:
            self._last.append(time_ns * 1e-6)
            self.worst = max(self.worst, time_ns * 1e-6)

    def __bool__(self) -> bool:
        return bool(self._last)

    @property
    def now(self) -> float:
        return self._last[-1]

    def percentile(self, percent: float) -> float:
        """The smallest time that at least `percent` of the last ones do not exceed."""
        ordered = sorted(self._last)
        return ordered[max(math.ceil(len(ordered) * percent / 100), 1) - 1]


@dataclass
class Seen:
    """All that a view is made of."""

    plan: Plan
    state: State | None = None
    past: deque[Past] = field(default_factory=lambda: deque(maxlen=SAMPLES))  # of the plan's window
    peaks: list[float] = field(default_factory=lambda: [0.0] * 3)  # of the run: |error|, or |attitude| without one
    happenings: deque[Happening] = field(default_factory=lambda: deque(maxlen=EVENTS))
    late: Times = field(default_factory=Times)
    answers: Times = field(default_factory=Times)
    torque_seen_Nm: float = 0.0
    momentum_seen_Nms: float = 0.0
    ended: bool = False

    def take(self, state: State) -> None:
        """The next state."""
        self.state = state
        for sample in state.samples:
            self._sample(sample)
        self.late.add(state.late_ns)
        self.answers.add(state.answer_ns)
        self.torque_seen_Nm = max(self.torque_seen_Nm, *_finite(state.torque_Nm))
        self.momentum_seen_Nms = max(self.momentum_seen_Nms, *_finite(state.momentum_Nms))
        for row in state.events:
            self._event(row)

    def _sample(self, sample: Sample) -> None:
        t_s, attitude, reference = sample
        error = error_deg(sample)
        self.past.append(Past(t_s, attitude, reference, error))
        while self.past[0].t_s < t_s - self.plan.window_s:
            self.past.popleft()
        values = error if self.plan.follows else attitude
        if values is not None:
            self.peaks = [max(peak, value) for peak, value in zip(self.peaks, _finite(values), strict=True)]

    def _event(self, row: EventRow) -> None:
        t_s, code, a, b, origin = row
        near = list(self.happenings)[-NEAR:]
        same = next((one for one in near if (one.code, one.origin) == (code, origin)), None)
        if same is None:
            self.happenings.append(Happening(t_s, code, a, b, origin))
            return
        same.t_s, same.a, same.b, same.count = t_s, a, b, same.count + 1

    @property
    def share(self) -> float:
        """0..1 of the run."""
        if self.state is None:
            return 0.0
        return min((self.state.t_s + self.plan.period_s) / self.plan.duration_s, 1.0)

    @property
    def times_real_time(self) -> float:
        state = self.state
        return state.t_s / state.wall_s if state is not None and state.wall_s > 0 else 0.0

    @property
    def left_s(self) -> float | None:
        """Wall time to the planned end; None before anything can be said."""
        if self.state is None or not self.times_real_time:
            return None
        return max(self.plan.duration_s - self.state.t_s - self.plan.period_s, 0.0) / self.times_real_time


def _finite(values: Iterable[float]) -> list[float]:
    return [abs(value) if math.isfinite(value) else 0.0 for value in values]
