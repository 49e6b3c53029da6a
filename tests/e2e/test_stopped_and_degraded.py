"""A machine that stands still, and the scenario's limits on lateness: no burst, the slip counted, the log complete."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from subprocesses import children_of
from test_killed_and_interrupted import ticks_written, wait_for

from protocol import events
from sil import mcap_file, open_run
from sil.lateness import Cause
from sil.sinks import layouts

FAST_PD = ("appc-rs232", "--set", "law={name: pd}", "--set", "period_s=0.1", "--set", "require=[]")
STOPPED_s, DURATION_s, PERIOD_s = 5.0, 4.0, 0.1


def rows(folder: Path, topic: str, layout: layouts.Layout):
    content = mcap_file.read(folder / "timing.mcap", (topic,))
    start = len(layouts.CDR_HEADER)
    return np.frombuffer(b"".join(message[1][start:] for message in content.messages[topic]), layout.dtype)


@pytest.mark.parametrize("who", ["laboratory", "both"])
def test_stopped_for_five_seconds(cli, who):
    """Row 5: SIGSTOP of the laboratory alone (another program hogs it), or of both (Ctrl-Z, a suspended container)."""
    arguments = ("--set", f"duration_s={DURATION_s:g}", "--clock", "realtime", "--out", "run", "--json")
    process = cli.start("run", *FAST_PD, *arguments)
    wait_for(lambda: ticks_written(cli.folder / "run") >= 10 or process.poll() is not None)
    (board,) = children_of(process.pid)
    stopped = [process.pid, board] if who == "both" else [process.pid]
    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(STOPPED_s)
    for pid in stopped:
        os.kill(pid, signal.SIGCONT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3, err
    run = open_run(cli.folder / "run")
    timing = run.summary["timing"]
    assert run.summary["verdict"] == "degraded" and timing["degraded"]
    assert timing["slipped_s"] > STOPPED_s - 2 * PERIOD_s
    assert timing["rebased_ticks"] >= 1 and timing["late_ticks"] >= timing["rebased_ticks"]
    # no burst: what was slept away was not made up for, every tick kept its period
    assert timing["wall_s"] > DURATION_s + timing["slipped_s"] - 2 * PERIOD_s
    # complete: every tick in order, to the end
    assert run.tick.tolist() == list(range(round(DURATION_s / PERIOD_s))) and run.end["reason"] == "finished"
    moved = rows(cli.folder / "run", "/event", layouts.EVENT)
    moved = moved[moved["code"] == events.EPOCH_REBASED]
    assert moved["b"].sum() * 1e-6 == pytest.approx(timing["slipped_s"], abs=1e-5 * len(moved))
    assert moved["b"].max() * 1e-6 > STOPPED_s - 2 * PERIOD_s
    late = rows(cli.folder / "run", "/timing", layouts.TIMING)
    worst = late[late["lateness_ns"].argmax()]
    assert worst["tick"] == moved["a"][moved["b"].argmax()]
    assert Cause(int(worst["cause"])) is Cause.MACHINE


def test_limits_of_the_scenario_decide_degraded(cli):
    """A limit nobody can keep (1 ns): every wake-up is late, and the permitted fraction decides."""
    paced = (*FAST_PD, "--set", "duration_s=1", "--clock", "realtime", "--set", "timing.max_lateness_ms=0.000001")
    summary = cli.json("run", *paced, "--out", "strict", code=3)
    assert summary["verdict"] == "degraded"
    assert 5 < summary["timing"]["late_ticks"] <= summary["ticks"] and summary["timing"]["late_beyond_ms"] == 1e-6
    assert sum(summary["timing"]["causes"]["late_ticks"].values()) == summary["timing"]["late_ticks"]
    summary = cli.json("run", *paced, "--set", "timing.max_degraded_fraction=1", "--out", "lenient")
    assert summary["verdict"] == "passed" and summary["timing"]["late_ticks"] > 5


def test_what_is_asked_of_the_machine_is_no_part_of_the_log(cli):
    """Same sha256 with and without a priority, CPUs and limits: they are how it is run, not what is run."""
    short = ("appc-rs232", "--set", "duration_s=20", "--set", "require=[]", "--clock", "lockstep")
    plain = cli.json("run", *short, "--out", "a")
    cpu = str(min(os.sched_getaffinity(0)))
    asked = ("clock.lab_cpu=" + cpu, "clock.board_cpu=" + cpu, "clock.priority=1", "timing.max_lateness_ms=3")
    dressed = cli.json("run", *short, *(word for each in asked for word in ("--set", each)), "--out", "b")
    assert dressed["sha256"] == plain["sha256"]
    assert dressed["timing"]["granted"]["lab_cpu"] == dressed["timing"]["granted"]["board_cpu"] == int(cpu)


def test_a_cpu_that_is_not_there_leaves_nothing_behind(cli):
    _, err = cli("run", "appc-rs232", "--set", "clock.lab_cpu=4095", "--out", "run", code=2)
    assert err.startswith("clock.lab_cpu: expected a CPU this process may use, got 4095") and err.count("\n") == 1
    assert not (cli.folder / "run").exists()
