"""What the machine is asked for is given back, and what it refuses is said."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys

import pytest

from sil import realtime
from sil.scenario_sections import Clock
from sil.trouble import UsageError


def settings() -> tuple[object, ...]:
    slack_ns = ctypes.CDLL(None).prctl(realtime.PR_GET_TIMERSLACK, 0, 0, 0, 0)
    scheduling = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, os.sched_getaffinity(0), slack_ns
    return *scheduling, gc.get_freeze_count(), realtime._locked_kB()


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
        assert settings() == before and got == (None, None, False, None, None, ())


def test_what_a_caller_froze_and_locked_before_stays_so():
    gc.freeze()
    try:
        with realtime.granted(Clock(mode="realtime"), True, None):
            pass
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()


def test_the_board_runs_one_below_the_laboratory():
    """A law that never returns must not keep the laboratory, on the same CPU, from noticing."""
    with subprocess.Popen(["sleep", "30"]) as child:
        try:
            with realtime.granted(Clock(mode="realtime", priority=7), True, child.pid) as got:
                if got.priority is None:
                    pytest.skip("SCHED_FIFO is not permitted here")
                assert (got.priority, got.board_priority) == (7, 6)
                assert os.sched_getparam(child.pid).sched_priority == 6
        finally:
            child.kill()


def test_a_board_that_has_gone_is_said_and_the_laboratory_keeps_what_it_got():
    with subprocess.Popen(["true"]) as child:
        child.wait()
    cpu = min(os.sched_getaffinity(0))
    with realtime.granted(Clock(mode="realtime", board_cpu=cpu), True, child.pid) as got:
        assert got.board_cpu is None and got.refused == ("clock.board_cpu: refused (No such process)",)


DROPPED = """
import ctypes, os
from sil import realtime
from sil.scenario_sections import Clock
class Header(ctypes.Structure):
    _fields_ = [("version", ctypes.c_uint32), ("pid", ctypes.c_int)]
with realtime.granted(Clock(mode="realtime", priority=5, lab_cpu=min(os.sched_getaffinity(0))), True, None) as got:
    assert got.priority == 5
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.capset(ctypes.byref(Header(0x20080522, 0)), (ctypes.c_uint32 * 6)()) == 0
assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER
print(len(os.sched_getaffinity(0)))
"""


def test_who_may_not_clear_a_flag_gets_ordinary_priority_back_all_the_same():
    """An ordinary user with an rtprio limit: SCHED_RESET_ON_FORK stays, and the rest is undone."""
    if not realtime.may_lock_memory() or os.geteuid() != 0:
        pytest.skip("needs a root that can drop its capabilities")
    with realtime.granted(Clock(mode="realtime", priority=5), True, None) as got:
        if got.priority is None:
            pytest.skip("SCHED_FIFO is not permitted here")
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == len(os.sched_getaffinity(0))
