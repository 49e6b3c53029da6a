"""Workers and their pool: what a point cannot help is told apart from what it is, and no worker ends the others."""

from __future__ import annotations

import errno
import io
import os
import signal
import subprocess
import sys
import time

import pytest

from sil.campaign import pool, worker
from sil.campaign.records import Record
from sil.scenario import load_scenario
from sil.sinks.journal import JournalError
from sil.trouble import LinkFailure, SilError, UsageError

READY = "import sys; sys.stdin.readline(); print('{\"ready\": true}', flush=True); sys.stdin.readline(); "
GARBAGE = READY + "sys.stdout.buffer.write(b'\\xff{no record\\n'); sys.stdout.flush(); sys.stdin.read()"
WRONG = READY + f"print({Record(7, 'passed', 0, '', {}).line().strip()!r}, flush=True); sys.stdin.read()"
RECORD = Record(1, "passed", 0, "", {"missed": 0}, "sha")
GOOD = READY + f"print({RECORD.line().strip()!r}, flush=True); sys.stdin.read()"
DEAD = "import sys; sys.exit(4)"


def full_disk():
    try:
        raise JournalError("run.journal: cannot be written: No space left on device")
    except JournalError as error:
        raise UsageError(str(error)) from None


def raises(error):
    def run(*_):
        raise error

    return run


@pytest.mark.parametrize(
    ("run", "exit_code", "reason"),
    [
        (lambda *_: full_disk(), 3, "No space left"),  # as run_scenario says it: another time it may fly
        (raises(OSError(errno.ENOSPC, "No space left on device")), 3, "No space left"),
        (raises(SilError("run.mcap: unreadable")), 3, "unreadable"),
        (raises(LinkFailure("gone")), 3, "gone"),
        (raises(KeyboardInterrupt()), 3, "KeyboardInterrupt: the law raised it"),
        (lambda *_: {"exit_code": 130}, 3, "KeyboardInterrupt: the law raised it"),
        (raises(UsageError("no such body")), 2, "no such body"),
    ],
)
def test_only_the_scenario_itself_makes_a_point_invalid(tmp_path, monkeypatch, run, exit_code, reason):
    """invalid is for ever; what is broken is flown again by --retry-failed."""
    monkeypatch.setattr(worker, "run_scenario", run)
    setup = {"scenario": load_scenario("mrac-rs232").resolved(), "directory": ""}
    record = worker.fly(setup, {"point": 1, "sets": [], "folder": str(tmp_path / "0001.new"), "keep": "none"})
    assert record.exit_code == exit_code and reason in record.reason
    assert record.verdict == ("invalid" if exit_code == 2 else "failed")


def test_a_reason_does_not_say_where_the_sweep_lies(tmp_path, monkeypatch):
    """results.csv has the same bytes wherever it was made, and the same reason is told once."""
    folder = tmp_path / "0001.new"
    monkeypatch.setattr(worker, "run_scenario", raises(OSError(f"{folder}: cannot write the log")))
    setup = {"scenario": load_scenario("mrac-rs232").resolved(), "directory": ""}
    record = worker.fly(setup, {"point": 1, "sets": [], "folder": str(folder), "keep": "none"})
    assert record.reason == "OSError: run directory: cannot write the log (see workers.log)"


@pytest.fixture
def workers(tmp_path, monkeypatch):
    """workers(script, ...): a pool whose first, second... worker is one of these programs."""
    opened = []
    real = subprocess.Popen

    def make(*scripts):
        left = iter(scripts)

        def popen(command, **options):
            return real([sys.executable, "-c", next(left)], **options)

        monkeypatch.setattr(pool.subprocess, "Popen", popen)
        opened.append(pool.Pool({}, len(scripts), tmp_path / "workers.log"))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def records_of(pool_, count):
    found = []
    give_up = time.monotonic() + 30
    while len(found) < count:
        assert time.monotonic() < give_up
        found += pool_.poll(0.1)
    return found


@pytest.mark.parametrize("script", [GARBAGE, WRONG])
def test_a_worker_that_says_what_is_no_record_of_its_point_costs_that_point(workers, script):
    flying = workers(script)
    assert flying.submit({"point": 1})
    (record,) = records_of(flying, 1)
    assert (record.point, record.exit_code) == (1, 3) and "stopped for what it said" in record.reason
    assert not flying.busy()


def test_a_record_before_nonsense_counts(workers):
    flying = workers(GOOD.replace("sys.stdin.read()", "print('nonsense', flush=True); sys.stdin.read()"), GOOD)
    flying.submit({"point": 1})
    assert records_of(flying, 1) == [RECORD]
    flying.submit({"point": 1})  # another worker, whether or not the first one's last words have come
    assert records_of(flying, 1)[0].point == 1


def test_a_worker_that_cannot_begin_costs_a_point_once_others_could(workers):
    flying = workers(GOOD, DEAD)
    flying.submit({"point": 1})
    assert records_of(flying, 1) == [RECORD]
    flying.submit({"point": 1})
    flying.submit({"point": 2})
    (record,) = records_of(flying, 1)
    assert (record.point, record.exit_code) == (2, 3) and "exit code 4" in record.reason


def test_when_no_worker_can_begin_the_sweep_fails(workers):
    flying = workers(DEAD)
    flying.submit({"point": 1})
    with pytest.raises(LinkFailure, match="before it began"):
        records_of(flying, 1)


STUCK = READY + "import time; time.sleep(60)"
ALIVE = READY + "import time; [print('{\"alive\": true}', flush=True) or time.sleep(0.1) for _ in range(12)]; " + (
    f"print({RECORD.line().strip()!r}, flush=True); sys.stdin.read()"
)


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(pool, "QUIET_S", 0.3)
    monkeypatch.setattr(pool, "GIVE_UP_S", 0.8)


@pytest.mark.parametrize("stopped", [False, True])
def test_a_worker_that_hangs_or_is_stopped_costs_its_point_and_the_next_one_flies_the_next(workers, impatient, stopped):
    """A sweep never hangs silently: a line first, then the point has failed."""
    flying, told = workers(STUCK, GOOD), []
    flying._tell = told.append
    flying.submit({"point": 7})
    while not flying._began:
        list(flying.poll(0.1))
    pid = flying._workers[0].process.pid
    if stopped:
        os.kill(pid, signal.SIGSTOP)
    (record,) = records_of(flying, 1)
    assert (record.point, record.exit_code) == (7, 3)
    assert "killed after 0.8 s in which it " + ("stood still" if stopped else "hung") in record.reason
    (line,) = told
    assert line.startswith(f"point 7: nothing from worker {pid} for ")
    assert ("kill -CONT" in line) == stopped
    flying.submit({"point": 1})
    assert records_of(flying, 1) == [RECORD]


def test_a_worker_whose_ticks_go_by_may_take_as_long_as_it_likes(workers, impatient):
    flying, told = workers(ALIVE), []
    flying._tell = told.append
    flying.submit({"point": 1})
    assert records_of(flying, 1) == [RECORD]
    assert told == []


def test_a_worker_that_seals_a_long_log_may_be_silent_for_longer(workers, impatient):
    sealing = READY + "import time; print('{\"sealing\": 20000}', flush=True); time.sleep(1.5); " + (
        f"print({RECORD.line().strip()!r}, flush=True); sys.stdin.read()"
    )
    flying, told = workers(sealing), []
    flying._tell = told.append
    flying.submit({"point": 1})
    assert records_of(flying, 1) == [RECORD]
    assert told == []


def test_a_worker_says_that_ticks_go_by(monkeypatch, tmp_path):
    monkeypatch.setattr(worker, "ALIVE_EVERY_S", 0.0)
    out = io.StringIO()
    setup = load_scenario("pd-root-locus", ["board=inproc", "duration_s=10", "require=[]"])
    setup = {"scenario": setup.resolved(), "directory": ""}
    order = {"point": 1, "sets": [], "folder": str(tmp_path / "0001.new"), "keep": "none"}
    assert worker.fly(setup, order, worker.Alive(out)).reason == ""
    lines = out.getvalue().encode().splitlines()
    assert set(lines[:-1]) == {pool.ALIVE} and len(lines) > 20
    assert lines[-1] == b'{"sealing": 20}' and pool.SEALING.fullmatch(lines[-1])
