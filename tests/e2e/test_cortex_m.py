"""Board cortex-m: the firmware's image flies whole manoeuvres and leaves the bytes of the Python board.

What can go wrong with it is one line with the remedy, and nobody is left running.
"""

from __future__ import annotations

import os
import select
import shutil
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from subprocesses import REPO, Cli, alive, children_of, quiet

from protocol.laws import IN_C
from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_scenario
from tools.firmware_image import build

NOISY = ("sensors.attitude.noise_deg=0.02", "require=[]", "clock=lockstep")
LAWS = {"pd": "pd-root-locus", "mrac": "mrac-rs232", "appc": "appc-rs232"}
MODULE = (sys.executable, "-P", "-m", "sil.pil.cortex_m")
NEEDS = "cortex-m: needs unicorn: pip install 'attitude-sil[pil]'"


def fly(folder: Path, law: str, board: str, *sets: str) -> str:
    """sha256 of run.mcap."""
    return str(run_scenario(load_scenario(LAWS[law], [*NOISY, f"board={board}", *sets]), folder)["sha256"])


# -- the same bytes --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", ["A", "B"])
@pytest.mark.parametrize("law", LAWS)
def test_a_whole_manoeuvre_leaves_the_bytes_of_the_python_board(tmp_path: Path, law: str, profile: str) -> None:
    """On the emulated processor and, compiled for this machine, as the board native."""
    boards = ("inproc", "cortex-m", "native")
    python, firmware, native = (fly(tmp_path / board, law, board, f"guidance.profile={profile}") for board in boards)
    assert firmware == native == python


@pytest.mark.parametrize("link", ["pty", "udp"])
def test_over_either_link_and_with_a_busy_board(tmp_path: Path, link: str) -> None:
    """An execution time that overruns exercises the ticks that are propagated, and events."""
    sets = (f"link.url={link}", "duration_s=30", "period_s=0.3", "answer_delay_s=0.345", "expect_missed=true")
    python, firmware = (fly(tmp_path / board, "mrac", board, *sets) for board in ("process", "cortex-m"))
    assert firmware == python


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("replay") / "run"
    fly(folder, "mrac", "inproc", "duration_s=100")
    return folder


def test_replay_of_a_log_of_the_python_board_is_identical(recorded: Path) -> None:
    report = replay(open_run(recorded), (), "cortex-m")
    assert (report.identical, report.ticks, report.config) == (True, 200, [])


def test_replay_finds_another_parameter(recorded: Path) -> None:
    """The comparison above can fail."""
    report = replay(open_run(recorded), ["law.params.c2_pole=0.7"], "cortex-m")
    assert report.first is not None


# -- refused before anything is run ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        ({"law.form": "float"}, "law.form: expected fixed for board cortex-m, the firmware's arithmetic"),
        ({"clock": "realtime"}, "expected lockstep for board cortex-m, which has no timer of its own"),
        ({"link": "inproc"}, "expected pty or udp for board cortex-m, a process of this machine, got 'inproc'"),
        ({"law.name": "./mine.py:Mine"}, f"expected {', '.join(sorted(IN_C))} for board cortex-m, the laws in C"),
    ],
)
def test_what_the_firmware_does_not_fly(cli: Cli, sets: dict[str, str], says: str) -> None:
    (cli.folder / "mine.py").write_text("class Mine:\n    PARAMS = {}\n")
    (cli.folder / "s.yaml").write_text("law: {name: appc}\nboard: cortex-m\n")
    options = [part for key, value in sets.items() for part in ("--set", f"{key}={value}")]
    for verb in ("check", "run"):
        out, err = cli(verb, "s.yaml", *options, code=2)
        assert says in out + err
    assert not (cli.folder / "runs").exists()


def test_replay_of_a_float_law_is_refused(cli: Cli) -> None:
    cli(
        "run", "pd-root-locus", "--set", "law.form=float", "--set", "duration_s=5", "--out", "it", "--set", "require=[]"
    )
    out, err = cli("replay", "it", "--board", "cortex-m", code=2)
    assert out == ""
    assert "expected fixed for board cortex-m" in err


@pytest.mark.parametrize("words", [("run", "pd-root-locus", "--board", "cortex-m"), ("board-test", "cortex-m")])
def test_without_unicorn_a_verb_says_what_to_install(cli: Cli, words: tuple[str, ...]) -> None:
    package = cli.folder / "path" / "unicorn"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('not here')\n")
    process = cli.start(*words, env={**os.environ, "PYTHONPATH": str(package.parent)})
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (2, "", NEEDS + "\n")
    assert not list((cli.folder / "runs").glob("*")), "nothing was run, nothing is left"


def test_an_image_of_another_layout_is_refused_with_the_remedy(cli: Cli) -> None:
    """A board of another version of the frames: HELLO says so, and nothing is flown."""
    firmware = cli.folder / "firmware"
    shutil.copytree(REPO / "firmware", firmware, ignore=shutil.ignore_patterns("build", "images"))
    generated = firmware / "core" / "generated" / "frames.h"
    text = generated.read_text(encoding="utf-8")
    assert "A72D0D2F" in text
    generated.write_text(text.replace("A72D0D2F", "DEADBEEF"), encoding="utf-8")
    made = build("mps2-an386", cli.folder / "built", "-C", str(firmware))
    with Hosted("--image", str(made)) as url:
        out, err = cli("run", "pd-root-locus", "--board", url, code=3)
    assert out == ""
    assert "expected layout a72d0d2f, got deadbeef, built from other frame layouts" in err
    assert "make firmware" in err


def test_at_an_address_only_its_hello_says_that_it_has_no_timer(cli: Cli) -> None:
    with Hosted() as url:
        out, err = cli("run", "appc-rs232", "--board", url, "--clock", "scaled:20", code=3)
    assert out == ""
    assert "expected one with its own timer for a paced clock, got one without: use --clock lockstep" in err


@pytest.mark.parametrize("file", ["nowhere.elf", "text.elf"])
def test_an_image_that_is_none_is_one_line(tmp_path: Path, file: str) -> None:
    (tmp_path / "text.elf").write_text("no image")
    command = [*MODULE, "--link", "udp://127.0.0.1:0", "--image", str(tmp_path / file)]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"cortex-m: {tmp_path / file}: ")
    assert len(done.stderr.splitlines()) == 1


# -- the process -----------------------------------------------------------------------------------------------------


class Hosted:
    """`with Hosted(...) as url`: the process on a free UDP port, ended afterwards; `code`: how."""

    def __init__(self, *arguments: str, link: str = "udp://127.0.0.1:0") -> None:
        command = [*MODULE, "--link", link, *arguments]
        self.process = subprocess.Popen(command, cwd=REPO, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def __enter__(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line.startswith("listening "), self.process.communicate()
        return line.split()[1]

    def __exit__(self, *_: object) -> None:
        self.end(signal.SIGTERM)

    def end(self, number: int | None = None) -> tuple[int, str]:
        """(exit code, stderr), after a signal if one is named."""
        if number is not None:
            self.process.send_signal(number)
        try:
            _, said = self.process.communicate(timeout=20)
        finally:
            quiet(self.process.pid)
        return self.process.returncode, said


class Line:
    """The lab's end of a pty, and the board process on the other."""

    def __init__(self, *arguments: str) -> None:
        self.fd, slave = os.openpty()
        tty.setraw(slave)
        self.board = Hosted(*arguments, link=f"serial://{os.ttyname(slave)}")
        self.board.__enter__()
        os.close(slave)

    def __call__(self, send: bytes = b"", expect: bytes = b"", within_s: float = 20.0) -> bytes:
        """Send, and read until `expect` has come."""
        os.write(self.fd, send)
        got, give_up = b"", time.monotonic() + within_s
        while expect not in got:
            assert time.monotonic() < give_up, got
            if select.select([self.fd], (), (), 0.1)[0]:
                got += os.read(self.fd, 4096)
        return got


@pytest.fixture(scope="module")
def provoked(tmp_path_factory: pytest.TempPathFactory) -> str:
    source = REPO / "tests" / "sil" / "pil" / "provoked.c"
    return str(build("mps2-an386", tmp_path_factory.mktemp("provoked"), f"MAIN={source}"))


@pytest.fixture
def line(provoked: str) -> Iterator[Line]:
    made = Line("--image", provoked)
    made(expect=b"boot")
    yield made
    quiet(made.board.process.pid)
    made.board.process.communicate()


def test_sigterm_ends_it_at_once_idle_or_hanging(line: Line) -> None:
    line(b"h")
    time.sleep(0.2)
    began = time.monotonic()
    assert line.board.end(signal.SIGTERM) == (0, "")
    assert time.monotonic() - began < 1.5


def test_sigusr1_is_the_reset_button_idle_or_hanging(line: Line) -> None:
    line.board.process.send_signal(signal.SIGUSR1)
    line(expect=b"boot")
    line(b"h")
    time.sleep(0.2)
    line.board.process.send_signal(signal.SIGUSR1)
    line(expect=b"boot")
    code, said = line.board.end(signal.SIGTERM)
    assert code == 0
    assert [each.partition(",")[0] for each in said.splitlines()] == [
        "cortex-m: reset: the button was pressed (SIGUSR1)"
    ] * 2


def test_the_end_of_the_line_is_a_link_failure_that_says_so(line: Line) -> None:
    """Nobody said STOP before."""
    os.close(line.fd)
    code, said = line.board.end()
    assert code == 3
    assert "the other end is gone" in said


def test_a_reset_storm_ends_it_with_one_line(line: Line) -> None:
    for _ in range(10):
        line(b"s", expect=b"boot")
    line(b"s")
    code, said = line.board.end()
    assert code == 4
    assert said.splitlines()[-1] == "cortex-m: 10 resets within 10 s, the last one: software"


def test_it_dies_with_its_parent(tmp_path: Path) -> None:
    script = (
        "import subprocess, sys, os\n"
        f"child = subprocess.Popen([*{MODULE!r}, '--link', 'udp://127.0.0.1:0', '--parent', str(os.getpid())],"
        " stdout=subprocess.PIPE, text=True)\n"
        "child.stdout.readline(); print(child.pid, flush=True); os.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=REPO, capture_output=True, text=True, timeout=60, check=False
    )
    pid, give_up = int(done.stdout), time.monotonic() + 10
    while alive(pid):
        assert time.monotonic() < give_up
        time.sleep(0.02)


def test_once_over_udp_ends_with_the_session_and_without_it_serves_the_next(cli: Cli) -> None:
    short = ("pd-root-locus", "--set", "duration_s=5", "--set", "require=[]", "--clock", "lockstep", "--out")
    single, many = Hosted("--once"), Hosted()
    with many as url:
        for number in "12":
            cli("run", *short, f"many{number}", "--board", url)
    with single as url:
        cli("run", *short, "single", "--board", url)
        assert single.end() == (0, "")
    shas = {open_run(cli.folder / name).summary["sha256"] for name in ("many1", "many2", "single")}
    assert len(shas) == 1


def test_a_reset_in_mid_run_is_one_line_that_says_why(cli: Cli) -> None:
    process = cli.start(
        "run", "appc-rs232", "--board", "cortex-m", "--set", "duration_s=50000", "--set", "require=[]", "--out", "run"
    )
    journal, give_up = cli.folder / "run" / "run.journal", time.monotonic() + 60
    while not journal.exists() or journal.stat().st_size < 10**5:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < give_up
        time.sleep(0.02)
    (pid,) = children_of(process.pid)
    os.kill(pid, signal.SIGUSR1)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    last = err.splitlines()[-1]
    assert last.startswith("board: restarted at tick ")
    assert ": cortex-m: reset: the button was pressed (SIGUSR1), at " in last
    assert not alive(pid)
