"""The process that draws: `python -m sil.screen.painter CPU...`, datagrams on stdin, the view on stderr.

A process of its own, because drawing takes milliseconds and a terminal may stop taking characters (Ctrl-S, slow line):
neither may reach the laboratory's loop. It ends when the laboratory says so or is gone, however that came about, and
leaves the cursor as it found it.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
import time
from typing import IO, Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

from sil.screen import messages, view
from sil.screen.messages import BEGIN_FRAME, BIGGEST, END_FRAME, End, Line, Message, Plan, State
from sil.screen.seen import Seen

DRAW_EVERY_S = 0.1
COST_SHARE = 0.2  # of the time, at most, goes into drawing
LOOK_EVERY_S = 0.5  # at the size of the window, when nothing comes
LINES_AT_ONCE = 5000
READY = b"ready"
NO_SIZE = os.terminal_size((0, 0))


def main() -> None:
    """Draw until the run is over."""
    stay_out_of_the_way({int(cpu) for cpu in sys.argv[1:]})
    orders = socket.socket(fileno=0)
    painter = Painter(orders, Console(file=_WholeFrames(sys.stderr), force_terminal=True))  # type: ignore[arg-type]
    signal.signal(signal.SIGTSTP, painter.stop_asked)
    try:
        orders.send(READY)
        painter.work()
    except OSError:
        return  # the terminal is gone, and nobody is left to tell


def stay_out_of_the_way(cpus: set[int]) -> None:
    """Ordinary priority, the CPUs that the laboratory was started on, nice: what a run was granted is not for drawing.

    Ctrl-C is the laboratory's too.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, cpus)
        os.nice(10)
    except OSError:
        return


class Painter:
    """Takes what comes, draws the newest at most ten times a second."""

    def __init__(self, orders: socket.socket, console: Console) -> None:
        self._orders, self._console = orders, console
        self._seen: Seen | None = None
        self._size = NO_SIZE
        self._live: Live | None = None
        self._lines: list[str] = []  # that stay above the view; printed together, since each print draws the view anew
        self._over = False
        self._drawing = self._to_stop = False

    def work(self) -> None:
        """Until End, or until nobody is on the other end."""
        try:
            while not self._over:
                began = time.monotonic()
                if select.select([self._orders], [], [], LOOK_EVERY_S)[0]:
                    self._take_all()
                woke = time.monotonic()
                self._draw_whole()
                now = time.monotonic()
                pause_s = max(began + DRAW_EVERY_S, now + (now - woke) / COST_SHARE) - now
                time.sleep(0.0 if self._over else max(0.0, pause_s))
        finally:
            if self._live is not None:
                self._live.stop()

    def _take_all(self) -> None:
        """Everything that has come by now: after a stopped terminal, only the newest is worth drawing."""
        while not self._over and len(self._lines) < LINES_AT_ONCE:
            try:
                data = self._orders.recv(BIGGEST, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except ConnectionError:
                data = b""
            self._take(messages.unpack(data) if data else End())

    def _take(self, message: Message) -> None:
        if isinstance(message, Plan):
            self._seen = Seen(message)
        elif isinstance(message, State) and self._seen is not None:
            self._seen.take(message)
        elif isinstance(message, Line):
            self._lines.append(message.text)
        elif isinstance(message, End):
            self._over = True

    def stop_asked(self, *_: object) -> None:
        """Ctrl-Z: at once, or when what is being drawn is whole."""
        if self._drawing:
            self._to_stop = True
        else:
            self._stand_still()

    def _stand_still(self) -> None:
        """Leave the terminal in order, stop as whoever knows nothing of Ctrl-Z does, and draw anew when continued."""
        self._to_stop = False
        mine = signal.signal(signal.SIGTSTP, signal.SIG_IGN)  # one at a time
        if self._live is not None:
            self._live.stop()
            self._live = None
        self._size = NO_SIZE
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)  # comes back with SIGCONT
        signal.signal(signal.SIGTSTP, mine)

    def _draw_whole(self) -> None:
        self._drawing = True
        self._draw()
        self._drawing = False
        if self._to_stop:
            self._stand_still()

    def _draw(self) -> None:
        if self._lines:
            self._console.print(Text("\n".join(self._lines)), soft_wrap=True)
            self._lines.clear()
        if self._seen is None or self._seen.state is None:
            return
        self._seen.ended = self._over
        size = os.get_terminal_size(sys.stderr.fileno())
        if size != self._size:
            self._begin_anew(size)
        assert self._live is not None
        self._live.refresh()

    def _begin_anew(self, size: os.terminal_size) -> None:
        """The window has another size: the terminal wrapped the old lines anew, nobody knows where they are now."""
        if self._live is not None:
            self._live.stop()
            self._console.clear()
        self._size = size
        self._console.size = size  # type: ignore[assignment]
        assert self._seen is not None
        self._live = Live(_Frame(self._seen), console=self._console, auto_refresh=False, vertical_overflow="crop")
        self._live.start()


class _Frame:
    """The view as rich renders it: anew each time, for the size of the window."""

    def __init__(self, seen: Seen) -> None:
        self._seen = seen

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text("\n", end="", no_wrap=True, overflow="crop").join(
            view.lines(self._seen, options.max_width, console.height - 1)
        )


class _WholeFrames:
    """A text file whose every write is shown at once: no half-drawn view in between."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file

    def write(self, text: str) -> int:
        return self._file.write(f"{BEGIN_FRAME}{text}{END_FRAME}")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


if __name__ == "__main__":
    main()
