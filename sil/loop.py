""">>> READ FIRST: one tick of the laboratory, in order. The transport delay is one variable, `delay`, written once.

    t_k        drain the link -> decide what acts -> read the sensors -> send SAMPLE(k) -> integrate to t_k+1 -> record
    the board  ... computes COMMAND(k) meanwhile; it acts from t_(k+delay) on

Nothing here reads a wall clock: the `Clock` says when a tick happens, tick numbers say everything else.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from protocol import events
from protocol.frames import Reading, Sample
from sil.clock import Clock
from sil.commands import Acting, Decides
from sil.lateness import QUIET, Account, Cause, Wake
from sil.signals import Actuator, Counterpart, Motion, Observer, Plant, Recorder, Sensor, Vector

LARGEST = 2**31 - 1


class PlantBroke(Exception):
    """The plant's state is not a number at this tick."""


class Timing(NamedTuple):
    """The integers one run's loop counts in."""

    period_ns: int
    delay: int  # transport_delay_ticks n: COMMAND(j) acts from t_(j+n) on
    ticks: int
    first_tick: int = 0


class Scales(NamedTuple):
    """Values of one least significant bit on the wire."""

    torque_Nm: float
    momentum_Nms: float


class Loop:
    """Plant, sensors and actuators on one side of the cable, the board on the other; `rig.py` plugs them together."""

    def __init__(
        self,
        timing: Timing,
        scales: Scales,
        plant: Plant,
        actuator: Actuator,
        sensors: Sequence[Sensor],
        setpoints: Callable[[int], tuple[int, int, int]],
        board: Counterpart,
        commands: Decides,
        recorder: Recorder,
        clock: Clock,
        bound_deg: float | None = None,
        planned: Iterable[tuple[int, int, int, int]] = (),
        units: Sequence[Observer] = (),
    ) -> None:
        self.timing, self.scales = timing, scales
        self.plant, self.actuator, self.sensors, self.setpoints = plant, actuator, sensors, setpoints
        self.board, self.commands, self.recorder, self.clock = board, commands, recorder, clock
        self.units = units  # those of the sensors that look at instants of their own
        self.period_s = timing.period_ns * 1e-9
        self.bound_rad = None if bound_deg is None else math.radians(bound_deg)
        self.planned: dict[int, list[tuple[int, int, int]]] = {}  # events (code, a, b) that the scenario asks for
        for tick, *event in sorted(planned):
            self.planned.setdefault(tick, []).append((event[0], event[1], event[2]))
        self.ticks_done = timing.first_tick
        self.account = Account()
        self.lateness_ns, self.causes = array("q"), array("B")  # of every wake-up of a paced run
        self.rebased_ticks = self.slipped_ns = 0  # how often the epoch was moved, and how far in all
        self._wakes: dict[int, Wake] = {}  # of the ticks that are not yet whole

    def tick(self, k: int) -> Motion:
        """One tick. With delay 0 (lockstep only) the plant waits for COMMAND(k) before it integrates."""
        delay, t_ns = self.timing.delay, k * self.timing.period_ns
        self.board.drain(k - 1)  # (1)
        self._timing(k - 1)
        acting = self.commands.decide(k - delay) if delay else self.commands.acting  # (2)
        motion = self.plant.motion(t_ns)
        if not is_finite(motion):
            raise PlantBroke(k)
        applied = self._limited(acting, motion, k if delay else k - 1)
        self.account.call(Cause.LINK_WRITE, self.board.send, self._sample(k, motion, acting, applied), t_ns)  # (3) (4)
        self._commit(k - 1)  # tick k - 1 is whole only now, with its answer; the board works meanwhile
        if not delay:
            self.board.drain(k)
            applied = self._limited(self.commands.decide(k), motion, k)
        self._integrate(applied, t_ns)  # (5)
        self._record(k, motion, applied)  # (6)
        return motion

    def run(self, stop: Callable[[], bool], progress: Callable[[int, Motion], None]) -> tuple[int, str]:
        """All ticks; returns (ticks done, reason): `finished`, or `interrupted` when `stop()` said so."""
        if not self.clock.paced:
            return self._run(stop, progress)
        with self.account:
            return self._run(stop, progress)

    def _run(self, stop: Callable[[], bool], progress: Callable[[int, Motion], None]) -> tuple[int, str]:
        first = self.timing.first_tick
        self.clock.start(first * self.timing.period_ns)
        for k in range(first, self.timing.ticks):
            if stop():
                self.board.finish(k - 1, overdue=False)
                return self._ended(k, "interrupted")
            self._await_tick(k)
            try:
                motion = self.tick(k)
            except PlantBroke:
                self.recorder.event(k, events.PLANT_NAN, k, 0)
                return self._ended(k, "diverged")
            self.account.call(Cause.OWN_WORK, progress, k, motion)
            if self._beyond(k, motion):
                return self._last(k, "diverged")
        return self._last(self.timing.ticks - 1, "finished")

    def _last(self, k: int, reason: str) -> tuple[int, str]:
        """Tick k was the last one: its command would act from the next on, and is waited for until then."""
        if self.clock.paced:
            self.clock.wait((k + 1) * self.timing.period_ns, self.board.listen)
        self.board.finish(k, overdue=True)
        return self._ended(k + 1, reason)

    def _ended(self, ticks: int, reason: str) -> tuple[int, str]:
        self._timing(ticks - 1)
        self._notices(ticks - 1)
        self._commit(ticks - 1)
        return ticks, reason

    def _beyond(self, k: int, motion: Motion) -> bool:
        """An attitude angle beyond the scenario's bound ends the run: what follows says nothing more about the law."""
        if self.bound_rad is None:
            return False
        angles = [abs(angle) for angle in motion.euler_rad.tolist()]
        if max(angles) <= self.bound_rad:
            return False
        axis = angles.index(max(angles))
        self.recorder.event(k, events.DIVERGED, axis, round(math.degrees(angles[axis]) * 1000))
        return True

    def _await_tick(self, k: int) -> None:
        """Sleep to the deadline; a wake-up more than a period late moves the epoch, so ticks are never burst."""
        if not self.clock.paced:
            return
        t_ns = k * self.timing.period_ns
        self.account.sleeps()
        late_ns = self.clock.wait(t_ns, self.account.listening(self.board.listen))
        wake = self._wakes[k] = self.account.woke(late_ns)
        self.lateness_ns.append(late_ns)
        self.causes.append(wake.cause)
        if late_ns > self.timing.period_ns / self.clock.scale:
            self.rebased_ticks += 1
            self.slipped_ns += late_ns
            self.recorder.event(k, events.EPOCH_REBASED, k, min(late_ns // 1000, 2**31 - 1))
            self.clock.rebase(t_ns)
            self.account.rebased()

    def _limited(self, acting: Acting, motion: Motion, tick: int) -> Vector:
        """What comes of the command in `tick`; with delay 0 SAMPLE(k) says what acted until t_k, in the tick before."""
        command_Nm = np.array(acting.torque_Nm)
        return self.actuator.limit(command_Nm, motion.momentum_B, self.period_s, tick)

    def _sample(self, k: int, motion: Motion, acting: Acting, applied: Vector) -> Sample:
        """What the board is told: readings, set-point, and what is really applied now."""
        readings: list[Reading | None] = [None, None, None]
        valid = 0
        for sensor in self.sensors:
            readings[sensor.bit] = sensor.read(motion, k)
            valid |= sensor.valid << sensor.bit
        torque = to_lsb(applied, self.scales.torque_Nm)
        momentum = to_lsb(motion.momentum_B, self.scales.momentum_Nms)
        euler, quaternion, rate = readings
        shown = (euler, quaternion, rate)
        return Sample(k, self.setpoints(k), torque, momentum, acting.ack, 0, acting.source, valid, shown)

    def _integrate(self, applied: Vector, t_ns: int) -> None:
        """To t_k+1. Whoever looks in between sees the truth of that very instant, a whole number of microseconds."""
        end_ns = t_ns + self.timing.period_ns
        while (stop_ns := min([end_ns, *[unit.due_ns for unit in self.units]])) < end_ns:
            if stop_ns > t_ns:
                self.plant.advance(applied, t_ns, stop_ns - t_ns)
            motion, t_ns = self.plant.motion(stop_ns), stop_ns
            if not is_finite(motion):
                break  # the next tick says so
            for unit in self.units:
                if unit.due_ns == stop_ns:
                    unit.observe(motion)
        self.plant.advance(applied, t_ns, end_ns - t_ns)

    def _record(self, k: int, motion: Motion, applied: Vector) -> None:
        for event in self.planned.get(k, ()):
            self.recorder.event(k, *event)
        self._notices(k)
        self.recorder.truth(motion, applied, self.setpoints(k), self.commands.acting.source, k)
        self.ticks_done = k + 1

    def _timing(self, k: int) -> None:
        """Host times of tick k, known once its answer is here."""
        if k >= self.timing.first_tick:
            self.recorder.timing(k, self._wakes.pop(k, QUIET), self.board.last_answer_ns)

    def _commit(self, k: int) -> None:
        """Tick k is whole: one write."""
        self.account.call(Cause.LOG_WRITE, self.recorder.commit, max(k, 0))

    def _notices(self, k: int) -> None:
        for code, a, b in self.commands.notices:
            self.recorder.event(k, code, a, b)
        self.commands.notices.clear()


def is_finite(motion: Motion) -> bool:
    """No part of the motion is infinite or not a number."""
    _, q, w, h, e, r = motion
    return math.isfinite(sum(q.tolist()) + sum(w.tolist()) + sum(h.tolist()) + sum(e.tolist()) + sum(r.tolist()))


def to_lsb(values: Vector, unit: float) -> tuple[int, int, int]:
    """(3,) SI values to wire integers, half to even, clipped to int32: a diverging run must not stop the wire."""
    x, y, z = [round(min(max(value / unit, -LARGEST), LARGEST)) for value in values.tolist()]
    return x, y, z
