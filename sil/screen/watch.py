"""The watches of a run: one says nothing, one prints lines, one has a view drawn by a process of its own.

A look at the rig costs the loop's thread some ten microseconds and one datagram that never blocks; the view is drawn
elsewhere (sil.screen.painter). What a slow terminal does not take is dropped and counted, never waited for.
"""

from __future__ import annotations

import atexit
import errno
import math
import os
import select
import socket
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from typing import TYPE_CHECKING

from sil.launched import child_environment
from sil.screen import QUIET, VERBOSE, facts, messages
from sil.screen.messages import END_FRAME, SHOW_CURSOR, End, Line, Message, Plan
from sil.screen.reading import Reader, plan_of
from sil.signals import Motion
from sil.sinks.events import describe, level_of
from sil.watch import Watch

if TYPE_CHECKING:
    from sil.rig import Rig
    from sil.scenario import Scenario

QUIET_S = 1.0  # nothing is drawn for a run that is over sooner
DRAW_EVERY_S = 0.1
SELDOM_S = 1.0  # where a look costs a good part of a period
PLAIN_EVERY_S = 10.0
COST_SHARE = 0.02  # of the time, at most, goes into looking
PATIENCE_S = 5.0  # for the process that draws to begin, and to end, on a busy machine
STOPPED_S = 1.0  # for it to end where the terminal takes nothing
MOST_LINES = 1000  # that wait for a look
TOLD_EACH = 3  # events of one kind that get a line of their own; later ones are counted
LOOK_S = 0.1
NARROWEST, LOWEST = 40, 8  # a window smaller than this gets lines


def chosen(title: str, verbosity: int, as_json: bool) -> Watch:
    """What suits standard error; arguments as in sil.screen.new_watch."""
    if verbosity <= QUIET:
        return Watch()
    if as_json:
        return Silent()
    return Live(title, verbosity) if can_show_a_view() else Lines(title, verbosity)


def can_show_a_view() -> bool:
    """Standard error is a terminal that moves its cursor, knows the characters, and is not tiny."""
    try:
        width, height = os.get_terminal_size(sys.stderr.fileno())
    except (OSError, ValueError):
        return False
    able = os.environ.get("TERM", "dumb") not in ("", "dumb", "unknown")
    unicode = (sys.stderr.encoding or "").lower().replace("-", "") == "utf8"
    return sys.stderr.isatty() and able and unicode and width >= NARROWEST and height >= LOWEST


class Silent(Watch):
    """Notes on stderr, nothing else: for --json."""

    def note(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)


class Lines(Watch):
    """A line every ten seconds, and events: for files, pipes, and terminals that cannot do more."""

    def __init__(self, title: str, verbosity: int = 0) -> None:
        self._title, self._verbosity = title, verbosity
        self._paced = False
        self._in_a_hurry = False  # nothing may wait for a terminal
        self._plan: Plan | None = None
        self._reader: Reader | None = None
        self._next_s = 0.0
        self._dropped = 0
        self._seen: Counter[int] = Counter()  # events of each kind
        self._untold: Counter[int] = Counter()

    # -- what a run calls ----------------------------------------------------------------------------------------

    def note(self, line: str) -> None:
        self._say(line)

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        self._plan = plan_of(scenario, rig)
        self._reader = Reader(scenario, rig, self._plan.follows)
        self._paced = rig.clock.paced
        if self._verbosity >= VERBOSE:
            for line in facts.lines(scenario, rig):
                self._say(line)

    def stage(self, name: str) -> None:
        self._in_a_hurry = name == "seal" or (name == "run" and self._paced)
        self._next_s = time.monotonic() + PLAIN_EVERY_S
        if name == "seal":
            self._over()

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        assert self._reader is not None
        self._reader.take(tick, motion)
        now = time.monotonic()
        if now >= self._next_s:
            self._next_s = now + PLAIN_EVERY_S
            self._say(f"{self._title}: {facts.progress(self._reader.state(tick, motion), tick + 1, ticks)}")
            self._reader.told()
            self._tell_untold()

    def event(self, tick: int, code: int, a: int, b: int, origin: int = 0) -> None:
        if self._reader is not None:
            self._reader.event(tick, code, a, b, origin)
        self._event_line(tick, code, a, b, origin)

    # -- lines ---------------------------------------------------------------------------------------------------

    def _event_line(self, tick: int, code: int, a: int, b: int, origin: int) -> None:
        """Every event with -v; otherwise the first few warnings and errors of each kind."""
        self._seen[code] += 1
        if self._verbosity < VERBOSE and (level_of(code) == "info" or self._seen[code] > TOLD_EACH):
            self._untold[code] += level_of(code) != "info"
            return
        t_s = tick * self._plan.period_s if self._plan is not None else 0.0
        self._say(f"{t_s:9.3f} s  {'board' if origin else 'laboratory'}: {describe(code, a, b)[1]}")

    def _tell_untold(self) -> None:
        told = [f"{describe(code, 0, 0)[1].partition(':')[0]} {count}" for code, count in self._untold.items() if count]
        if told:
            self._say(f"more events: {', '.join(told)}")
        self._untold.clear()

    def _say(self, line: str) -> None:
        """A line on stderr. Neither a paced run nor the sealing of its log waits for whoever reads it."""
        if self._in_a_hurry and not _takes_more():
            self._dropped += 1
            return
        print(line, file=sys.stderr, flush=True)

    def _over(self) -> None:
        self._tell_untold()
        if self._dropped:
            self._say(f"{self._dropped} lines were not shown: nobody read them in time")


class Live(Lines):
    """The view, drawn by another process from the moment a run is known to take longer than a second."""

    def __init__(self, title: str, verbosity: int = 0) -> None:
        super().__init__(title, verbosity)
        self._painter: Painter | None = None
        self._can_start = True
        self._cpus = os.sched_getaffinity(0)  # before the run takes one for itself
        self._waiting: list[str] = []  # lines for the next look: one datagram, however many
        self._last: tuple[int, Motion] | None = None

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        super().plugged(scenario, rig)
        assert self._plan is not None
        if rig.clock.paced and self._plan.duration_s / rig.clock.scale > QUIET_S:
            self._start_painter()

    def stage(self, name: str) -> None:
        super().stage(name)
        self._next_s = time.monotonic() + (DRAW_EVERY_S if self._painter is not None else QUIET_S)

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        assert self._reader is not None
        self._reader.take(tick, motion)
        self._last = (tick, motion)
        now = time.monotonic()
        if now >= self._next_s:
            self._look(tick, motion, now)

    def close(self) -> None:
        """Nothing more is drawn, and nothing waits: the run goes on."""
        self._can_start = False
        if self._painter is not None:
            self._painter.kill()
            self._painter = None
        while self._waiting:
            self._say(self._waiting.pop(0))

    def _look(self, tick: int, motion: Motion, now: float) -> None:
        if self._painter is None:
            self._start_painter()
        if self._painter is None:
            self._next_s = math.inf
            return
        self._tell(tick, motion)
        cost_s = time.monotonic() - now
        self._next_s = now + max(DRAW_EVERY_S, cost_s / COST_SHARE)
        period_ms = self._plan.wall_period_ms if self._plan is not None else None
        if period_ms is not None and cost_s * 1000 > period_ms / 4:
            self._next_s = now + SELDOM_S

    def _tell(self, tick: int, motion: Motion) -> None:
        assert self._reader is not None
        if self._painter is None:
            return
        if self._waiting and self._painter.tell(Line("\n".join(self._waiting))):
            self._waiting.clear()
        if self._painter.tell(self._reader.state(tick, motion)):
            self._reader.told()

    def _start_painter(self) -> None:
        assert self._plan is not None
        if not self._can_start:
            return
        try:
            self._painter = Painter(self._cpus, wait=self._paced)
        except OSError as error:
            self._can_start = False
            self._say(f"no live view: cannot start the process that draws ({error.strerror})")
            return
        self._painter.tell(self._plan)

    def _event_line(self, tick: int, code: int, a: int, b: int, origin: int) -> None:
        if self._verbosity >= VERBOSE:
            super()._event_line(tick, code, a, b, origin)

    def _say(self, line: str) -> None:
        if self._painter is None:
            super()._say(line)
        elif len(self._waiting) < MOST_LINES:
            self._waiting.append(line)
        else:
            self._dropped += 1

    def _over(self) -> None:
        if self._painter is not None:
            if self._last is not None:
                self._tell(*self._last)
            self._painter.close()
            self._dropped += len(self._waiting)
            if self._painter.too_long:
                super()._say(f"{self._painter.too_long} changes of the view were too long to be shown")
            self._painter = None
        super()._over()


def queue() -> tuple[socket.socket, socket.socket]:
    """(the laboratory's end, the painter's end); takes the longest State there is, where the machine permits it."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, messages.BIGGEST // 2)  # the kernel doubles it
    return ours, theirs


class Painter:
    """The other end of sil.screen.painter. `tell` never waits; the kernel's buffer is the bounded queue between.

    cpus: where it may run. too_long: messages that no queue would have taken.
    """

    def __init__(self, cpus: set[int], wait: bool) -> None:
        self.too_long = 0
        self._orders, theirs = queue()
        command = [sys.executable, "-P", "-m", "sil.screen.painter", *map(str, sorted(cpus))]
        with theirs:
            self._child = subprocess.Popen(
                command, stdin=theirs.fileno(), stdout=subprocess.DEVNULL, env=child_environment(), close_fds=True
            )
        atexit.register(self.close)  # whatever ends this process, the prompt comes after the last frame
        if wait:  # its start takes a tenth of a second of some CPU, which a paced run may need
            select.select([self._orders], [], [], PATIENCE_S)

    def tell(self, message: Message) -> bool:
        """False where it has to be told again: the terminal takes nothing, or nobody draws any more."""
        try:
            self._orders.send(messages.pack(message), socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
        except OSError as error:
            if error.errno != errno.EMSGSIZE:
                return False
            self.too_long += 1  # and would be longer the next time
        return True

    def close(self) -> None:
        """Let it draw once more and end. One that hangs on a stopped terminal is ended: the log has to be sealed."""
        atexit.unregister(self.close)
        self.tell(End())
        with suppress(OSError):
            self._orders.shutdown(socket.SHUT_WR)  # says the same where the queue is full
        self._await_end()
        self._orders.close()  # not before: what it has not read yet would be lost

    def kill(self) -> None:
        """End it where it stands, without a wait for a last look, and put the terminal in order in its place."""
        atexit.unregister(self.close)
        self._child.kill()
        self._child.wait()
        self._orders.close()
        if _takes_more():
            print(f"{END_FRAME}{SHOW_CURSOR}", file=sys.stderr, flush=True)

    def _await_end(self) -> None:
        give_up = time.monotonic() + PATIENCE_S
        stopped_s = 0.0
        while time.monotonic() < give_up and stopped_s < STOPPED_S:
            try:
                self._child.wait(LOOK_S)
                return
            except subprocess.TimeoutExpired:
                stopped_s = 0.0 if _takes_more() else stopped_s + LOOK_S
        self._child.kill()
        self._child.wait()
        atexit.register(_show_cursor)


def _takes_more() -> bool:
    """Standard error would not block now."""
    try:
        poller = select.poll()
        poller.register(sys.stderr.fileno(), select.POLLOUT)
        return bool(poller.poll(0))
    except (OSError, ValueError):
        return True


def _show_cursor() -> None:
    if _takes_more():
        print(SHOW_CURSOR, end="", file=sys.stderr, flush=True)
