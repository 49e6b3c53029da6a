"""The board's own timer: the line through its arrivals, and wrong timers, of boards in a thread on a pty."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from firmware_sim.board import Board
from firmware_sim.hal import HostHal
from protocol import frames
from protocol.link import Link, LinkError
from protocol.links import open_link
from protocol.port import Port
from sil.board_test import FAIL, PASS, SKIPPED, Order, examine
from sil.board_test.timer import fit
from sil.boards import BOARDS, BoardOrder
from sil.doctor.findings import Finding

WALL_S = 0.05


def test_the_line_is_not_moved_by_arrivals_that_are_late() -> None:
    """Jitter of a USB frame, some stalls, and a busy second in which everything is late."""
    rng = np.random.default_rng(1)
    numbers = np.arange(1, 201)
    true_s = WALL_S * (1 - 300e-6)
    times = 7.0 + true_s * numbers + rng.uniform(0, 1e-3, 200)
    times[rng.random(200) < 0.1] += 5e-3
    times[150:158] += rng.uniform(1e-3, 3e-3, 8)
    found = fit(numbers, times)
    assert abs(1e6 * (1 - found.slope_s / WALL_S) - 300) < 3e6 * found.error_s / WALL_S
    assert found.error_s / WALL_S < 8e-6


def test_the_uncertainty_is_what_the_scatter_makes_it() -> None:
    """Of many fits, about two thirds lie within one standard error."""
    rng, numbers = np.random.default_rng(2), np.arange(1, 201)
    within = 0
    for _ in range(200):
        found = fit(numbers, WALL_S * numbers + rng.exponential(100e-6, 200))
        within += abs(found.slope_s - WALL_S) < found.error_s
    assert 0.55 < within / 200 < 0.8


# -- wrong timers ------------------------------------------------------------------------------------------------------


class Hal(HostHal):
    """A hal whose clock runs `fast` times too fast."""

    fast = 1.0

    def now(self) -> int:
        return round(super().now() * self.fast)

    def wait(self, until_ns: int | None):  # type: ignore[no-untyped-def]
        return super().wait(None if until_ns is None else round(until_ns / self.fast))


class TooFast(Hal):
    fast = 1.2


class IgnoresRate(Board):
    def _wall_ns(self, simulated_ns: int) -> int:
        return simulated_ns


class NeverSet(Board):
    """Only the first SAMPLE sets the timer."""

    def _phase_timer(self, flight, ticks):  # type: ignore[no-untyped-def]
        if self.timer_ns is None:
            super()._phase_timer(flight, ticks)


class IgnoresStale(Board):
    def _phase_timer(self, flight, ticks):  # type: ignore[no-untyped-def]
        if ticks == 1:
            super()._phase_timer(flight, ticks)


class RunsOn(Board):
    """Its timer outlives STOP."""

    def _on_stop(self, packet):  # type: ignore[no-untyped-def]
        self._nonce = None


class SaysUsed(Board):
    def _step(self, sample):  # type: ignore[no-untyped-def]
        flight = self._flight
        assert flight is not None
        answer = flight.step(self._next_tick, sample)
        self._next_tick += 1
        self._port.send(answer[0]._replace(used=frames.USED), *answer[1:])


class WithoutTimer(Board):
    def _hello(self, echo):  # type: ignore[no-untyped-def]
        hello = super()._hello(echo)
        return hello._replace(flags=hello.flags & ~frames.HELLO_OWN_TIMER)


class Threaded:
    """A board in a thread, on the other side of a pty."""

    pid = None
    board: type[Board] = Board
    hal: type[HostHal] = HostHal

    def __init__(self, order: BoardOrder) -> None:
        self.link: Link = open_link("pty", listen=False)
        self._port = Port(open_link(self.link.url, listen=True))
        self._thread = threading.Thread(target=self._live)
        self._thread.start()

    def _live(self) -> None:
        try:
            self.board(self._port, self.hal(self._port)).serve(once=False)
        except LinkError:
            self._port.close()

    def check_alive(self) -> None:
        """As long as the test."""

    def close(self) -> None:
        self.link.close()
        self._thread.join(10.0)


@contextmanager
def plugged(monkeypatch: pytest.MonkeyPatch, board: type[Board], hal: type[HostHal]) -> Iterator[None]:
    monkeypatch.setitem(BOARDS, "process", f"{__name__}:Threaded")
    monkeypatch.setattr(Threaded, "board", board)
    monkeypatch.setattr(Threaded, "hal", hal)
    yield


Watched = Callable[..., dict[str, Finding]]


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Watched:
    """watched(check, board, hal): findings of the checks of the timer."""

    def watch(check: str, board: type[Board] = Board, hal: type[HostHal] = HostHal) -> dict[str, Finding]:
        with plugged(monkeypatch, board, hal):
            order = Order("process", only=(check,), drift_s=1.0)
            return {each.finding.check: each.finding for each in examine(order, lambda text: None)}

    return watch


def test_a_right_timer_passes(watched: Watched) -> None:
    found = watched("timer")
    assert (found["steps"].status, found["drift"].status) == (PASS, PASS), found
    assert abs(found["drift"].data["ppm"]) < 60_000  # on a machine that may be busy
    assert found["left"].status == PASS


@pytest.mark.parametrize(
    ("board", "said"),
    [(IgnoresRate, "the first step of the timer behind SAMPLE(0): expected 300 ms, got "),
     (NeverSet, "its step behind SAMPLE(3)"), (IgnoresStale, "its step behind a stale SAMPLE"),
     (RunsOn, "after STOP: expected no step of the timer, got COMMAND("),
     (SaysUsed, "expected propagated or repeated")],
)  # fmt: skip
def test_a_timer_that_is_set_wrongly(watched: Watched, board: type[Board], said: str) -> None:
    found = watched("timer: steps", board)
    assert found["steps"].status == FAIL
    assert said in found["steps"].found


def test_a_clock_that_is_much_too_fast(watched: Watched) -> None:
    found = watched("timer: drift", Board, TooFast)["drift"]
    assert found.status == FAIL
    assert found.data["ppm"] == pytest.approx(1e6 * (1 - 1 / 1.2), abs=60_000)  # on a machine that may be busy
    assert "ppm fast against this machine's clock: expected at most 10000 ppm" in found.found


def test_a_board_without_a_timer_is_skipped(watched: Watched) -> None:
    found = watched("timer", WithoutTimer)
    assert (found["steps"].status, found["drift"].status) == (SKIPPED, SKIPPED)


def test_it_takes_as_long_as_it_says(watched: Watched) -> None:
    """--drift-s is wall time."""
    began = time.monotonic()
    data = watched("timer: drift")["drift"].data
    assert data["seconds"] == pytest.approx(1.0)
    assert time.monotonic() - began > 1.0
