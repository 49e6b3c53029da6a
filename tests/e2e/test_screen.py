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

from subprocesses import alive, children_of, quiet

HIDE_CURSOR, SHOW_CURSOR = b"\x1b[?25l", b"\x1b[?25h"
PACED = ("rigid-open-loop", "--clock", "scaled:200", "--set", "duration_s=260")  # 1.3 s, without a board


class Terminal:
    """`sil run` whose standard error is a pseudo-terminal; standard output is kept apart."""

    def __init__(self, folder: Path, arguments: tuple[str, ...], size: tuple[int, int], **env: str) -> None:
        self._master, slave = os.openpty()
        self.resize(size)
        self.seen = b""
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "sil", "run", *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=slave,
            env={**os.environ, "TERM": "xterm-256color", **env},
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
def terminal(folder: Path, *arguments: str, size: tuple[int, int] = (100, 30), **env: str) -> Iterator[Terminal]:
    made = Terminal(folder, arguments, size, **env)
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
