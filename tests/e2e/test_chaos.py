"""Row 5: kill, stop and tear whatever a run is made of, with either board: the right exit code, or the run goes on.

The log can be recovered, and nobody is left running. Signals to the Python board alone are in
test_killed_and_interrupted.py, a laboratory that stands still on a clock in test_stopped_and_degraded.py.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from subprocesses import Cli, alive, children_of, quiet
from test_killed_and_interrupted import ticks_written, wait_for

from sil import open_run
from sil.pil import library
from sil.sinks.journal import read_journal

RUN = ("appc-rs232", "--set", "require=[]", "--out", "run", "--json")
LOCKSTEP = (*RUN, "--clock", "lockstep", "--set", "duration_s=2000")
LENIENT = ("--set", "timing.max_degraded_fraction=1")
PACED = (*RUN, "--clock", "scaled:20", "--set", "duration_s=80", *LENIENT)
BOARDS = ("process", "native")
STOPPED_s = 1.5
MODULES = {"process": "firmware_sim", "native": "sil.pil.native"}


def flying(cli: Cli, *arguments: str, ticks: int = 20) -> tuple[subprocess.Popen[str], int]:
    """(run, pid of its board) once it has written some ticks."""
    run = cli.start("run", *arguments)
    wait_for(lambda: ticks_written(cli.folder / "run") >= ticks or run.poll() is not None)
    assert run.poll() is None, run.communicate()
    (board,) = children_of(run.pid)
    return run, board


def ended(pid: int) -> None:
    """No orphan: gone within five seconds."""
    try:
        wait_for(lambda: not alive(pid), within_s=5)
    finally:
        quiet(pid)


def recovered(cli: Cli) -> int:
    """How many ticks `sil recover` finds: all that the journal holds whole."""
    written = ticks_written(cli.folder / "run")
    cli("recover", "run")
    run = open_run(cli.folder / "run")
    assert run.tick.tolist() == list(range(len(run)))
    assert len(run) in (written, written - 1)
    return len(run)


# -- killed ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "link"), [("process", "udp"), ("native", "pty")])
def test_a_killed_laboratory(cli, kind, link):
    run, board = flying(cli, *LOCKSTEP, "--board", kind, "--link", link)
    run.kill()
    run.communicate()
    ended(board)
    assert recovered(cli) >= 20


@pytest.mark.parametrize(("kind", "link"), [("process", "udp"), ("native", "pty")])
def test_a_killed_board(cli, kind, link):
    run, board = flying(cli, *LOCKSTEP, "--board", kind, "--link", link)
    os.kill(board, signal.SIGKILL)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 3
    assert "signal 9" in err.splitlines()[-1]
    assert "Traceback" not in err
    assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] >= 20


def test_both_killed_at_once(cli):
    run, board = flying(cli, *LOCKSTEP)
    for pid in (run.pid, board):
        os.kill(pid, signal.SIGKILL)
    run.communicate()
    ended(board)
    assert recovered(cli) >= 20


# -- stopped -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "who"), [("process", "laboratory"), ("process", "board"), ("native", "both")])
def test_stopped_and_continued_in_lockstep_not_a_byte_changes(cli, recorded, kind, who):
    clean = recorded("appc-rs232", "--set", "require=[]", "--set", "duration_s=2000")
    run, board = flying(cli, *LOCKSTEP, "--board", kind)
    pids = {"laboratory": (run.pid,), "board": (board,), "both": (run.pid, board)}[who]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    before = ticks_written(cli.folder / "run")
    time.sleep(STOPPED_s)
    assert ticks_written(cli.folder / "run") <= before + 2, "it went on"
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    out, err = run.communicate(timeout=120)
    assert run.returncode == 0, err
    assert json.loads(out)["sha256"] == json.loads((clean / "summary.json").read_text())["sha256"]
    ended(board)


@pytest.mark.parametrize("kind", ["native"])
def test_a_board_that_stood_still_on_a_clock_is_real_misses_and_the_run_goes_on(cli, kind):
    run, board = flying(cli, *PACED, "--board", kind)
    os.kill(board, signal.SIGSTOP)
    time.sleep(STOPPED_s / 3)
    os.kill(board, signal.SIGCONT)
    out, err = run.communicate(timeout=60)
    summary = json.loads(out)
    assert run.returncode == 0, err
    assert (summary["ticks"], summary["reason"]) == (160, "finished")
    assert summary["link"]["real_misses"] > 0 and not summary["reproducible"]
    assert len(open_run(cli.folder / "run")) == 160
    ended(board)


@pytest.mark.parametrize("kind", ["process"])
def test_a_board_that_never_goes_on_is_a_clear_line(cli, kind):
    run, board = flying(cli, *LOCKSTEP, "--board", kind)
    os.kill(board, signal.SIGSTOP)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 3
    assert "no answer to tick" in err.splitlines()[-1]
    assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] >= 20
    ended(board)


def test_workers_of_a_sweep_that_stood_still_for_a_while_change_nothing(cli):
    """What is longer than a while is a line, then a failed point: tests/sil/campaign/test_worker.py."""
    sweep = ("sweep", "pd-root-locus", "--vary", "seed=1:6", "--set", "sensors.attitude.noise_deg=0.01", "-j", "2")
    cli(*sweep, "--set", "require=[]", "--out", "clean")
    run = cli.start(*sweep, "--set", "require=[]", "--out", "stopped")
    flown = cli.folder / "stopped" / "results.jsonl"
    wait_for(lambda: (flown.exists() and flown.read_bytes().count(b"\n") >= 2) or run.poll() is not None)
    workers = children_of(run.pid)
    assert len(workers) == 2
    for pid in workers:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(STOPPED_s / 3)
    for pid in workers:
        os.kill(pid, signal.SIGCONT)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    one, two = ((cli.folder / name / "results.csv").read_bytes() for name in ("clean", "stopped"))
    assert one == two


# -- the line torn away ------------------------------------------------------------------------------------------------


class Cable:
    """Two ptys and what carries bytes between them, until it is torn."""

    def __init__(self) -> None:
        self._masters, self.paths = [], []
        for _ in range(2):
            master, slave = os.openpty()
            tty.setraw(slave)
            self.paths.append(os.ttyname(slave))
            os.close(slave)
            self._masters.append(master)
        self._torn = threading.Event()
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _carry(self) -> None:
        a, b = self._masters
        while not self._torn.is_set():
            for fd in select.select([a, b], [], [], 0.02)[0]:
                try:
                    os.write(b if fd == a else a, os.read(fd, 4096))
                except OSError as error:
                    if error.errno != errno.EIO:  # nobody has opened that end yet
                        raise
                    time.sleep(0.01)

    def tear(self) -> None:
        self._torn.set()
        self._thread.join()
        for fd in self._masters:
            with contextlib.suppress(OSError):
                os.close(fd)
        self._masters = []


@pytest.fixture
def cable() -> Iterator[Cable]:
    made = Cable()
    yield made
    made.tear()


@pytest.mark.parametrize("kind", BOARDS)
def test_a_line_that_is_torn_between_the_two(cli, cable, kind):
    lab_end, board_end = (f"serial://{path}" for path in cable.paths)
    board = subprocess.Popen(
        [sys.executable, "-P", "-m", MODULES[kind], "--link", board_end], stderr=subprocess.PIPE, text=True
    )
    try:
        run = cli.start("run", *LOCKSTEP, "--board", lab_end)
        wait_for(lambda: ticks_written(cli.folder / "run") >= 20 or run.poll() is not None)
        assert run.poll() is None, run.communicate()
        cable.tear()
        out, err = run.communicate(timeout=60)
        assert run.returncode == 3
        assert "gone" in err.splitlines()[-1] and "Traceback" not in err
        assert len(open_run(cli.folder / "run")) == json.loads(out)["ticks"] >= 20
        _, said = board.communicate(timeout=10)
        assert board.returncode in (0, 3) and "Traceback" not in said
    finally:
        board.kill()
        board.communicate()


# -- a full disk -------------------------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 100 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=100k", "tmpfs", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        pytest.skip("no mount here")
    if done.returncode != 0:
        pytest.skip(f"may not mount a small disk here: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize("kind", BOARDS)
def test_a_disk_that_fills_up(cli, small_disk, kind):
    """Exit 3 in one line; the journal is kept up to its last whole tick, and its log is made where there is room."""
    run = cli.start("run", *LOCKSTEP, "--board", kind, "--out", str(small_disk / "run"))
    wait_for(lambda: ticks_written(small_disk / "run") > 5 or run.poll() is not None)
    boards = children_of(run.pid)
    _, err = run.communicate(timeout=60)
    for board in boards:
        ended(board)
    assert run.returncode == 3
    assert "No space left on device" in err.splitlines()[-1] or "no space left" in err.splitlines()[-1]
    assert "Traceback" not in err
    journal = small_disk / "run" / "run.journal"
    assert read_journal(journal).damage == ""
    assert not list((small_disk / "run").glob("*.partial"))
    (cli.folder / "run").mkdir()
    (cli.folder / "run" / "run.journal").write_bytes(journal.read_bytes())
    assert recovered(cli) > 100


def test_recovering_on_a_full_disk_says_so_and_harms_nothing(cli, small_disk, recorded):
    source = recorded("appc-rs232", "--set", "require=[]", "--set", "duration_s=80")
    (small_disk / "run").mkdir()
    content = (source / "run.journal").read_bytes()
    (small_disk / "run" / "run.journal").write_bytes(content)
    (small_disk / "filler").write_bytes(bytes(100_000 // 4096 * 4096 - len(content) // 4096 * 4096 - 8192))
    _, err = cli("recover", str(small_disk / "run"), code=3)
    assert len(err.splitlines()) == 1 and "No space left" in err and "run.journal keeps it" in err
    assert (small_disk / "run" / "run.journal").read_bytes() == content
    assert [path.name for path in (small_disk / "run").iterdir()] == ["run.journal"]


# -- the host's clock --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def jumping(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which CLOCK_REALTIME jumps by two hours, to and fro, at every look."""
    path = tmp_path_factory.mktemp("clock") / "clock_steps.so"
    compiler = next(library.compilers())
    library.build(path, compiler, ["-O1", "-fPIC", "-shared", str(Path(__file__).parent / "clock_steps.c")])
    return {**os.environ, "LD_PRELOAD": str(path)}


def test_the_clock_does_jump(jumping):
    command = [sys.executable, "-c", "import time; print(abs(time.time() - time.time()) > 7000)"]
    assert subprocess.run(command, env=jumping, capture_output=True, text=True).stdout == "True\n"


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [("process", LOCKSTEP), ("native", LOCKSTEP), ("process", PACED)],
    ids=["process-lockstep", "native-lockstep", "process-paced"],
)
def test_steps_of_the_hosts_clock_change_nothing(cli, jumping, recorded, kind, arguments):
    """Both processes go by CLOCK_MONOTONIC alone."""
    duration = next(word for word in arguments if word.startswith("duration_s="))
    clean = recorded("appc-rs232", "--set", "require=[]", "--set", duration)
    run = cli.start("run", *arguments, "--board", kind, env=jumping)
    out, err = run.communicate(timeout=120)
    assert run.returncode == 0, err
    summary = json.loads(out)
    assert summary["timing"]["slipped_s"] < 5
    if summary["reproducible"]:
        assert summary["sha256"] == json.loads((clean / "summary.json").read_text())["sha256"]
    assert arguments is not LOCKSTEP or summary["reproducible"]
