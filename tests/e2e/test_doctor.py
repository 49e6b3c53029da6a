"""`sil doctor` as it is typed: a healthy machine, a shadowed module, a real board process, Ctrl-C in the middle."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cables import Cable
from subprocesses import Cli, all_gone, children_of

from protocol import frames

CHECKS = ["python", "packages", "dependencies", "compiled code", "processors", "kernel", "timers", "hypervisor"]


def test_this_machine(cli: Cli) -> None:
    """Whatever machine runs the tests: one object on stdout, and the exit code says what the findings say."""
    process = cli.start("doctor", "--json")
    out, err = process.communicate(timeout=120)
    said = json.loads(out)
    assert [finding["check"] for finding in said["findings"]][: len(CHECKS)] == CHECKS
    problems = [finding for finding in said["findings"] if finding["status"] == "problem"]
    assert (process.returncode, said["healthy"]) == ((3, False) if problems else (0, True)), err
    assert {"status", "found", "advice", "commands", "data"} <= set(said["findings"][0])


def test_a_shadowed_package_is_found_though_it_was_imported(tmp_path: Path) -> None:
    """`python -m sil` in a directory that holds a protocol.py: the doctor still comes up, and says so."""
    (tmp_path / "protocol.py").write_text("raise RuntimeError('not the cable')\n")
    home = str(Path(__file__).resolve().parents[2])
    command = [sys.executable, "-m", "sil", "doctor"]
    environment = {**os.environ, "PYTHONPATH": home}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 3, done.stderr
    line = next(line for line in done.stdout.splitlines() if " packages " in line)
    assert line.startswith("problem")
    assert f"protocol from {tmp_path}/protocol.py" in line
    assert "Traceback" not in done.stderr


def test_a_board_process_over_a_cable(cli: Cli, cable: Cable) -> None:
    out, _ = cli("doctor", "--link", f"serial://{cable.lab}", "--round-trips", "200")
    lines = {line.split()[1]: line for line in out.splitlines() if line.startswith(("ok", "note", "problem"))}
    assert "'firmware_sim 1', protocol 1" in lines["board"]
    assert "200 of 200: p50" in lines["round"]
    assert cable.types[-1] == frames.Type.STOP
    assert cable.types.count(frames.Type.HELLO) >= 201
    cli("doctor", "--link", cable.lab, "--round-trips", "5")  # the port is free again, and so is the board


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupted_it_says_stop_and_closes_the_port(cli: Cli, cable: Cable, number: signal.Signals) -> None:
    process = cli.start("doctor", "--link", cable.lab, "--round-trips", "1000000")
    try:
        while process.poll() is None and cable.types.count(frames.Type.HELLO) < 100:
            select.select([], [], [], 0.02)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert err.splitlines()[-1] == "interrupted"
    assert " board " in out
    cli("doctor", "--link", cable.lab, "--round-trips", "5")
    assert cable.types.count(frames.Type.STOP) == 2, "one for each doctor"


def test_its_own_board_process_does_not_outlive_it(cli: Cli) -> None:
    process = cli.start("doctor", "--link", "pty", "--round-trips", "1000000")
    try:
        while process.poll() is None and not children_of(process.pid):
            select.select([], [], [], 0.02)
        children = children_of(process.pid)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert children
    assert all_gone(children)


def test_no_such_device_and_no_such_link(cli: Cli) -> None:
    out, _ = cli("doctor", "--link", "/dev/ttyUSB77", code=3)
    assert "/dev/ttyUSB77 does not exist" in out
    out, err = cli("doctor", "--link", "carrier-pigeon", code=2)
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("--link: expected serial:///dev/X?baud=N, /dev/X, udp://HOST:PORT, pty or udp, got")
