"""The live view: what a viewer is shown is what the log holds, and no viewer, whatever it does, changes the run."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from live_viewers import Viewer, address_of, stuck, talks_nonsense
from mcap.reader import make_reader
from subprocesses import REPO, Cli, all_gone, children_of, quiet

from sil.launched import child_environment

FLIGHT = ("mrac-rs232", "--set", "require=[]", "--set", "duration_s=12", "--json", "--out", "run")  # 24 ticks
SCENARIO = (*FLIGHT, "--board", "inproc")  # where the board does not matter: a process less
CLOCK = ("--clock", "scaled:10")  # 50 ms a tick: a busy machine keeps up
PACED = (*FLIGHT, *CLOCK)
ANY = ("--live-at", "127.0.0.1:0")
SEEN = ("--live-wait", "30", *ANY)


def ended(process: subprocess.Popen[str], code: int = 0) -> tuple[dict, str]:
    """(summary, the rest of stderr)."""
    out, err = process.communicate(timeout=60)
    assert process.returncode == code, f"{out}\n{err}"
    return json.loads(out), err


def views_of(process: subprocess.Popen[str]) -> list[int]:
    """The live view's process of this run."""
    found = children_of(process.pid)
    return [pid for pid in found if b"sil.live" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def logged(file: Path) -> tuple[dict[str, str | bytes], dict[str, list[tuple[int, bytes]]]]:
    """(schema by topic, messages by topic) of an MCAP file."""
    schemas, messages = {}, {}
    with open(file, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            schemas[channel.topic] = schema.name
            messages.setdefault(channel.topic, []).append((message.log_time, message.data))
    return schemas, messages


@pytest.fixture(scope="module")
def unseen(tmp_path_factory) -> str:
    """The sha256 of a run that nobody looked at."""
    return Cli(tmp_path_factory.mktemp("unseen")).json("run", *SCENARIO)["sha256"]


def same_bytes(summary: dict, unseen: str) -> bool:
    """Also with a clock, unless this machine was too busy for it, and the run says so."""
    return summary["sha256"] == unseen or not summary["reproducible"]


def test_a_viewer_sees_what_is_logged_and_one_that_comes_late_sees_the_satellite(cli, unseen):
    """The board in process, since a command that misses the clock of a busy machine is shown in two parts."""
    process = cli.start("run", *SCENARIO, *CLOCK, *SEEN)
    address = address_of(process)
    talks_nonsense(address)
    viewer = Viewer(address)
    assert viewer.has_some.wait(30)
    late = Viewer(address)
    summary, err = ended(process)
    assert same_bytes(summary, unseen)
    viewer.join(10)
    late.join(10)
    schemas, messages = logged(cli.folder / "run" / "run.mcap")
    for topic, rows in messages.items():
        assert viewer.channels[topic]["schemaName"] == schemas[topic]
        assert set(viewer.messages[topic]) >= set(rows), topic  # /telemetry too, whose channel comes with its first row
    assert set(viewer.messages["/truth"]) == set(messages["/truth"]) and len(messages["/truth"]) == summary["ticks"]
    assert set(viewer.messages["/timing"]) <= set(logged(cli.folder / "run" / "timing.mcap")[1]["/timing"])
    assert viewer.times_ns == sorted(viewer.times_ns) and len(viewer.times_ns) == summary["ticks"]
    assert 0 in viewer.late_ns  # the time goes ahead of its tick, in a queue of its own
    assert late.messages["/scene"][-1][1] == messages["/scene"][-1][1]
    assert len(late.messages["/truth"]) < len(viewer.messages["/truth"])
    assert summary["live"]["failed"] == "" and summary["live"]["viewers"] >= 2
    assert f"{summary['ticks']} of {summary['ticks']} ticks shown" in err


def test_a_viewer_that_is_stuck_changes_nothing(cli, unseen):
    process = cli.start("run", *PACED, *SEEN)
    with stuck(address_of(process)):
        summary, _ = ended(process)
    assert same_bytes(summary, unseen)
    assert summary["live"]["viewers"] == 1 and summary["live"]["shown"] == summary["ticks"]


def test_nobody_looks(cli, unseen):
    """In lockstep: the run neither waits for a view nor for its end, and says what would show more."""
    process = cli.start("run", *SCENARIO, *ANY)
    summary, err = ended(process)
    assert summary["sha256"] == unseen
    assert summary["live"] == {**summary["live"], "viewers": 0, "ticks": 24, "failed": ""}
    assert "--clock scaled:20" in err


def test_a_view_that_is_killed_costs_the_view_and_a_line(cli):
    process = cli.start("run", *SCENARIO, "--set", "duration_s=24", *CLOCK, *SEEN)
    viewer = Viewer(address_of(process))
    assert viewer.has_some.wait(30)
    (view,) = views_of(process)
    os.kill(view, signal.SIGKILL)
    summary, err = ended(process)
    assert summary["reason"] == "finished" and summary["ticks"] == 48
    assert summary["live"]["failed"] == "its process ended with signal 9"
    assert [line for line in err.splitlines() if "signal 9" in line] == [
        "live: the view failed, the run did not: its process ended with signal 9"
    ]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_view_ends_with_the_laboratory(cli, number):
    """However it ends, and also where it never came to a run: sil plant waits for a board."""
    process = cli.start("plant", "mrac-rs232", "--clock", "realtime", "--link", "pty", "--out", "run", *ANY)
    address_of(process)
    assert "waiting for a board" in process.stderr.readline()
    views = views_of(process)
    assert len(views) == 1
    try:
        process.send_signal(number)
        process.communicate(timeout=30)
        assert all_gone(views)
    finally:
        quiet(views[0])


def test_ctrl_c_ends_the_wait_for_a_viewer_and_leaves_nothing(cli):
    process = cli.start("run", *SCENARIO, *SEEN)
    address_of(process)
    views = views_of(process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 130
    assert all_gone(views) and not (cli.folder / "run").exists()


def test_a_port_that_is_taken_is_said_before_anything_runs(cli):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        _, err = cli("run", *SCENARIO, "--live-at", place, code=2)
    assert re.fullmatch(f"{place}: cannot listen there .*in use.*; --live-at 127.0.0.1:0 takes any free port\n", err)
    assert not (cli.folder / "run").exists()


def test_without_the_library_one_line_says_how_to_get_it(cli):
    """As on a machine where it is not installed: Python finds none."""
    (cli.folder / "nowhere").mkdir()
    (cli.folder / "nowhere" / "foxglove.py").write_text("raise ModuleNotFoundError(\"No module named 'foxglove'\")\n")
    environment = {**os.environ, "PYTHONPATH": f"{cli.folder / 'nowhere'}:{os.environ.get('PYTHONPATH', '')}"}
    process = cli.start("run", *SCENARIO, "--live", env=environment)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err == "live view: needs foxglove-sdk: pip install 'attitude-sil[live]' (No module named 'foxglove')\n"
    assert not (cli.folder / "run").exists()


def test_a_run_that_is_over_is_played_to_who_comes(cli, unseen):
    cli("run", *SCENARIO)
    process = cli.start("live", "run", "--at", "127.0.0.1:0", "--speed", "30")
    place = process.stdout.readline().strip().removeprefix("ws://").split(":")
    began = time.monotonic()
    viewer = Viewer((place[0], int(place[1])))
    assert process.wait(30) == 0
    assert time.monotonic() - began > 11.5 / 30
    viewer.join(10)
    assert set(viewer.messages["/truth"]) == set(logged(cli.folder / "run" / "run.mcap")[1]["/truth"])


FLOOD = """
import os, resource, time
from sil.live.server import Server
server = Server("127.0.0.1", 0, "flood")
schema = server.register_schema("sil/msg/Truth", "ros2msg", b"float64 x")
channel = server.register_channel("/truth", "cdr", schema)
print(server.port, flush=True)
while not server.viewers:
    time.sleep(0.01)
def fill(messages):
    for k in range(messages):
        server.add_message(channel, k, bytes(200), k)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(fill(30_000), fill(300_000), int(server.behind), flush=True)
server.stop()
os._exit(0)
"""


def test_memory_is_bounded_however_long_a_viewer_is_stuck():
    """66 MB are published; what the queue and the kernel hold of it is there after the first 6 MB. The viewer is that
    of `sil bench live`."""
    environment = {**child_environment(), "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-P", "-c", FLOOD]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=REPO) as process:
        port = process.stdout.readline().strip()
        onlooker = [sys.executable, "-P", "-m", "sil.bench.onlooker", port, "stuck"]
        with subprocess.Popen(onlooker, env=environment) as viewer:
            *_, line = process.stdout.read().splitlines()  # until it has ended
            viewer.kill()
        assert process.wait(30) == 0
    early_kB, late_kB, behind = map(int, line.split())
    assert late_kB - early_kB < 3000 and behind == 1
