"""Which torque acts on [t_k, t_k+1): fresh, held or zero. The lab's half of the timing contract (protocol/SPEC.md).

COMMAND(j) is in time if its modelled arrival is before t_(j+n); a later one is counted and dropped, never applied, so
one late answer does not leave the loop a sample behind. Misses 1..hold_limit hold the last torque, then it is zero.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from protocol import events
from protocol.frames import AHEAD_LIMIT, FRESH, HELD, NO_TICK, ZERO

Torque = tuple[float, float, float]
LATE_ON_THE_CLOCK, BOARD_FASTER, INCOMPLETE = 0, 1, 2  # b of event REAL_MISS


class Acting(NamedTuple):
    """What acts from a tick on: commanded torque on the body (before limits), its source, the tick of its command."""

    torque_Nm: Torque
    source: int
    ack: int


class Decides(Protocol):
    """Who says which torque acts: commands from a board, or a schedule."""

    notices: list[tuple[int, int, int]]  # (event code, a, b) since the loop last took them

    @property
    def acting(self) -> Acting:
        """The last decision."""

    def decide(self, due: int) -> Acting:
        """The torque that acts now, when the one for tick `due` is the one that should."""


class ExecutionModel:
    """When the board would have finished the answer to a tick, in simulated ns; the board runs the same recursion.

    start = max(arrival, free_at), free_at = start + answer_delay; arrival = t_k + sample_timeout without a SAMPLE.
    """

    def __init__(self, period_ns: int, sample_timeout_ns: int, answer_delay_ns: int) -> None:
        self._period_ns = period_ns
        self._sample_timeout_ns = sample_timeout_ns
        self._answer_delay_ns = answer_delay_ns
        self._free_at_ns = 0
        self.overrun = False  # the last SAMPLE found the board busy

    def restart(self, first: int) -> None:
        """A fresh board, whose first SAMPLE is that of tick `first`: it is idle, and steps up to it if that is near."""
        self._free_at_ns = 0
        for tick in range(first) if first <= AHEAD_LIMIT else ():
            self.done_ns(tick, None)

    def done_ns(self, tick: int, transit_ns: int | None) -> int:
        """Call once per tick, in order. `transit_ns` of the SAMPLE, None where none reached the board."""
        arrival = tick * self._period_ns + (self._sample_timeout_ns if transit_ns is None else transit_ns)
        self.overrun = transit_ns is not None and arrival < self._free_at_ns
        self._free_at_ns = max(arrival, self._free_at_ns) + self._answer_delay_ns
        return self._free_at_ns


class CommandWindow:
    """Commands that arrived, and the decision of every tick. Counts: missed, late, real_misses."""

    def __init__(self, delay_ticks: int, period_ns: int, hold_limit: int) -> None:
        self._delay = delay_ticks
        self._period_ns = period_ns
        self._hold_limit = hold_limit
        self._arrived: dict[int, Torque] = {}
        self._explained: set[int] = set()  # missing by the model: late, or lost on the link
        self._unexplained: set[int] = set()  # missing by the wall clock alone
        self._decided = -1
        self._acting = Acting((0.0, 0.0, 0.0), ZERO, NO_TICK)
        self._misses_in_row = 0
        self._real_misses = 0
        self.missed = self.late = 0
        self.notices: list[tuple[int, int, int]] = []  # (event code, a, b) of this tick

    @property
    def acting(self) -> Acting:
        """The last decision."""
        return self._acting

    def arrive(self, tick: int, torque_Nm: Torque, arrival_ns: int) -> bool:
        """COMMAND(tick) came, modelled at `arrival_ns`. True when it is in time by the model and by the clock.

        In time by the model, yet after its tick was decided, is a real miss: the run is no longer reproducible.
        """
        in_time = self.in_time(tick, arrival_ns)
        decided = tick <= self._decided or tick in self._unexplained
        self._unexplained.discard(tick)
        if in_time and not decided:
            self._arrived[tick] = torque_Nm
            return True
        if in_time:
            self._real_miss(tick, LATE_ON_THE_CLOCK)
            return False
        late_us = (arrival_ns - (tick + self._delay) * self._period_ns) // 1000
        self.late += 1
        if not decided:
            self._explained.add(tick)
        self.notices.append((events.COMMAND_LATE, tick, min(late_us, 2**31 - 1)))
        return False

    def in_time(self, tick: int, arrival_ns: int) -> bool:
        """By the model alone."""
        return self._delay == 0 or arrival_ns < (tick + self._delay) * self._period_ns

    def unanswered(self, tick: int) -> None:
        """The run ended, and COMMAND(tick), due after its end, is not here: the clock's fault, or it would be."""
        if tick not in self._arrived and tick not in self._explained:
            self._unexplained.add(tick)

    def board_was_faster(self, tick: int) -> None:
        """The board's own timer stepped `tick`, though by the model its SAMPLE was there in time: the clock's fault."""
        self._real_miss(tick, BOARD_FASTER)

    def incomplete(self, tick: int) -> None:
        """Frames that COMMAND(tick) announced never came: what is recorded of this tick is not what the board sent."""
        self._real_miss(tick, INCOMPLETE)

    def _real_miss(self, tick: int, why: int) -> None:
        self._real_misses += 1
        self.notices.append((events.REAL_MISS, tick, why))

    def lost(self, tick: int) -> None:
        """The link dropped COMMAND(tick), or the board restarted before it: a miss, but not the clock's."""
        self._unexplained.discard(tick)
        if tick > self._decided:
            self._explained.add(tick)

    @property
    def real_misses(self) -> int:
        """Commands the clock missed though the model had them in time; more than 0: not reproducible."""
        return self._real_misses + len(self._unexplained)

    def decide(self, due: int) -> Acting:
        """The torque that acts now, when COMMAND(due) is the one that should; due < 0 before the first."""
        if due < 0:
            return self._acting
        self._decided = due
        torque = self._arrived.pop(due, None)
        if torque is not None:
            self._recover(due)
            self._acting = Acting(torque, FRESH, due)
        else:
            self._miss(due)
        return self._acting

    def _recover(self, due: int) -> None:
        if self._misses_in_row > self._hold_limit:
            self.notices.append((events.RECOVERED, due, self._misses_in_row))
        self._misses_in_row = 0

    def _miss(self, due: int) -> None:
        self.missed += 1
        self._misses_in_row += 1
        if due in self._explained:
            self._explained.discard(due)
        else:
            self._unexplained.add(due)
        self.notices.append((events.COMMAND_MISSED, due, self._misses_in_row))
        if self._misses_in_row <= self._hold_limit:
            self._acting = self._acting._replace(source=HELD if self._acting.ack != NO_TICK else ZERO)
            return
        if self._misses_in_row == self._hold_limit + 1:
            self.notices.append((events.HOLD_LIMIT, due, self._misses_in_row))
        self._acting = Acting((0.0, 0.0, 0.0), ZERO, self._acting.ack)
