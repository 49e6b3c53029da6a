"""`sil board-test` as it is typed: boards of every kind, a cable, a board that is busy, Ctrl-C in the middle."""

from __future__ import annotations

import json
import select
import signal
import subprocess
import sys
from xml.etree import ElementTree

import pytest
from cables import Cable
from subprocesses import Cli, all_gone, children_of

from protocol import frames

QUICK = ("--ticks", "40", "--exchanges", "20", "--drift-s", "1")
FAILED = "fail"


def statuses(content: dict[str, list[dict[str, str]]], status: str) -> list[str]:
    return [
        f"{each['group']}: {each['check']}: {each['found']}" for each in content["checks"] if each["status"] == status
    ]


@pytest.mark.parametrize(
    ("board", "options"),
    [("process", ("--skip", "config", "--skip", "timer")), ("native", ()), ("cortex-m", ()),
     ("native", ("--link", "udp", "--only", "receiver", "--only", "reset", "--only", "numbers")),
     ("cortex-m", ("--link", "udp", "--only", "receiver", "--only", "reset", "--only", "numbers"))],
)  # fmt: skip
def test_our_own_boards_pass_everything(cli: Cli, board: str, options: tuple[str, ...]) -> None:
    process = cli.start("board-test", board, *QUICK, *options, "--json")
    out, err = process.communicate(timeout=240)
    content = json.loads(out)
    assert statuses(content, FAILED) == []
    assert (process.returncode, content["passed"]) == (0, True), err
    assert len(statuses(content, "pass")) >= (10 if "udp" in options else 30)


def test_a_board_on_a_cable_is_left_without_a_session(cli: Cli, cable: Cable) -> None:
    out, _ = cli("board-test", cable.lab, *QUICK, "--only", "states", "--only", "ticks: stale", "--junit", "ci.xml")
    assert out.splitlines()[-1].startswith(f"pass  {cable.lab}: ")
    assert "fail" not in {line.split()[0] for line in out.splitlines() if line}
    assert frames.Type.STOP in cable.types[-3:]
    root = ElementTree.fromstring((cli.folder / "ci.xml").read_bytes())
    assert (root.get("failures"), root.get("errors")) == ("0", "0")
    assert "ticks: stale" in [case.get("name") for case in root.iter("testcase")]


def test_a_port_that_another_program_has_open_is_not_touched(cli: Cli, cable: Cable) -> None:
    holder = [
        sys.executable,
        "-c",
        "import sys; f = open(sys.argv[1], 'rb', 0); print(1, flush=True); input()",
        cable.lab,
    ]
    with subprocess.Popen(holder, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        heard = len(cable.types)
        out, _ = cli("board-test", cable.lab, code=3)
        assert len(cable.types) == heard
        process.communicate(b"\n")
    assert "openers" in out
    assert out.splitlines()[-1].startswith(f"fail  {cable.lab}: ")


def test_no_board_and_no_such_board(cli: Cli) -> None:
    out, _ = cli("board-test", "/dev/ttyUSB77", code=3)
    assert "/dev/ttyUSB77 does not exist" in out
    for arguments, said in (
        (("carrier-pigeon",), "board-test: expected process, native, cortex-m, qemu, serial:///dev/X"),
        (("native", "--only", "tick"), "(did you mean ticks?)"),
        (("native", "--flight", "rigid-open-loop"), "--flight: expected a scenario with a law"),
    ):
        out, err = cli("board-test", *arguments, code=2)
        assert (out, err.count("\n")) == ("", 1)
        assert said in err


def test_a_board_that_is_not_to_be_had_is_one_line_with_the_remedy(cli: Cli) -> None:
    process = cli.start("board-test", "qemu", "--json", env={"PATH": "/nonexistent"})
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (2, "")
    (line,) = err.splitlines()
    assert "apt-get install" in line


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupted_it_says_stop(cli: Cli, cable: Cable, number: signal.Signals) -> None:
    process = cli.start("board-test", cable.lab, "--only", "latency", "--exchanges", "1000000")
    try:
        while process.poll() is None and cable.types.count(frames.Type.SAMPLE) < 50:
            select.select([], [], [], 0.02)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert err.splitlines()[-1] == "interrupted"
    assert "laws" in out
    assert frames.Type.STOP in cable.types[-2:]


def test_its_own_board_does_not_outlive_it(cli: Cli) -> None:
    process = cli.start("board-test", "process", "--only", "latency", "--exchanges", "1000000")
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
