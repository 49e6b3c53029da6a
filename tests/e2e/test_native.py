"""Board native: the firmware compiled for this machine, its main loop in C: the bytes of the Python board.

And a process that ends when it is told to, when the line ends, and when its parent dies.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from subprocesses import REPO, Cli, alive, quiet

from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.config import split
from protocol.frames import LAYOUT_HASH, Hello, Stop, Timing
from protocol.law_tables import config_words, law_by_name
from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_scenario
from sil.sinks.journal import Kind, read_housekeeping, read_journal

NOISY = ("sensors.attitude.noise_deg=0.02", "require=[]", "clock=lockstep")
LAWS = {"pd": "pd-root-locus", "mrac": "mrac-rs232", "appc": "appc-rs232"}
MODULE = (sys.executable, "-P", "-m", "sil.pil.native")


def fly(folder: Path, law: str, board: str, *sets: str) -> dict[str, object]:
    return run_scenario(load_scenario(LAWS[law], [*NOISY, f"board={board}", *sets]), folder)


# -- the same bytes (whole manoeuvres: test_cortex_m.py) -------------------------------------------------------------


@pytest.mark.parametrize("link", ["pty", "udp"])
def test_over_either_link_and_with_a_busy_board(tmp_path: Path, link: str) -> None:
    """An execution time that overruns exercises the ticks that are propagated, and events."""
    sets = ("duration_s=30", "period_s=0.3", "answer_delay_s=0.345", "expect_missed=true")
    python = fly(tmp_path / "python", "mrac", "inproc", *sets)
    native = fly(tmp_path / "native", "mrac", "native", f"link.url={link}", *sets)
    assert native["sha256"] == python["sha256"]


def test_on_a_clock_it_gives_the_lockstep_bytes(tmp_path: Path) -> None:
    """With its own timer. A real miss makes this inconclusive: repeated at most three times, then reported as such."""
    expected = fly(tmp_path / "lockstep", "appc", "inproc", "duration_s=40")["sha256"]
    for attempt in range(3):
        summary = fly(tmp_path / str(attempt), "appc", "native", "duration_s=40", "clock=scaled:20")
        if summary["reproducible"]:
            assert summary["sha256"] == expected
            return
    pytest.skip("not shown: real misses in three runs (this machine is too busy)")


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("replay") / "run"
    fly(folder, "mrac", "inproc", "duration_s=100")
    return folder


def test_replay_of_a_log_of_the_python_board_is_identical(logged: Path) -> None:
    report = replay(open_run(logged), (), "native")
    assert (report.identical, report.ticks, report.config) == (True, 200, [])


def test_replay_finds_another_parameter(logged: Path) -> None:
    assert replay(open_run(logged), ["law.params.c2_pole=0.7"], "native").first is not None


def test_timing_says_how_long_an_answer_took(tmp_path: Path) -> None:
    """With every sixteenth answer; housekeeping, so not in the bytes above."""
    fly(tmp_path / "run", "pd", "native", "duration_s=20")
    records = [r.payload for r in read_journal(tmp_path / "run" / "run.journal") if r.kind == Kind.HOUSEKEEPING]
    told = [frames.unpack(read_housekeeping(payload)[2]).frame for payload in records]
    timings = [frame for frame in told if isinstance(frame, Timing)]
    assert [timing.tick for timing in timings] == [15, 31]
    assert all(0 < timing.busy_ns < 10_000_000 for timing in timings)
    assert {timing[2:] for timing in timings} == {(0, 0, 0)}


# -- the process -----------------------------------------------------------------------------------------------------


class Native:
    """The process on a pty (or UDP) of ours."""

    def __init__(self, *arguments: str, url: str = "") -> None:
        self.fd = -1
        if not url:
            self.fd, slave = os.openpty()
            tty.setraw(slave)
            url = f"serial://{os.ttyname(slave)}"
        command = [*MODULE, "--link", url, *arguments]
        self.process = subprocess.Popen(command, cwd=REPO, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.said = self.process.stdout.readline()
        if self.fd >= 0:
            os.close(slave)

    @property
    def url(self) -> str:
        return self.said.split()[1]

    def hear(self, *sent: frames.Frame, count: int = 1) -> list[frames.Frame]:
        """Send, and wait for so many frames."""
        os.write(self.fd, b"".join(encode(frames.pack(frame, 0)) for frame in sent))
        decoder, got, give_up = StreamDecoder(), [], time.monotonic() + 20.0
        while len(got) < count:
            assert time.monotonic() < give_up, got
            if select.select([self.fd], (), (), 0.1)[0]:
                got += [frames.unpack(packet).frame for packet in decoder.feed(os.read(self.fd, 4096))]
        return got

    def end(self, number: int | None = None) -> tuple[int, str]:
        """(exit code, stderr), after a signal if one is named."""
        if number is not None:
            self.process.send_signal(number)
        try:
            _, said = self.process.communicate(timeout=20)
        finally:
            quiet(self.process.pid)
        return self.process.returncode, said


@pytest.fixture
def native() -> Iterator[Native]:
    made = Native()
    made.hear()
    yield made
    quiet(made.process.pid)
    made.process.communicate()
    os.close(made.fd)


def hello(nonce: int, rate: int = 0) -> Hello:
    return Hello(1, 0, 0, LAYOUT_HASH, nonce, rate, "test")


def test_without_samples_its_own_timer_steps(native: Native) -> None:
    """T_s 0.2 s at twenty times real time: an answer every 10 ms, on a machine that may be busy."""
    words = config_words(law_by_name("pd"), {"period_us": 200_000, "sample_timeout_us": 40_000})
    first = frames.Sample(
        0, *[(0, 0, 0)] * 3, frames.NO_TICK, 0, frames.ZERO, 1, (frames.Reading(0, (0, 0, 0)), None, None)
    )
    native.hear(hello(7, 20 * 65536))
    native.hear(*split(words))
    began = time.monotonic()
    heard = native.hear(first, count=30)
    took_s = time.monotonic() - began
    ticks = [frame.tick for frame in heard if isinstance(frame, frames.Command)]
    assert ticks == list(range(len(ticks)))
    assert took_s > 0.010 * (len(ticks) - 1), "not before their time"
    assert took_s < 5.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_at_once(native: Native, number: int) -> None:
    """While its main loop waits in C for bytes that do not come."""
    began = time.monotonic()
    assert native.end(number) == (0, "")
    assert time.monotonic() - began < 1.5


def test_it_says_what_it_is(native: Native) -> None:
    (echo,) = native.hear(hello(7))
    assert isinstance(echo, Hello)
    assert echo.build.startswith("fw native ")
    assert echo.flags == frames.HELLO_OWN_TIMER | frames.HELLO_ECHO


def test_it_serves_one_session_after_the_other(native: Native) -> None:
    for nonce in (7, 8):
        native.hear(hello(nonce))
        os.write(native.fd, encode(frames.pack(Stop(0), 0)))
    native.hear(hello(9))
    os.close(native.fd)
    native.fd = os.open(os.devnull, os.O_RDONLY)
    assert native.end()[0] == 3, "the third was not stopped"


def test_once_it_ends_with_the_session() -> None:
    native = Native("--once")
    native.hear()
    native.hear(hello(7))
    os.write(native.fd, encode(frames.pack(Stop(0), 0)))
    assert native.end() == (0, "")
    os.close(native.fd)


def test_the_end_of_the_line_is_a_link_failure_that_says_so() -> None:
    """Nobody said STOP before."""
    native = Native()
    native.hear()
    os.close(native.fd)
    code, said = native.end()
    assert code == 3
    assert "the other end is gone" in said
    assert len(said.splitlines()) == 1


def test_the_end_of_the_line_after_a_session_is_none() -> None:
    native = Native()
    native.hear()
    native.hear(hello(7))
    os.write(native.fd, encode(frames.pack(Stop(0), 0)))
    time.sleep(0.3)  # what a board has not read when the line ends is lost
    os.close(native.fd)
    assert native.end() == (0, "")


def stuck_board() -> Native:
    """It has been asked for more answers than the pty holds, and nobody reads them: it takes nothing more."""
    native, refused = Native(), 0
    os.set_blocking(native.fd, False)
    while refused < 10:
        try:
            os.write(native.fd, encode(frames.pack(hello(7), 0)))
            refused = 0
        except BlockingIOError:
            refused += 1
            time.sleep(0.02)
    return native


def test_a_lab_that_does_not_read_is_given_up() -> None:
    """SPEC 3.4: after 5 s without room for an answer."""
    native = stuck_board()
    code, said = native.end()
    assert code == 3
    assert "the other end does not read" in said
    os.close(native.fd)


def test_a_signal_ends_the_waiting_for_room() -> None:
    native = stuck_board()
    assert native.end(signal.SIGTERM) == (0, "")
    os.close(native.fd)


def test_it_dies_with_its_parent() -> None:
    script = (
        "import subprocess, sys, os\n"
        f"child = subprocess.Popen([*{MODULE!r}, '--link', 'udp://127.0.0.1:0', '--parent', str(os.getpid())],"
        " stdout=subprocess.PIPE, text=True)\n"
        "child.stdout.readline(); print(child.pid, flush=True); os.kill(os.getpid(), 9)\n"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, timeout=60, check=False)
    pid, give_up = int(done.stdout), time.monotonic() + 10
    while alive(pid):
        assert time.monotonic() < give_up
        time.sleep(0.02)


def test_over_udp_a_started_board_serves_one_lab_after_the_other(cli: Cli) -> None:
    short = ("pd-root-locus", "--set", "duration_s=5", "--set", "require=[]", "--clock", "lockstep", "--out")
    native = Native(url="udp://127.0.0.1:0")
    for number in "12":
        cli("run", *short, number, "--board", native.url)
    assert native.end(signal.SIGTERM) == (0, "")
    assert len({open_run(cli.folder / number).summary["sha256"] for number in "12"}) == 1


@pytest.mark.parametrize("url", ["udp://192.0.2.1:5", "serial:///dev/nowhere", "carrier://pigeon"])
def test_a_link_that_cannot_be_opened_is_one_line(url: str) -> None:
    code, said = Native(url=url).end()
    assert code == 3
    assert len(said.splitlines()) == 1


def test_without_a_compiler_a_run_says_what_to_install(cli: Cli) -> None:
    """An empty cache, and a $CC that is none."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cli.folder / "cache"), "CC": "no-such-compiler"}
    process = cli.start("run", "pd-root-locus", "--board", "native", env=environment)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("native: no-such-compiler: ")
    assert err.endswith("install gcc, or pip install ziglang\n")
    assert len(err.splitlines()) == 1
