"""What the machine is asked for is given back, and what it refuses is said."""

from __future__ import annotations

import gc
import os

import pytest

from sil import realtime
from sil.scenario_sections import Clock
from sil.trouble import UsageError


def settings() -> tuple[object, ...]:
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, os.sched_getaffinity(0), gc.get_freeze_count()


def test_all_is_as_before_afterwards():
    before = settings()
    cpu = min(os.sched_getaffinity(0))
    with realtime.granted(Clock(mode="realtime", priority=1, lab_cpu=cpu), True, None) as got:
        assert os.sched_getaffinity(0) == {cpu} and got.lab_cpu == cpu
        assert gc.get_freeze_count() > 0
        if got.priority is None:
            assert any("clock.priority" in line and "\n" not in line for line in got.refused)
        else:
            assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    assert settings() == before


def test_also_after_an_exception():
    before = settings()
    with (
        pytest.raises(KeyError),
        realtime.granted(Clock(mode="realtime", priority=1, lab_cpu=min(os.sched_getaffinity(0))), True, None),
    ):
        raise KeyError
    assert settings() == before


def test_the_board_process_is_placed_too():
    """A child stands in for the board."""
    import subprocess

    cpu = max(os.sched_getaffinity(0))
    with subprocess.Popen(["sleep", "30"]) as child:
        try:
            with realtime.granted(Clock(mode="realtime", board_cpu=cpu), True, child.pid) as got:
                assert os.sched_getaffinity(child.pid) == {cpu} and got.board_cpu == cpu
        finally:
            child.kill()


def test_a_cpu_that_is_not_there_is_a_usage_error():
    with (
        pytest.raises(UsageError, match=r"^clock.lab_cpu: expected a CPU this process may use, got 4095; known: "),
        realtime.granted(Clock(mode="realtime", lab_cpu=4095), True, None),
    ):
        pass


def test_a_refused_priority_is_one_line(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(realtime.os, "sched_setscheduler", refuse)
    monkeypatch.setattr(realtime, "may_lock_memory", lambda: False)
    with realtime.granted(Clock(mode="realtime", priority=10), True, None) as got:
        assert got.priority is None and not got.memory_locked
        assert [line.partition(":")[0] for line in got.refused] == ["clock.lock_memory", "clock.priority"]
        assert "Operation not permitted" in got.refused[1]


def test_lockstep_asks_for_nothing_by_default():
    before = settings()
    with realtime.granted(Clock(), False, None) as got:
        assert settings() == before and got == (None, False, None, None, ())
