"""What surrounds a run may be unkind: laws that print, pipes that nobody reads, closed streams, odd names."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

SHORT = ("appc-rs232", "--set", "duration_s=30", "--set", "require=[]")

CHATTY = """
import os
print("loading the law")
os.system("echo a child of the law speaks, too")
class Chatty:
    PARAMS = {}
    def init(self, params):
        print("parameters", params)
    def step(self, sample):
        print("x" * 4000)
        return (0.0, 0.0, 0.0)
"""

IMPOSTOR = """
import sys
import time
if "firmware_sim" in sys.orig_argv:
    print("hello", flush=True)
    time.sleep(60)
"""


def shell(cli, line: str) -> tuple[int, str, str]:
    """(exit code of sil, not of what reads from it; stdout; stderr) of a line of bash in which $SIL is the command."""
    done = subprocess.run(
        ["bash", "-c", f"{line}; exit ${{PIPESTATUS[0]}}"],
        cwd=cli.folder,
        env={**os.environ, "SIL": f"{sys.executable} -P -m sil"},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("link", ["pty", "udp"])
def test_a_law_may_print_as_much_as_it_likes(cli, link):
    """While it is loaded, and 400 kB in flight: to board.log, since nobody reads the process's standard output."""
    (cli.folder / "chatty.py").write_text(CHATTY)
    (cli.folder / "s.yaml").write_text("law: {name: ./chatty.py:Chatty, form: float}\nduration_s: 50\n")
    summary = cli.json("run", "s.yaml", "--link", link, "--set", "metrics.diverged_deg=null")
    assert summary["verdict"] == "passed"
    log = (cli.folder / summary["run_dir"] / "board.log").read_text()
    assert log.startswith("loading the law\na child of the law speaks, too\n")
    assert log.count("x" * 4000) >= 100


def test_a_board_process_that_says_something_else_is_one_line(cli):
    """Something on its path prints before it does, and it never ends."""
    (cli.folder / "sitecustomize.py").write_text(IMPOSTOR)
    code, out, err = shell(cli, f"PYTHONPATH=$PWD $SIL run {' '.join(SHORT[:1])}")
    assert code == 3
    assert out == ""
    assert err.splitlines() == ["board: the controller process said 'hello', expected 'listening URL'"]


@pytest.mark.parametrize(
    "line",
    [
        "$SIL scenarios | true",
        "$SIL --help | true",
        "$SIL info {run} | head -1",
        "$SIL info {run} --json | head -1",
        "$SIL export {run} - | head -1",
        "$SIL diff {run} {run} | true",
        "$SIL replay {run} | true",
        "$SIL run appc-rs232 --set duration_s=30 --set require=[] --json | true",
        "$SIL run appc-rs232 --set duration_s=30 --set require=[] | true",
    ],
)
def test_a_reader_that_leaves_early_is_no_error(cli, recorded, line):
    code, _, err = shell(cli, line.format(run=recorded(*SHORT)))
    assert (code, err) == (0, "")


def test_a_failed_requirement_is_exit_code_1_read_or_unread(cli):
    require = "--set 'require=[{metric: missed, above: 5}]'"
    code, _, err = shell(cli, f"$SIL run appc-rs232 --set duration_s=30 {require} | true")
    assert (code, err) == (1, "")


def test_output_that_cannot_be_written_is_an_error(cli, recorded):
    for verb in ("export {run} -", "scenarios"):
        code, _, err = shell(cli, f"$SIL {verb.format(run=recorded(*SHORT))} > /dev/full")
        assert code == 3  # no usage error: there is no room
        assert len(err.splitlines()) == 1
        assert "No space left" in err


@pytest.mark.parametrize("closed", ["2>&-", ">&-", "<&-", "<&- >&- 2>&-", "2>/dev/full"])
def test_closed_streams(cli, closed):
    """In particular, the journal does not become the standard error of the run."""
    code, _, _ = shell(cli, f"$SIL run {' '.join(SHORT)} --out run {closed}")
    assert code == 0
    assert json.loads((cli.folder / "run" / "summary.json").read_text())["verdict"] == "passed"
    code, _, _ = shell(cli, f"$SIL replay run {closed}")
    assert code == 0


def test_errors_with_standard_error_closed_keep_their_exit_code(cli):
    code, out, _ = shell(cli, "$SIL run no-such-scenario 2>&-")
    assert (code, out) == (2, "")


def test_nobody_reads_the_notes_of_a_long_run(cli):
    """Standard error is a pipe whose reader has gone when "sealing the log of 20002 ticks" is said."""
    code, out, _ = shell(cli, f"$SIL run {' '.join(SHORT)} --set duration_s=10001 --json 2> >(true)")
    assert code == 0
    assert json.loads(out)["ticks"] == 20002
