"""The live view of a run, from the laboratory's side: a process (sil.live), started before the run and asked after it.

The loop does nothing for it: the process reads run.journal, which is written anyway. A view that fails costs the run
nothing but a line at the end. Its standard input is a pipe that only this process holds, so it ends by itself whatever
ends the laboratory.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from sil.launched import child_environment
from sil.scenario import Scenario
from sil.trouble import EXIT_USAGE, UsageError
from sil.watch import Watch

START_S = 30.0  # within this time it listens
END_S = 5.0  # within this time after the run it has shown the rest and closed
LAYOUT = Path(__file__).parent / "live" / "layout.json"


class LiveOrder(NamedTuple):
    """Where viewers connect, and how long the run waits for the first of them."""

    host: str
    port: int  # 0: any
    wait_s: float = 0.0


def command_of(host: str, port: int) -> list[str]:
    """The process that serves viewers there."""
    return [sys.executable, "-P", "-m", "sil.live", "--host", host, "--port", str(port)]


class NoView:
    """A run that nobody asked to see."""

    def look_at(self, folder: Path) -> None:
        """The run is written to this directory."""

    def finish(self, watch: Watch) -> dict[str, Any] | None:
        """What was shown; None where nothing was asked for."""
        return None


class LiveView(NoView):
    """The process while it lives. Raises UsageError, one line, where it cannot listen as it was asked to."""

    def __init__(self, order: LiveOrder, name: str, cpus: set[int]) -> None:
        command = [*command_of(order.host, order.port), "--elsewhere", "--live-at 127.0.0.1:0 takes any free port"]
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        self._said = ""
        self._child = subprocess.Popen(
            [*command, "--name", f"attitude-sil: {name}", "--cpus", ",".join(map(str, sorted(cpus)))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=child_environment(),
            start_new_session=True,  # Ctrl-C in the terminal is the laboratory's to handle
        )
        try:
            host = f"[{order.host}]" if ":" in order.host else order.host
            self.url = f"ws://{host}:{self._listening()}"
        except BaseException:
            self.close()
            raise

    def has_viewer(self, within_s: float) -> bool:
        """Somebody has subscribed to something, or does so within this time."""
        return self._says("viewer", within_s)

    def look_at(self, folder: Path) -> None:
        stdin = self._child.stdin
        assert stdin is not None
        with suppress(OSError):  # it has ended; finish() says so
            stdin.write(f"{folder.resolve()}\n".encode())
            stdin.flush()

    def finish(self, watch: Watch) -> dict[str, Any]:
        """Let it show the rest and end. Says in one line what was shown, or what became of the process."""
        try:
            said, _ = self._child.communicate(timeout=END_S)  # closes its standard input first
            failed = self._ending() if self._child.returncode else ""
        except subprocess.TimeoutExpired:
            said, failed = b"", f"did not end within {END_S:g} s"
        shown: dict[str, Any] = {"url": self.url, "failed": failed}
        lines = said.decode(errors="replace").splitlines()
        if not failed and lines:
            shown |= json.loads(lines[-1])
        watch.note(f"live: {_sentence(shown)}")
        return shown

    def close(self) -> None:
        """It is gone; called however the run ended."""
        if self._child.poll() is None:
            self._child.kill()
        for pipe in (self._child.stdin, self._child.stdout):
            if pipe:
                with suppress(OSError):
                    pipe.close()
        self._child.wait()
        self._errors.close()

    def _listening(self) -> int:
        """The port that it says it listens on."""
        if self._says("listening", START_S):
            return int(self._said.split()[1])
        with suppress(subprocess.TimeoutExpired):
            self._child.wait(END_S)
        if self._child.returncode == EXIT_USAGE and self._last_words():
            raise UsageError(self._last_words())
        raise UsageError(f"live view: {self._ending()}")

    def _says(self, word: str, within_s: float) -> bool:
        """It has said this word, or does so in time."""
        stdout = self._child.stdout
        assert stdout is not None
        give_up = time.monotonic() + within_s
        while word not in self._said and (left_s := give_up - time.monotonic()) > 0:
            if select.select([stdout], [], [], left_s)[0]:
                more = os.read(stdout.fileno(), 200).decode(errors="replace")
                if not more:
                    break
                self._said += more
        return word in self._said

    def _ending(self) -> str:
        code = self._child.returncode
        if code is None:
            return f"it did not listen within {START_S:g} s"
        words = self._last_words()
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"its process ended with {how}{f': {words}' if words else ''}"

    def _last_words(self) -> str:
        self._errors.seek(0)
        lines = [line for line in self._errors.read().decode(errors="replace").splitlines() if line.strip()]
        return lines[-1].strip() if lines else ""


@contextmanager
def live_view(order: LiveOrder | None, scenario: Scenario, watch: Watch) -> Iterator[NoView]:
    """The view that was ordered, listening, and gone at the end. Raises UsageError before anything was run."""
    if order is None:
        yield NoView()
        return
    view = LiveView(order, scenario.name, _cpus(scenario))
    try:
        watch.note(f"live: {view.url} for Foxglove or Lichtblick; layout: sil live --layout")
        if not scenario.clock_scale:
            watch.note("live: lockstep is over before one has looked; --clock scaled:20 shows every tick")
        if order.wait_s:
            _await(view, order.wait_s, watch)
        yield view
    finally:
        view.close()


def _await(view: LiveView, within_s: float, watch: Watch) -> None:
    watch.note(f"live: waiting up to {within_s:g} s for a viewer; Ctrl-C ends it")
    if not view.has_viewer(within_s):
        watch.note(f"live: no viewer within {within_s:g} s; the run starts")


def _cpus(scenario: Scenario) -> set[int]:
    """Not the laboratory's and not the board's, as far as others are left."""
    usable = os.sched_getaffinity(0)
    taken = {cpu for cpu in (scenario.clock.lab_cpu, scenario.clock.board_cpu) if cpu is not None}
    return usable - taken or usable - {scenario.clock.lab_cpu} or usable


def _sentence(shown: dict[str, Any]) -> str:
    if shown["failed"]:
        return f"the view failed, the run did not: {shown['failed']}"
    if "ticks" not in shown:
        return "nothing was shown"
    passed_over = shown["ticks"] - shown["shown"]
    viewers = f"{shown['viewers']} viewer{'s' if shown['viewers'] != 1 else ''}"
    parts = [f"{viewers}, {shown['shown']} of {shown['ticks']} ticks shown"]
    if passed_over:
        parts.append(f"{passed_over} passed over (at most 50 a second, events all)")
    if shown["behind"]:
        parts.append("a viewer was too slow and missed some of it, nobody knows how much")
    return "; ".join(parts)
