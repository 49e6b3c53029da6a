"""Runs that end badly: nothing recorded is lost, nobody is left running, and the exit code says what happened."""

from __future__ import annotations

import json
import os
import random
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from subprocesses import alive, children_of, quiet

from sil import open_run
from sil.sinks.journal import Kind, read_journal

PACED = ("appc-rs232", "--set", "require=[]", "--clock", "scaled:40", "--out", "run", "--json")
LONG = ("appc-rs232", "--set", "require=[]", "--set", "duration_s=6000")


def wait_for(condition, within_s=60.0):
    give_up = time.monotonic() + within_s
    while not (value := condition()):
        assert time.monotonic() < give_up, "it did not happen in time"
        time.sleep(0.01)
    return value


def ticks_written(folder: Path) -> int:
    try:
        return sum(1 for record in read_journal(folder / "run.journal") if record.kind == Kind.TRUTH)
    except Exception:
        return 0


def started(cli, *arguments, ticks=20):
    """A run that has written some ticks: (process, pid of its board)."""
    process = cli.start("run", *(arguments or PACED))
    wait_for(lambda: ticks_written(cli.folder / "run") >= ticks or process.poll() is not None)
    assert process.poll() is None, process.communicate()
    (board,) = children_of(process.pid)
    return process, board


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_both_processes_and_leaves_a_complete_log(cli, number):
    process, board = started(cli)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    summary = json.loads(out)
    assert summary["verdict"] == "interrupted"
    assert not alive(board)
    run = open_run(cli.folder / "run")
    assert len(run) == summary["ticks"] > 0
    assert run.end["reason"] == "interrupted"
    assert json.loads((cli.folder / "run" / "summary.json").read_text()) == summary


def test_who_interrupts_a_run_does_not_wait_for_a_board_that_hangs(cli):
    """Interrupted comes first among the exit codes, and the log holds what there was."""
    process, board = started(cli)
    os.kill(board, signal.SIGSTOP)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert json.loads(out)["verdict"] == "interrupted" and not alive(board)
    assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] > 0


def test_a_signal_before_anything_ran_leaves_nothing_behind(cli):
    process = cli.start("plant", "appc-rs232", "--link", "pty", "--out", "run")
    assert "waiting for a board" in process.stderr.readline()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert process.returncode == 130
    assert not (cli.folder / "run").exists()


@pytest.mark.parametrize("seed", [1, 2])
def test_a_killed_plant_process_leaves_every_row_up_to_the_tick_before(cli, recorded, seed):
    # In lockstep, since a real miss of a paced run would change the rows themselves.
    ticks = random.Random(seed).randrange(20, 4000)
    process, board = started(cli, *LONG, "--clock", "lockstep", "--out", "run", ticks=ticks)
    process.kill()
    process.communicate()
    try:
        wait_for(lambda: not alive(board), within_s=5)  # no orphan
    finally:
        quiet(board)
    written = ticks_written(cli.folder / "run")
    cli("recover", "run")
    run = open_run(cli.folder / "run")
    assert run.end["reason"] == "truncated"
    assert len(run) == written  # every tick whose truth is there has its answer too
    whole = open_run(recorded(*LONG))
    assert len(run) < len(whole)
    for name in run.names:
        assert np.array_equal(run[name], whole[name][: len(run)], equal_nan=True), name
    count = len(run)
    assert [p.packet for p in run.packets if p.tick < count] == [p.packet for p in whole.packets if p.tick < count]


@pytest.mark.parametrize("restarts", [0, 3])
def test_a_killed_board_is_named_and_what_was_recorded_is_kept(cli, restarts):
    """Nobody starts a board process again: it cannot come back, whatever the scenario allows."""
    process, board = started(cli, *PACED, "--set", f"restart_limit={restarts}")
    os.kill(board, signal.SIGKILL)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 3
    assert "signal 9" in err
    assert len(err.strip().splitlines()) == 1
    assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] >= 20


def test_a_torn_pty_is_a_clear_line_and_what_was_recorded_is_kept(cli):
    """Two terminals; the board's is closed in mid-run."""
    plant = cli.start("plant", *PACED)
    url = plant.stderr.readline().split("--link ")[1].strip().rstrip(")")
    board = cli.start("board", "--link", url)
    try:
        wait_for(lambda: ticks_written(cli.folder / "run") >= 20)
        board.kill()
        out, err = plant.communicate(timeout=30)
    finally:
        board.kill()
        board.communicate()
    assert plant.returncode == 3
    assert "gone" in err
    assert "Traceback" not in err
    assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] >= 20


FAILING = """
class Fails:
    PARAMS = {}
    def init(self, params):
        pass
    def step(self, sample):
        if sample.tick == 30:
            raise RuntimeError("the gyro table is empty")
        return (0.0, 0.0, 0.0)
"""


def test_an_exception_in_the_law_ends_the_run_with_its_message_and_no_orphan(cli):
    (cli.folder / "fails.py").write_text(FAILING)
    (cli.folder / "s.yaml").write_text("law: {name: ./fails.py:Fails, form: float}\n")
    process = cli.start("run", "s.yaml", "--out", "run", "--json")
    out, err = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "the gyro table is empty" in err
    assert "Traceback" not in err
    assert "Traceback" in (cli.folder / "run" / "board.log").read_text()
    assert len(open_run(cli.folder / "run")) >= 29
    assert json.loads(out)["exit_code"] == 3


def test_a_silent_peer_is_a_clear_line(cli, monkeypatch):
    """Somebody listens on the UDP port and never says a word."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mute:
        mute.bind(("127.0.0.1", 0))
        url = f"udp://127.0.0.1:{mute.getsockname()[1]}"
        _, err = cli("run", "appc-rs232", "--board", url, code=3)
    assert "no HELLO within" in err


def test_a_peer_with_other_frame_layouts_is_named(cli):
    """HELLO is frozen: a board of another build can still be told apart in one line."""
    import socket
    import threading

    from protocol import frames

    stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    stranger.bind(("127.0.0.1", 0))
    stranger.settimeout(60)

    def answer():
        data, peer = stranger.recvfrom(500)
        hello = frames.unpack(data).frame
        theirs = hello._replace(role=1, flags=frames.HELLO_ECHO, layout_hash=0xBADC0DE, build="old board")
        stranger.sendto(frames.pack(theirs, 0), peer)

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        _, err = cli("run", "appc-rs232", "--board", f"udp://127.0.0.1:{stranger.getsockname()[1]}", code=3)
    finally:
        thread.join()
        stranger.close()
    assert "old board" in err
    assert "layout" in err
