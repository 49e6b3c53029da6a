"""How far a sweep is and how long it will take: a bar on a terminal, a line every ten seconds elsewhere; on stderr."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Mapping
from typing import Any

from sil.campaign.records import Record
from sil.campaign.sweep import SweepWatch

PLAIN_EVERY_S = 10.0
FIRST_PLAIN_S = 2.0  # a sweep that is over sooner needs no line


class Terminal(SweepWatch):
    """Draws only when asked to wait or told of a point; costs nothing in between.

    names: what a run that ended with this exit code is called, if not by its verdict.
    """

    def __init__(self, names: Mapping[int, str] | None = None) -> None:
        self._names = names or {}
        self._live = sys.stderr.isatty()
        self._bar: Any = None
        self._bad: Counter[str] = Counter()
        self._flown = 0
        self._said = time.monotonic() + FIRST_PLAIN_S - PLAIN_EVERY_S

    def planning(self, points: int, of: int) -> None:
        if time.monotonic() - self._said >= PLAIN_EVERY_S:
            self._said = time.monotonic()
            print(f"planning: {points}/{of}", file=sys.stderr, flush=True)

    def begin(self, name: str, points: int, workers: int) -> None:
        self._name, self._points, self._workers = name, points, workers
        self._began = time.monotonic()
        self._said = self._began + FIRST_PLAIN_S - PLAIN_EVERY_S
        if self._live and points:
            self._start_bar()

    def record(self, record: Record) -> None:
        self._flown += 1
        if record.exit_code:
            self._bad[self._names.get(record.exit_code, record.verdict)] += 1

    def note(self, line: str) -> None:
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False, soft_wrap=True)
        else:
            super().note(line)

    def wait(self) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=self._flown, refresh=True, bad=self._bad_text(), left=self._left())
        elif not self._live and time.monotonic() - self._said >= PLAIN_EVERY_S:
            self._said = time.monotonic()
            bad = f"  {self._bad_text()}" if self._bad else ""
            line = f"{self._name}: {self._flown}/{self._points} points{bad}  {self._left()}"
            print(line, file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _bad_text(self) -> str:
        return ", ".join(f"{count} {verdict}" for verdict, count in sorted(self._bad.items()))

    def _left(self) -> str:
        """From the mean time of a point so far; the first round of the workers includes their start."""
        if not self._flown:
            return "first points under way"  # an installation's first run compiles
        seconds = round((time.monotonic() - self._began) / self._flown * (self._points - self._flown))
        minutes, seconds = divmod(seconds, 60)
        hours, minutes = divmod(minutes, 60)
        return f"{hours}:{minutes:02d}:{seconds:02d} left" if hours else f"{minutes}:{seconds:02d} left"

    def _start_bar(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]}", style="cyan"),
            TextColumn("{task.fields[bad]}", style="red"),
        )
        from rich.markup import escape

        console = Console(stderr=True)
        self._bar = Progress(*columns, console=console, transient=True, auto_refresh=False)
        self._task = self._bar.add_task(escape(self._name), total=self._points, bad="", left=self._left())
        self._bar.start()
