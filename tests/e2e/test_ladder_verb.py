"""`sil ladder` as it is typed: real boards, the table, what is kept, what cannot be flown, Ctrl-C in the middle."""

from __future__ import annotations

import json
import os
import select
import signal
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
from subprocesses import Cli, all_gone, children_of

SHORT = ("ladder", "mrac-rs232", "--set", "duration_s=20", "--set", "require=[]")


def test_from_the_float_law_to_the_emulated_firmware(cli: Cli) -> None:
    content = cli.json(*SHORT)
    rungs = {rung["rung"]: rung for rung in content["rungs"]}
    assert list(rungs) == ["float", "fixed", "native", "cortex-m"]
    assert [rungs[name]["verdict"] for name in rungs] == ["passed"] * 4
    fixed = [rungs[name] for name in ("fixed", "native", "cortex-m")]
    assert len({rung["sha256"] for rung in fixed}) == 1
    assert [rung["identical"] for rung in fixed] == [False, True, True]
    assert 0 < rungs["fixed"]["max_attitude_deg"] < 0.01
    assert 0 < rungs["fixed"]["max_torque_Nm"] < 1e-3
    assert 1000 < rungs["cortex-m"]["instructions_per_step"]["mean"] < 40_000
    assert content["ladder_dir"] == "runs/mrac-rs232-ladder-001"
    kept = cli.folder / content["ladder_dir"]
    assert json.loads((kept / "ladder.json").read_text()) == content
    for name in rungs:
        assert (kept / name / "run.mcap").is_file()
    out, _ = cli("diff", str(kept / "fixed"), str(kept / "cortex-m"))
    assert out.startswith("identical")


def test_the_table_and_the_progress(cli: Cli) -> None:
    out, err = cli(*SHORT, "--rungs", "float,fixed", "--junit", "ci.xml", "--out", "here")
    assert out.splitlines()[1].split()[:4] == ["rung", "what", "runs", "verdict"]
    assert out.splitlines()[-2].startswith("passed  mrac-rs232: 2 of 2 rungs flown")
    begun = [line for line in err.splitlines() if line.startswith("running ")]
    assert begun == ["running float (1 of 2)", "running fixed (2 of 2)"]
    cases = ElementTree.fromstring((cli.folder / "ci.xml").read_bytes()).iter("testcase")
    assert [case.get("name") for case in cases] == ["rung float", "rung fixed"]
    cli(*SHORT, "--out", "here", code=2)  # not empty


def test_a_requirement_that_is_not_met(cli: Cli) -> None:
    out, _ = cli(*SHORT[:4], "--rungs", "fixed", "--set", "require=[{metric: missed, above: 5}]", code=1)
    assert "fixed: not met: missed > 5   got 0" in out
    assert out.splitlines()[-2].startswith("failed")


def test_what_cannot_run_here_is_said_with_its_remedy(cli: Cli) -> None:
    process = cli.start(*SHORT, "--rungs", "fixed", "--with", "qemu", env={**os.environ, "PATH": "/nonexistent"})
    out, err = process.communicate(timeout=120)
    assert process.returncode == 3, err
    line = next(line for line in out.splitlines() if line.startswith("qemu: "))
    assert "apt-get install" in line
    assert out.splitlines()[-2].startswith("not shown  mrac-rs232: 1 of 2 rungs flown")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(("ladder", "rigid-open-loop"), "got board none"), (("ladder", "no-such"), "no-such"),
     ((*SHORT, "--rungs", "fixt"), "(did you mean fixed?)"), ((*SHORT, "--set", "board=inproc"), "--set board")],
)  # fmt: skip
def test_usage(cli: Cli, arguments: tuple[str, ...], said: str) -> None:
    out, err = cli(*arguments, code=2)
    assert (out, err.count("\n")) == ("", 1)
    assert said in err
    assert not (cli.folder / "runs").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_keeps_what_was_flown_and_leaves_nobody_behind(cli: Cli, number: signal.Signals) -> None:
    endless = (
        *SHORT[:2],
        "--set",
        "duration_s=500000",
        "--set",
        "guidance.profile=hold",
        "--set",
        "require=[]",
        "--rungs",
        "fixed,native",
    )
    process = cli.start(*endless, "--out", "here", "--json")
    journal = cli.folder / "here" / "fixed" / "run.journal"
    try:
        until = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < until and not _is_long(journal):
            select.select([], [], [], 0.05)
        children = children_of(process.pid)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert children
    assert all_gone(children)
    content = json.loads(out)
    assert (content["verdict"], content["exit_code"]) == ("interrupted", 130)
    assert [rung["verdict"] for rung in content["rungs"]] == ["interrupted"]
    cli("info", "here/fixed")


def _is_long(file: Path) -> bool:
    return file.exists() and file.stat().st_size > 100_000
