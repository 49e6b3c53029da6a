"""Every verb of the command line, as a subprocess: data on stdout, one line of error on stderr, the right exit code."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import re
from pathlib import Path

import pytest

from sil.cli import VERBS as PANELS
from sil.cli import invoke

COLUMNS = [
    *("tick", "t_s", "phi_deg", "theta_deg", "psi_deg", "ref_phi_deg", "ref_theta_deg", "ref_psi_deg"),
    *("command_x_Nm", "command_y_Nm", "command_z_Nm", "applied_x_Nm", "applied_y_Nm", "applied_z_Nm"),
    *("w_x_radps", "w_y_radps", "w_z_radps", "h_x_Nms", "h_y_Nms", "h_z_Nms", "q_s", "q_x", "q_y", "q_z"),
]
VERBS = [verb.__name__.replace("_", "-") for verbs in PANELS.values() for verb in verbs]
SHORT = ("appc-rs232", "--set", "duration_s=30", "--set", "require=[]")


def test_run_prints_the_verdict_and_leaves_a_run_directory(cli):
    out, _ = cli("run", *SHORT, "--clock", "lockstep", "--out", "here")
    assert "passed" in out
    names = {path.name for path in (cli.folder / "here").iterdir()}
    assert {"run.mcap", "timing.mcap", "run.journal", "summary.json"} <= names


def test_json_is_one_object_with_the_published_keys(cli):
    summary = cli.json("run", *SHORT, "--clock", "lockstep")
    assert summary["verdict"] == "passed"
    assert summary["exit_code"] == 0
    assert summary["ticks"] == 60
    for name in ("rms_error_deg", "rms_setpoint_error_deg", "peak_error_deg", "peak_torque_Nm", "rms_torque_Nm"):
        assert len(summary["metrics"][name]) == 3
    assert {"missed", "late", "overruns", "crc_errors", "discarded_bytes"} <= set(summary["link"])
    assert {"wall_s", "seal_s", "times_real_time"} <= set(summary["timing"])
    for name in ("wakeup_us", "answer_us"):
        assert {"p50", "p99", "p99_9", "max"} == set(summary["timing"][name])
    assert summary["reproducible"] is True
    assert (cli.folder / summary["run_dir"] / "run.mcap").exists()
    assert json.loads((cli.folder / summary["run_dir"] / "summary.json").read_text()) == summary


def test_run_directories_are_numbered(cli):
    first, second = (cli.json("run", *SHORT, "--clock", "lockstep")["run_dir"] for _ in range(2))
    assert (first, second) == ("runs/appc-rs232-001", "runs/appc-rs232-002")


def test_plant_and_board_by_hand_over_udp(cli):
    board = cli.start("board", "--link", "udp://127.0.0.1:0", "--once")
    try:
        url = board.stdout.readline().split()[1]
        summary = cli.json("plant", *SHORT, "--link", url, "--clock", "lockstep")
        assert summary["ticks"] == 60
        assert board.wait(10) == 0
    finally:
        board.kill()
        board.communicate()


def test_plant_and_board_by_hand_over_a_pty(cli):
    plant = cli.start("plant", *SHORT, "--clock", "lockstep", "--json")
    line = plant.stderr.readline()
    url = line.split("--link ")[1].strip().rstrip(")")
    board = cli.start("board", "--link", url, "--once")
    try:
        out, _ = plant.communicate(timeout=120)
        assert json.loads(out)["ticks"] == 60
        assert board.wait(10) == 0
    finally:
        board.kill()
        board.communicate()


def test_plant_takes_the_link_of_the_scenario(cli):
    """--link has no default of its own."""
    board = cli.start("board", "--link", "udp://127.0.0.1:0", "--once")
    try:
        url = board.stdout.readline().split()[1]
        assert cli.json("plant", *SHORT, "--set", f"link.url={url}")["ticks"] == 60
        assert board.wait(10) == 0
    finally:
        board.kill()
        board.communicate()


@pytest.mark.parametrize("option", [("--link", "inproc"), ("--board", "inproc")])
def test_inproc_is_a_link_and_a_board(cli, option):
    summary = cli.json("run", *SHORT, *option)
    assert summary["verdict"] == "passed"
    assert not (cli.folder / summary["run_dir"] / "board.log").exists()


def test_replay_identical(cli, recorded):
    out, _ = cli("replay", str(recorded(*SHORT)))
    assert out.startswith("identical: 60 ticks")


def test_replay_in_a_board_process(cli, recorded):
    assert cli.json("replay", str(recorded(*SHORT)), "--board", "process")["identical"]


def test_replay_with_another_parameter_differs_and_says_where(cli, recorded):
    out, _ = cli("replay", str(recorded(*SHORT)), "--set", "law.params.controller_pole=0.6", code=1)
    assert "CONFIG differs: controller_pole" in out
    assert "differs at tick" in out
    assert "COMMAND tick=" in out


def test_diff(cli, recorded):
    same = recorded(*SHORT)
    other = recorded(*SHORT, "--set", "seed=5", "--set", "sensors.attitude.noise_deg=0.02")
    cli("diff", str(same), str(same))
    out, _ = cli("diff", str(same), str(other), code=1)
    assert out.strip()


def test_info(cli, recorded):
    out, _ = cli("info", str(recorded(*SHORT)))
    assert "appc-rs232" in out
    assert cli.json("info", str(recorded(*SHORT)))


@pytest.mark.parametrize("name", ["it.png", "it.pdf"])
def test_plot(cli, recorded, name):
    cli("plot", str(recorded(*SHORT)), "--out", name)
    head = (cli.folder / name).read_bytes()[:4]
    assert head == (b"\x89PNG" if name.endswith("png") else b"%PDF")


def test_export_has_the_published_columns(cli, recorded):
    cli("export", str(recorded(*SHORT)), "out.csv")
    rows = list(csv.reader(io.StringIO((cli.folder / "out.csv").read_text())))
    assert rows[0] == COLUMNS
    assert len(rows) == 61
    assert [float(rows[1][i]) for i in (0, 1, 2, 3, 4)] == pytest.approx([0, 0, 10, 10, 5])


def test_check_and_scenarios(cli):
    names = [entry["name"] for entry in cli.json("scenarios")]
    assert "mrac-rs232" in names
    for name in names:
        cli("check", name)


def test_recover(cli, recorded):
    run = recorded(*SHORT)
    before = (run / "run.mcap").read_bytes()
    (run / "run.mcap").unlink()
    out, _ = cli("recover", str(run))
    assert "60 ticks" in out
    assert (run / "run.mcap").read_bytes() == before


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(cli, verb):
    """What it is, how to call it, and an example that can be copied."""
    out, _ = cli(verb, "--help")
    assert "Usage" in out
    assert f"\n   sil {verb}" in out


@pytest.mark.parametrize("verb", ["run", "plant", "board", "replay", "recover", "check", "scenarios", "schema"])
def test_help_says_which_exit_codes_can_occur(cli, verb):
    out, _ = cli(verb, "--help")
    assert re.search(r"Exit codes *\n +0  \S", out)


def test_help_fits_a_narrow_terminal_and_has_no_colours_where_nobody_wants_them(cli):
    for verb in ("run", "replay"):
        process = cli.start(verb, "-h", env={**os.environ, "COLUMNS": "60", "NO_COLOR": "1"})
        out, _ = process.communicate(timeout=60)
        assert max(map(len, out.splitlines())) <= 60
        assert "\x1b" not in out


def test_version(cli):
    out, _ = cli("--version")
    assert re.fullmatch(r"sil [0-9.]+, layout of the frames [0-9a-f]{8}, Python 3\.[0-9.]+\n", out)


def test_quiet_is_the_verdict_in_one_line(cli):
    out, err = cli("run", *SHORT, "--link", "inproc", "-q")
    assert (len(out.splitlines()), err) == (1, "")
    assert "passed" in out
    assert "appc-rs232-001" in out
    out, err = cli("run", *SHORT, "--link", "inproc", "-q", "-v", code=2)
    assert (out, err) == ("", "-q, -v: expected one of them, got both\n")


def test_verbose_says_what_was_plugged_together(cli):
    _, err = cli("run", *SHORT, "--link", "inproc", "--verbose")
    assert "session: law appc" in err


def test_priority_and_cpus_are_short_for_keys_of_the_clock(cli, monkeypatch):
    from sil.verbs import run

    asked = []
    monkeypatch.setattr(run, "_run", lambda name, load, told, wired: asked.append(load().clock) or 0)
    run.run("appc-rs232", priority=50, cpus="0,1", clock="realtime", set_=["clock.priority=3", "clock.lab_cpu=7"])
    run.plant("appc-rs232", cpus=",1")
    found = [(clock.mode, clock.priority, clock.lab_cpu, clock.board_cpu) for clock in asked]
    assert found == [("realtime", 50, 0, 1), ("lockstep", None, None, 1)]


def test_the_schema_is_printed_and_found(cli):
    out, _ = cli("schema")
    assert json.loads(out)["title"] == "sil scenario"
    path, _ = cli("schema", "--path")
    assert Path(path.strip()).read_text(encoding="utf-8") == out
    checked, _ = cli("check", "mrac-rs232")
    assert checked.splitlines()[1].endswith(f"# yaml-language-server: $schema={path.strip()}")
    assert cli.json("check", "mrac-rs232")["schema"] == path.strip()


# -- bad input: one line, the exit code of DESIGN's table, nothing lost ------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("run", "no-such-scenario"), 2, "one of appc-rs232"),
        (("run", "appc-rs232", "--clock", "fast"), 2, "lockstep, realtime or scaled:N"),
        (("run", "appc-rs232", "--set", "law.name=lqr"), 2, "appc"),
        (("run", "appc-rs232", "--set", "period_s=2.0"), 2, "0.2 to 1"),
        (("run", "mrac-as-printed-no-delay", "--clock", "realtime"), 2, "lockstep"),
        (("run", "appc-rs232", "--set", "period_s=0.3", "--set", "answer_delay_s=0.345"), 2, "answer_delay_s"),
        (("run", "mrac-as-printed", "--set", "law.form=fixed"), 2, "finite trace_max"),
        (("run", "appc-rs232", "--out", "/proc/no"), 2, "/proc/no"),
        (("run", "appc-rs232", "--board", "serial:///dev/not-there"), 3, "/dev/not-there"),
        (("board", "--link", "carrier-pigeon"), 3, "carrier-pigeon"),
        (("replay", "nowhere"), 2, "nowhere"),
        (("info", "/etc/hostname"), 2, "/etc/hostname"),
        (("recover", "nowhere"), 2, "nowhere"),
        (("diff", "nowhere", "nowhere"), 2, "nowhere"),
        (("frobnicate",), 2, "frobnicate"),
        (("plant", "appc-udp", "--link", "inproc"), 2, "got 'inproc'"),
        (("run", "appc-rs232", "--set", "name=../../evil"), 2, "a name of letters"),
        (("run", "appc-rs232", "--clock", "scaled:0.001"), 2, "N from 0.01 to 1000"),
        (("run", "appc-rs232", "--cpus", "0-1"), 2, "--cpus: expected LAB,BOARD"),
        (("run", "appc-rs232", "--cpus", "0,1,2"), 2, "--cpus: expected LAB,BOARD"),
        (("run", "appc-rs232", "--priority", "100"), 2, "--priority"),
    ],
)
def test_bad_input_is_one_clear_line(cli, arguments, code, says):
    out, err = cli(*arguments, code=code)
    assert says in err
    assert "Traceback" not in err
    assert out == ""


@pytest.mark.parametrize("board", ["none", "wired", "serial:///dev/ttyUSB0"])
def test_replay_goes_into_a_fresh_board(cli, recorded, board):
    out, err = cli("replay", str(recorded(*SHORT)), "--board", board, code=2)
    assert (out, err) == ("", f"--board: expected one of inproc, process, native, cortex-m, qemu, got '{board}'\n")


def test_an_out_directory_that_is_not_empty_is_refused(cli):
    (cli.folder / "mine").mkdir()
    (cli.folder / "mine" / "thesis.txt").write_text("years of work")
    _, err = cli("run", *SHORT, "--out", "mine", code=2)
    assert "not empty" in err
    assert [path.name for path in (cli.folder / "mine").iterdir()] == ["thesis.txt"]


def test_a_busy_udp_port(cli):
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        _, err = cli("run", *SHORT, "--link", f"udp://127.0.0.1:{port}", code=3)
    assert str(port) in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "runs/x-001/summary.json"), 3,
         "runs/x-001/summary.json: No space left on device"),
        (OSError(errno.ENOSPC, "No space left on device"), 3, "No space left on device"),
        (PermissionError(errno.EACCES, "Permission denied", "own.yaml"), 2, "own.yaml: Permission denied"),
        (OSError("odd"), 2, "odd"),
    ],
)  # fmt: skip
def test_what_the_disk_says_is_told_of_its_file(error, code, said, monkeypatch, capsys):
    """No `[Errno 28]`; and a full disk is not the user's spelling: exit 3, not 2."""

    def fails(*_arguments, **_options):
        raise error

    monkeypatch.setattr("sil.scenario.load_scenario", fails)
    assert invoke(["run", "appc-rs232"]) == code
    assert capsys.readouterr().err == f"{said}\n"


@pytest.mark.parametrize("verb", ["run", "plot", "diff", "compare", "export", "replay"])
def test_options_of_a_verb_stand_in_named_groups(cli, verb):
    """What is left in the unnamed group is --help: else a reader of plot or diff looks for the rest in vain."""
    out, _ = cli(verb, "--help")
    unnamed = out.partition("─ Options ─")[2].partition("╰")[0]
    assert re.findall("--[a-z]+", unnamed) == ["--help"]
