"""The live view as a terminal gets it: in a pseudo-terminal that reads, stops reading, is resized, or loses its run."""

from __future__ import annotations

import fcntl
import json
import os
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from subprocesses import alive, children_of, quiet

HIDE_CURSOR, SHOW_CURSOR = b"\x1b[?25l", b"\x1b[?25h"
BEGIN_FRAME = b"\x1b[?2026h"
BROKEN_VIEW = """
import os
from sil import cli
from sil.screen.reading import Reader

whole = Reader.state

def state(*arguments):
    if os.path.exists("break-it"):
        raise RuntimeError("broken on purpose")
    return whole(*arguments)

Reader.state = state
cli.main()
"""
PACED = ("rigid-open-loop", "--clock", "scaled:200", "--set", "duration_s=260")  # 1.3 s, without a board


class Terminal:
    """`sil run` (by `script`, where there is one) whose standard error is a pseudo-terminal; stdout is kept apart."""

    def __init__(
        self, folder: Path, arguments: tuple[str, ...], size: tuple[int, int], script: str, **env: str
    ) -> None:
        self._master, slave = os.openpty()
        self.resize(size)
        self.seen = b""
        self.process = subprocess.Popen(
            [sys.executable, "-P", *(("-c", script) if script else ("-m", "sil")), "run", *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=slave,
            env={**os.environ, "TERM": "xterm-256color", **env},
            process_group=0,  # what Ctrl-Z stops
        )
        os.close(slave)

    def resize(self, size: tuple[int, int]) -> None:
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))

    def read_until(self, done: Callable[[], bool], within_s: float = 60.0) -> None:
        """Take what the run writes until `done()`."""
        give_up = time.monotonic() + within_s
        while not done():
            assert time.monotonic() < give_up, self.seen[-2000:]
            if select.select([self._master], [], [], 0.05)[0]:
                try:
                    self.seen += os.read(self._master, 65536)
                except OSError:  # the last one that held the terminal is gone
                    return

    def end(self) -> str:
        """Read to the end; standard output."""
        self.read_until(lambda: False)
        assert self.process.stdout is not None
        out = self.process.stdout.read().decode()
        self.process.wait(60)
        return out

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        os.close(self._master)


@contextmanager
def terminal(
    folder: Path, *arguments: str, size: tuple[int, int] = (100, 30), script: str = "", **env: str
) -> Iterator[Terminal]:
    made = Terminal(folder, arguments, size, script, **env)
    try:
        yield made
    finally:
        made.close()


def test_a_terminal_shows_the_view_and_gets_its_cursor_back(tmp_path: Path) -> None:
    """Protects: what is drawn is the run, the summary is on stdout alone, the cursor is visible afterwards."""
    with terminal(tmp_path, *PACED) as screen:
        out = screen.end()
    text = screen.seen.decode()
    assert all(word in text for word in ("rigid-open-loop", "torque, mN m", "wake-up late", "100 %", "over"))
    assert screen.seen.rindex(SHOW_CURSOR) > screen.seen.rindex(HIDE_CURSOR)
    assert "\x1b[?1049h" not in text, "the alternate screen would take the last view away"
    assert "rms torque" in out and "\x1b" not in out


def test_no_color_is_honoured(tmp_path: Path) -> None:
    """Protects: with NO_COLOR the view uses bold and dim, never a colour."""
    with terminal(tmp_path, *PACED, NO_COLOR="1") as screen:
        screen.end()
    assert b"torque, mN m" in screen.seen and b"38;5;" not in screen.seen


def test_a_terminal_that_cannot_gets_lines(tmp_path: Path) -> None:
    """Protects: a dumb, narrow terminal gets no cursor movements at all, and the numbers of the summary are whole."""
    with terminal(tmp_path, *PACED, size=(30, 24), TERM="dumb") as screen:
        out = screen.end()
    assert b"\x1b" not in screen.seen
    assert "rms torque" in out and "…" not in out


def test_a_terminal_that_stops_reading_does_not_stop_the_run(tmp_path: Path) -> None:
    """Protects: nothing in a paced run waits for whoever shows it (Ctrl-S, a slow line), and its log is complete."""
    with terminal(tmp_path, *PACED, "--out", "it", size=(160, 45)) as screen:
        summary = tmp_path / "it" / "summary.json"
        give_up = time.monotonic() + 60
        while not summary.exists():  # nobody reads
            assert time.monotonic() < give_up
            time.sleep(0.1)
        screen.end()
    assert json.loads(summary.read_text())["reason"] == "finished"
    assert screen.process.returncode in (0, 3)


def test_a_resized_window_is_filled_anew(tmp_path: Path) -> None:
    """Protects: the view follows the size of the window, and nothing longer than its width is ever written."""
    with terminal(tmp_path, *PACED, size=(80, 24)) as screen:
        screen.read_until(lambda: b"torque" in screen.seen)
        assert b"pitch attitude, deg" not in screen.seen.partition(b"yaw")[0]
        screen.resize((160, 50))
        before = len(screen.seen)
        screen.read_until(lambda: b"\x1b[2J" in screen.seen[before:] and b"torque" in screen.seen[before:])
        screen.end()
    assert screen.process.returncode in (0, 3)


def test_ctrl_c_leaves_the_terminal_in_order(tmp_path: Path) -> None:
    """Protects: the view ends, the cursor is back, the summary of the interrupted run follows."""
    with terminal(tmp_path, "rigid-open-loop", "--clock", "realtime") as screen:
        screen.read_until(lambda: b"wake-up late" in screen.seen)
        screen.process.send_signal(signal.SIGINT)
        out = screen.end()
    assert screen.process.returncode == 130
    assert out.startswith("interrupted")
    assert screen.seen.rindex(SHOW_CURSOR) > screen.seen.rindex(HIDE_CURSOR)


def test_a_killed_run_leaves_nobody_drawing(tmp_path: Path) -> None:
    """Protects: after kill -9 the process that draws shows the cursor and ends by itself."""
    with terminal(tmp_path, "rigid-open-loop", "--clock", "realtime") as screen:
        screen.read_until(lambda: b"wake-up late" in screen.seen)
        (painter,) = children_of(screen.process.pid)
        try:
            screen.process.kill()
            screen.process.wait()
            screen.read_until(lambda: not alive(painter))
        finally:
            quiet(painter)
    assert screen.seen.rindex(SHOW_CURSOR) > screen.seen.rindex(HIDE_CURSOR)


def test_a_painter_that_dies_does_not_end_the_run(tmp_path: Path) -> None:
    """Protects: drawing is no part of the run; without it the run goes on and ends as it would."""
    with terminal(tmp_path, *PACED) as screen:
        screen.read_until(lambda: b"wake-up late" in screen.seen)
        (painter,) = children_of(screen.process.pid)
        os.kill(painter, signal.SIGKILL)
        out = screen.end()
    assert screen.process.returncode in (0, 3) and "rms torque" in out


def test_a_view_that_fails_ends_before_it_is_said_and_nothing_is_drawn_over_what_follows(tmp_path: Path) -> None:
    """Protects: a broken view costs the view: the cursor is back, then the reason, then the summary, and no frame."""
    said = b"view: RuntimeError: broken on purpose; the run goes on without it"
    with terminal(tmp_path, "rigid-open-loop", "--clock", "realtime", script=BROKEN_VIEW) as screen:
        screen.read_until(lambda: b"wake-up late" in screen.seen)
        (tmp_path / "break-it").touch()
        screen.read_until(lambda: said in screen.seen)
        assert not children_of(screen.process.pid), "nobody draws any more"
        screen.process.send_signal(signal.SIGINT)
        out = screen.end()
    assert out.startswith("interrupted")
    before, _, after = screen.seen.partition(said)
    assert before.rindex(SHOW_CURSOR) > before.rindex(HIDE_CURSOR)
    assert before.endswith(b"\n"), "a line of its own"
    assert BEGIN_FRAME not in after and after.strip() == b""


def test_ctrl_z_shows_the_cursor_and_fg_the_view(tmp_path: Path) -> None:
    """Protects: the shell gets a terminal in order while the run is stopped, and the view is back afterwards."""
    with terminal(tmp_path, "rigid-open-loop", "--clock", "realtime") as screen:
        screen.read_until(lambda: b"wake-up late" in screen.seen)
        (painter,) = children_of(screen.process.pid)
        os.killpg(screen.process.pid, signal.SIGTSTP)
        screen.read_until(lambda: is_stopped(screen.process.pid) and is_stopped(painter))
        screen.read_until(lambda: screen.seen.rfind(SHOW_CURSOR) > screen.seen.rfind(HIDE_CURSOR), 5.0)
        stopped_at = len(screen.seen)
        os.killpg(screen.process.pid, signal.SIGCONT)
        screen.read_until(lambda: b"wake-up late" in screen.seen[stopped_at:])
        screen.process.send_signal(signal.SIGINT)
        out = screen.end()
    assert out.startswith("interrupted")
    assert HIDE_CURSOR in screen.seen[stopped_at:]
    assert b"\x1b[2J" not in screen.seen, "what the shell wrote stays"
    assert screen.seen.rindex(SHOW_CURSOR) > screen.seen.rindex(HIDE_CURSOR)


def is_stopped(pid: int) -> bool:
    """By Ctrl-Z."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


def test_the_view_is_drawn_on_the_cpus_that_the_run_was_started_on(tmp_path: Path) -> None:
    """Protects: `taskset` holds for all of `sil run`; a CPU that the run takes for itself is not for drawing alone."""
    usable = os.sched_getaffinity(0)
    if len(usable) < 2:
        pytest.skip("with one CPU there is nothing to choose")
    for started_on, lab_cpu in (({min(usable)}, min(usable)), (usable, max(usable))):
        os.sched_setaffinity(0, started_on)
        try:
            with terminal(tmp_path, *PACED, "--set", f"clock.lab_cpu={lab_cpu}") as screen:
                screen.read_until(lambda: b"wake-up late" in screen.seen)
                (painter,) = children_of(screen.process.pid)
                assert os.sched_getaffinity(painter) == started_on
        finally:
            os.sched_setaffinity(0, usable)
