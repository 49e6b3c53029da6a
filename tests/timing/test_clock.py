"""Clocks: absolute deadlines, no burst after a stall, real time is scale 1."""

from __future__ import annotations

import pytest

from sil.clock import Scaled, clock_rate_q16, new_clock


class Wall:
    """A wall clock that moves when somebody waits, each wait a little too long."""

    def __init__(self, overshoot_ns: int = 0) -> None:
        self.now_ns = 10**9
        self.overshoot_ns = overshoot_ns

    def now(self) -> int:
        return self.now_ns

    def listen(self, timeout_s: float) -> None:
        self.now_ns += round(timeout_s * 1e9) + self.overshoot_ns


def paced(monkeypatch, scale=1.0, overshoot_ns=0):
    wall = Wall(overshoot_ns)
    monkeypatch.setattr("sil.clock.time.sleep", wall.listen)
    clock = Scaled(scale, wall.now)
    clock.start(0)
    return clock, wall


def test_lateness_does_not_accumulate(monkeypatch):
    clock, wall = paced(monkeypatch, overshoot_ns=300_000)
    late = [clock.wait(k * 500_000_000, wall.listen) for k in range(1, 50)]
    assert max(late) <= 300_000
    assert wall.now_ns == pytest.approx(10**9 + 49 * 500_000_000, abs=300_000)


def test_scaled_is_real_time_with_another_scale(monkeypatch):
    clock, wall = paced(monkeypatch, scale=20.0)
    clock.wait(500_000_000, wall.listen)
    assert wall.now_ns == 10**9 + 25_000_000


def test_a_stall_moves_the_epoch_instead_of_a_burst(monkeypatch):
    clock, wall = paced(monkeypatch)
    wall.now_ns += 5_000_000_000
    assert clock.wait(500_000_000, wall.listen) == 4_500_000_000
    clock.rebase(500_000_000)
    assert clock.wait(1_000_000_000, wall.listen) == 0
    assert wall.now_ns == 10**9 + 5_000_000_000 + 500_000_000


def test_the_last_stretch_is_not_slept(monkeypatch):
    """A sleeper that is woken 60 us late is still on time, since it asked to be woken 100 us early."""
    wall = Wall(overshoot_ns=60_000)
    monkeypatch.setattr("sil.clock.time.sleep", wall.listen)

    def now() -> int:
        wall.now_ns += 100  # what reading the clock takes
        return wall.now_ns

    clock = Scaled(1.0, now, spin_ns=100_000)
    clock.start(0)
    assert max(clock.wait(k * 10_000_000, wall.listen) for k in range(1, 50)) <= 200


def test_the_stretch_is_at_most_a_tenth_of_a_period_on_the_wall():
    assert new_clock("scaled:1000", 500_000_000, 100)._spin_ns == 50_000
    assert new_clock("realtime", 500_000_000, 100)._spin_ns == 100_000
    assert new_clock("realtime", 500_000_000, 0)._spin_ns == 0


def test_names():
    assert not new_clock("lockstep").paced
    assert new_clock("realtime").scale == 1.0
    assert new_clock("scaled:20").scale == 20.0
    assert clock_rate_q16(new_clock("lockstep")) == 0
    assert clock_rate_q16(new_clock("scaled:0.5")) == 32768
