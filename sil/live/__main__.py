"""The process of the live view: `python -m sil.live --host HOST --port PORT [RUN]`.

It says `listening PORT` on its standard output, then `viewer` when the first one has subscribed. Its standard input is
the laboratory's: one line names the run directory, and its end, however that comes about, means that nothing more will
be written: what is in the journal is shown, the connections are closed, and the last line on standard output says in
JSON what was shown. It never writes to the run directory.

With RUN nobody tells it anything: it shows that run as it goes on or, if it is over, as fast as it was simulated, and
ends with it.

Exit codes: 0 ended as asked, 2 it cannot listen, there is no such run, or the library is not installed; then the last
line on stderr says why. 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from sil.live.following import MOST_AT_ONCE, Following, Step
from sil.live.pace import Allowance
from sil.live.played import finished, played
from sil.sinks.journal import JournalError, read_journal
from sil.sinks.mcap_rows import RunRows, TimingRows
from sil.trouble import EXIT_INTERRUPTED, EXIT_OK, EXIT_USAGE

if TYPE_CHECKING:
    from sil.live.server import Server

LOOK_EVERY_S = 0.02
TIME_FIRST_S = 0.002  # the time has to be with the viewer before the messages of its tick, by a queue of its own
DRAINS_S = 0.3  # what is in the queues at the end gets this long to leave
NICE = 10
NEEDS = "live view: needs foxglove-sdk: pip install 'attitude-sil[live]'"


def main() -> int:
    """Serve one run."""
    options = _options()
    _stay_out_of_the_way(options.cpus)
    try:
        from sil.live.server import Server
    except ImportError as error:
        return _refuse(f"{NEEDS} ({error})")
    try:
        server = Server(options.host, options.port, options.name)
    except RuntimeError as error:
        return _refuse(f"{options.host}:{options.port}: cannot listen there ({error}); {options.elsewhere}")
    show = Show(server, Following(RunRows(server), TimingRows(server)))  # type: ignore[arg-type]
    try:
        code = _shown(show, Path(options.run), options) if options.run else _told(show)
    except KeyboardInterrupt:
        code = EXIT_INTERRUPTED
    server.stop()
    return code


def _told(show: Show) -> int:
    """By the laboratory."""
    print(f"listening {show.server.port}", flush=True)
    folder = sys.stdin.readline().rstrip("\n")
    if folder:
        with suppress(JournalError):  # the run was over before it began
            show.following.follow(read_journal(Path(folder) / "run.journal").follow())
            show.all(_pause_or_told)
        print(json.dumps(show.summary()), flush=True)
    return EXIT_OK


def _shown(show: Show, folder: Path, options: argparse.Namespace) -> int:
    """By a person who names the run."""
    journal = folder / "run.journal" if folder.is_dir() else folder
    try:
        over = finished(read_journal(journal))
        records = read_journal(journal).follow()
    except JournalError as error:
        return _refuse(str(error))
    print(f"ws://{options.host}:{show.server.port}", flush=True)
    while over and not show.server.viewers:
        time.sleep(LOOK_EVERY_S)
    show.following.follow(played(records, options.speed) if over else records)
    show.all(_pause)
    return EXIT_OK


class Show:
    """One run, from its first record to its last."""

    def __init__(self, server: Server, following: Following) -> None:
        self.server, self.following = server, following
        self._allowance = Allowance(time.monotonic())
        self._ticks = self._shown = 0
        self._newest: Step | None = None  # which was passed over

    def all(self, pause: Callable[[float], bool]) -> None:
        """Until END, or until `pause` says that nothing more will be written and nothing is left to show."""
        over = False
        while True:
            found = self._round()
            if over and not found:
                break
            if found < MOST_AT_ONCE:
                over = pause(LOOK_EVERY_S) or self.following.over
        if self.server.viewers:
            time.sleep(DRAINS_S)

    def summary(self) -> dict[str, int | bool]:
        """What was shown."""
        return {
            "ticks": self._ticks,
            "shown": self._shown,
            "messages": self.server.messages,
            "viewers": self.server.viewers,
            "behind": self.server.behind,
        }

    def _round(self) -> int:
        """Show what is new, or what was passed over last where nothing is; how many steps were new."""
        steps = self.following.new()
        if not steps and self._newest is not None:
            self._whole(self._newest)
        ticks = sum(step.is_tick for step in steps)
        allowed = iter(self._allowance.of(ticks, time.monotonic()))
        for step in steps:
            if not step.is_tick or next(allowed):
                self._whole(step)
            else:
                self._newest = step.rest()
                self.following.show(step.once())
        self._ticks += ticks
        self.server.welcome()
        return len(steps)

    def _whole(self, step: Step) -> None:
        if step.is_tick:
            self._newest = None
            self._shown += 1
            self.server.time(self.following.time_of(step))
            time.sleep(TIME_FIRST_S)
        self.following.show(step)


def _pause(seconds: float) -> bool:
    time.sleep(seconds)
    return False


def _pause_or_told(seconds: float) -> bool:
    """Wait; True where standard input has ended."""
    with suppress(OSError):
        return bool(select.select([sys.stdin], [], [], seconds)[0])
    return True


def _refuse(line: str) -> int:
    print(line, file=sys.stderr)
    return EXIT_USAGE


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m sil.live")
    parser.add_argument("run", nargs="?", default="")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8765)
    parser.add_argument("--elsewhere", default="--port 0 takes any free one")
    parser.add_argument("--name", default="attitude-sil")
    parser.add_argument("--cpus", default="")
    parser.add_argument("--speed", type=float, default=1.0)
    return parser.parse_args()


def _stay_out_of_the_way(cpus: str) -> None:
    """Before the library starts its threads: they inherit it. A wake-up of SCHED_BATCH preempts nobody. Where the
    kernel weighs sessions first (autogroup), this session, which is ours alone, has to be nice as well.
    """
    with suppress(OSError):
        os.nice(NICE)
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        if cpus:
            os.sched_setaffinity(0, {int(cpu) for cpu in cpus.split(",")})
    with suppress(OSError):
        if os.getsid(0) == os.getpid():
            Path("/proc/self/autogroup").write_text(str(NICE), encoding="ascii")


if __name__ == "__main__":
    exit_code = main()
    sys.stdout.flush()
    os._exit(exit_code)  # the library would wait once more for a viewer that is stuck
