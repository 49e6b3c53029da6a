"""sil sweep as a user runs it: the same tables whoever flies, and nothing that is finished is ever lost."""

from __future__ import annotations

import csv
import json
import signal
import time
from pathlib import Path

import pytest
from subprocesses import alive, children_of, quiet

from sil.verbs import sweep

TABLES = ("results.csv", "results.json", "summary.json")
SHORT = ("--set", "duration_s=20", "--set", "require=[]")
DRAWN = ("--vary", "plant.initial.attitude_deg.0=uniform(-30,30)", "--vary", "plant.inertia_kgm2.0=uniform(1,8)")
CONDITIONS = (
    "mrac-rs232",
    *DRAWN,
    "--vary",
    "seed=uniform(1,1000000)",
    "--seed",
    "42",
    "--set",
    "require=[]",
    "--set",
    "duration_s=200",
)

WILD = """
import os, signal, time
import numpy as np

class Wild:
    PARAMS = {"how": (0.0, "1", 1.0)}

    def init(self, params):
        self.how = params["how"]

    def step(self, sample):
        if self.how == 1 and sample.tick == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        if self.how == 2 and sample.tick == 5:
            raise RuntimeError("a bug of mine")
        if os.path.exists("slow"):
            time.sleep(0.05)
        print("a law may print")
        return np.zeros(3)
"""


def wait_for(condition, within_s=60.0):
    give_up = time.monotonic() + within_s
    while not (value := condition()):
        assert time.monotonic() < give_up, "it did not happen in time"
        time.sleep(0.01)
    return value


def table(folder: Path) -> list[dict[str, str]]:
    with open(folder / "results.csv", newline="") as file:
        return list(csv.DictReader(file))


def lines(folder: Path) -> int:
    file = folder / "results.jsonl"
    return file.read_bytes().count(b"\n") - 1 if file.exists() else 0


def same_tables(one: Path, other: Path) -> None:
    for name in ("plan.json", *TABLES):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_one_worker_two_workers_and_an_interruption_give_the_same_tables(cli):
    cli("sweep", *CONDITIONS, "-n", "6", "-j", "1", "--out", "one")
    cli("sweep", *CONDITIONS, "-n", "6", "-j", "2", "--out", "two")
    same_tables(cli.folder / "one", cli.folder / "two")
    rows = table(cli.folder / "one")
    assert [row["point"] for row in rows] == list("123456")
    assert len({row["sha256"] for row in rows}) == 6

    process = cli.start("sweep", *CONDITIONS, "-n", "6", "-j", "1", "--out", "cut")
    wait_for(lambda: lines(cli.folder / "cut") >= 2 or process.poll() is not None)
    (worker,) = children_of(process.pid)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "go on with: sil sweep --resume cut" in err
    assert not alive(worker)
    finished = len(table(cli.folder / "cut"))
    assert 2 <= finished < 6
    assert not (cli.folder / "cut" / "runs").exists()

    with open(cli.folder / "cut" / "results.jsonl", "a") as file:
        file.write('{"point": 6, "verdict": "pas')  # and then the power went
    _, err = cli("sweep", "--resume", "cut", "-j", "2")
    assert "1 damaged lines" in err
    same_tables(cli.folder / "one", cli.folder / "cut")
    assert lines(cli.folder / "cut") == 6  # what was finished was not flown again


def test_a_point_is_the_run_one_gets_alone(cli):
    cli("sweep", "appc-rs232", "--vary", "sensors.attitude.noise_deg=0.01,0.02", *SHORT, "--keep", "all", "--out", "s")
    alone = cli.json(
        "run", "appc-rs232", "--clock", "lockstep", "--set", "sensors.attitude.noise_deg=0.02", *SHORT, "--out", "r"
    )
    row = table(cli.folder / "s")[1]
    assert row["sha256"] == alone["sha256"]
    assert float(row["rms_error_deg.yaw"]) == alone["metrics"]["rms_error_deg"][2]
    kept = json.loads((cli.folder / "s" / "runs" / "0002" / "summary.json").read_text())
    assert kept["sha256"] == alone["sha256"]
    assert (kept["board"], alone["board"]) == ("inproc", "process")


def test_a_worker_that_dies_costs_its_point_only(cli):
    (cli.folder / "wild.py").write_text(WILD)
    (cli.folder / "wild.yaml").write_text("law: {name: ./wild.py:Wild, form: float}\n")
    out, _ = cli(
        "sweep", "wild.yaml", "--vary", "law.params.how=0,1,2", "--vary", "seed=1:2", *SHORT, "-j", "2",
        "--keep", "on-fail", "--out", "s", code=3,
    )  # fmt: skip
    rows = table(cli.folder / "s")
    assert [row["exit_code"] for row in rows] == ["0", "0", "3", "3", "3", "3"]
    assert [row["verdict"] for row in rows] == ["passed"] * 2 + ["failed"] * 4
    assert "signal 9 (SIGKILL)" in rows[2]["reason"]
    assert "a bug of mine" in rows[4]["reason"]
    assert "SIGKILL" in out and "a bug of mine" in out
    kept = {folder.name for folder in (cli.folder / "s" / "runs").iterdir()}
    assert {"0005", "0006"} <= kept and not kept & {"0001", "0002"}
    before = {name: (cli.folder / "s" / name).read_bytes() for name in TABLES}
    cli("sweep", "--resume", "s", "--retry-failed", code=3)
    assert before == {name: (cli.folder / "s" / name).read_bytes() for name in TABLES}
    (cli.folder / "wild.py").write_text(WILD.replace("a bug", "another bug"))
    _, err = cli("sweep", "--resume", "s", code=2)
    assert "wild.py (another content)" in err


def test_a_kept_run_stays_until_its_point_was_flown_once_more(cli):
    """--again is what one uses to look at a run: an interruption must not leave half of it in its place."""
    (cli.folder / "wild.py").write_text(WILD)
    (cli.folder / "wild.yaml").write_text("law: {name: ./wild.py:Wild, form: float}\n")
    cli("sweep", "wild.yaml", "--vary", "seed=1:2", *SHORT, "-j", "1", "--keep", "all", "--out", "s")
    kept = cli.folder / "s" / "runs" / "0001"
    before = {file.name: file.read_bytes() for file in kept.iterdir()}
    assert json.loads(before["summary.json"])["run_dir"] == str(kept)

    (cli.folder / "slow").touch()
    process = cli.start("sweep", "--resume", "s", "--again", "1")
    wait_for(lambda: kept.with_name("0001.new").exists() or process.poll() is not None)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "interrupted after 0 of 1 points; go on with: sil sweep --resume s --again 1" in err
    assert "point 1:" not in err
    assert {file.name: file.read_bytes() for file in kept.iterdir()} == before
    assert {folder.name for folder in kept.parent.iterdir()} == {"0001", "0002"}

    (cli.folder / "slow").unlink()
    _, err = cli("sweep", "--resume", "s", "--again", "1")
    assert err.strip() == "point 1: s/runs/0001"
    assert (kept / "run.mcap").read_bytes() == before["run.mcap"]
    assert {folder.name for folder in kept.parent.iterdir()} == {"0001", "0002"}


def test_a_sweep_that_is_terminated_while_it_plans_says_so(cli):
    process = cli.start("sweep", "mrac-rs232", "--vary", "seed=1:100000", "--out", "s")
    assert process.stderr is not None
    assert process.stderr.readline().startswith("planning: ")
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130 and err.endswith("interrupted\n")
    assert not list(cli.folder.iterdir())


@pytest.mark.parametrize(
    ("varied", "board"), [([], "inproc"), (["seed"], "inproc"), (["link.url"], "process"), (["board"], "process")]
)
def test_what_is_varied_of_link_and_board_is_not_set_aside(varied, board):
    """In process there is no link: --vary link.url=pty,udp compared two runs of the same."""
    assert sweep.base_of("mrac-rs232", [], varied, clock=None, link=None, board=None).board == board


def test_requirements_and_refused_points_decide_the_exit_code(cli):
    strict = ("--set", "duration_s=20", "--set", "require=[{metric: rms_error_deg.max, below: 1e-9}]")
    summary = cli.json("sweep", "appc-rs232", "--vary", "plant.inertia_kgm2.0=2.13,7", *strict, "--out", "s", code=1)
    assert summary["verdicts"] == {"failed": 1, "invalid": 1}
    assert (summary["exit_code"], summary["finished"], summary["points"]) == (1, 2, 2)
    failed, refused = table(cli.folder / "s")
    assert (failed["exit_code"], refused["exit_code"], refused["sha256"]) == ("1", "2", "")
    assert failed["reason"].startswith("rms_error_deg.max < 1e-09, got ")
    assert "sum of the other two" in refused["reason"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["mrac-rs232", "--vary", "law.params.c2_pool=1,2"], "unknown key; known: design, c2_pole"),
        (["mrac-rs232", "--vary", "seed=gauss(1,2)"], "one of uniform, log, normal, choice"),
        (["--resume", "nowhere"], "expected the directory of a sweep"),
        (["--resume", ""], "expected the directory of a sweep, got an empty text"),
        (["--resume", "s", "--again", "1", "--keep", "none"], "--again: expected neither --keep nor"),
        (["mrac-rs232", "--vary", "clock=realtime,lockstep"], "--clock says it for all points"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(cli, arguments, said):
    out, err = cli("sweep", *arguments, code=2)
    assert said in err and err.count("\n") == 1 and not out
    assert not list(cli.folder.iterdir())


def test_workers_die_with_a_sweep_that_is_killed_and_it_goes_on_later(cli):
    process = cli.start(
        "sweep", "appc-rs232", "--vary", "seed=1:2", "--set", "duration_s=1000", "-j", "2", "--out", "s"
    )
    workers = wait_for(lambda: len(found := children_of(process.pid)) == 2 and found)
    wait_for(lambda: (cli.folder / "s" / "runs").exists())
    process.kill()
    process.communicate()
    try:
        wait_for(lambda: not any(map(alive, workers)), within_s=5)
    finally:
        for worker in workers:
            quiet(worker)
    cli("sweep", "--resume", "s", "--set", "x=1", code=2)  # the plan says all
    cli("sweep", "--resume", "s", "-j", "2")
    assert [row["verdict"] for row in table(cli.folder / "s")] == ["passed"] * 2
    assert not (cli.folder / "s" / "runs").exists()
