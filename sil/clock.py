"""When a tick happens on the wall: lockstep (as fast as answers come), realtime, scaled:N. Real time is scale 1.

A paced clock wakes at absolute deadlines of CLOCK_MONOTONIC, epoch + t_k / scale, so lateness never accumulates. It
sleeps to a little before the deadline and reads the clock until it is there: a sleeping CPU takes tens of microseconds
to run a process again, and its caches are cold.
A tick that wakes more than a period late re-bases the epoch: ticks are neither skipped nor burst.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

# Waiting for frames ends a little before the deadline, and the last stretch is slept: poll() has a grain of 1 ms, and
# the link uses select(), which has none, for waits below COARSE_NS only.
COARSE_NS, COARSE_MARGIN_NS, MARGIN_NS = 20_000_000, 2_000_000, 200_000


class Clock(Protocol):
    """What the loop needs of time. `paced` is False where answers alone set the speed."""

    paced: bool
    scale: float

    def start(self, first_tick_ns: int) -> None:
        """Tick 0 (simulated time `first_tick_ns`) is now."""

    def wait(self, t_ns: int, listen: Callable[[float], None]) -> int:
        """Sleep until simulated time `t_ns`, with `listen(timeout_s)` for frames meanwhile; returns lateness in ns."""

    def rebase(self, t_ns: int) -> None:
        """Simulated time `t_ns` is now: what was missed stays missed."""


class Lockstep:
    """No waiting: the plant goes on as soon as the board has answered."""

    paced = False
    scale = 0.0

    def start(self, first_tick_ns: int) -> None:
        pass

    def wait(self, t_ns: int, listen: Callable[[float], None]) -> int:
        return 0

    def rebase(self, t_ns: int) -> None:
        pass


class Scaled:
    """`scale` simulated seconds per wall second; 1 is real time. The last `spin_ns` before a deadline are not slept."""

    paced = True

    def __init__(self, scale: float, now: Callable[[], int] = time.monotonic_ns, spin_ns: int = 0) -> None:
        self.scale = scale
        self._now = now
        self._spin_ns = spin_ns
        self._epoch_ns = 0

    def start(self, first_tick_ns: int) -> None:
        self.rebase(first_tick_ns)

    def wait(self, t_ns: int, listen: Callable[[float], None]) -> int:
        deadline, spin_ns = self._epoch_ns + int(t_ns / self.scale), self._spin_ns
        while (left := deadline - self._now()) > 0:
            margin = max(COARSE_MARGIN_NS if left >= COARSE_NS else MARGIN_NS, spin_ns)
            if left > margin:
                listen((left - margin) * 1e-9)
            elif left > spin_ns:
                time.sleep((left - spin_ns) * 1e-9)
        return self._now() - deadline

    def rebase(self, t_ns: int) -> None:
        self._epoch_ns = self._now() - int(t_ns / self.scale)


def new_clock(name: str, period_ns: int = 0, spin_us: int = 0) -> Clock:
    """`lockstep`, `realtime` or `scaled:N` (the scenario has checked the name).

    spin_us: the last stretch before a deadline that is not slept, at most a tenth of a period on the wall.
    """
    if name == "lockstep":
        return Lockstep()
    scale = 1.0 if name == "realtime" else float(name.partition(":")[2])
    return Scaled(scale, spin_ns=min(spin_us * 1000, int(period_ns / scale / 10)))


def clock_rate_q16(clock: Clock) -> int:
    """HELLO's clock rate: simulated seconds per wall second in Q16; 0 switches the board's own timer off."""
    return min(round(clock.scale * 65536), 0xFFFFFFFF) if clock.paced else 0
