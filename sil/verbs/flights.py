"""Progress of runs that are made one after the other: a bar on a terminal, a line for each run elsewhere; on stderr."""

from __future__ import annotations

import sys
import time
from typing import Any

from sil.signals import Motion
from sil.watch import Watch

_DRAW_EVERY_S = 0.1


class Flights(Watch):
    """Watches `count` runs; `begin` before each, `close` after the last."""

    def __init__(self, count: int) -> None:
        self._count, self._begun = count, 0
        self._bar: Any = None
        self._task: Any = None
        self._drawn_s = 0.0

    def begin(self, name: str) -> None:
        """The next run."""
        self._begun += 1
        title = f"{name} ({self._begun} of {self._count})"
        if not sys.stderr.isatty():
            print(f"running {title}", file=sys.stderr, flush=True)
            return
        if self._bar is None:
            self._bar = _bar()
            self._bar.start()
        else:
            self._bar.remove_task(self._task)
        self._task = self._bar.add_task(title, total=None)
        self._bar.refresh()

    def note(self, line: str) -> None:
        if self._bar is not None:
            self._bar.console.print(line, highlight=False, markup=False)
        else:
            print(line, file=sys.stderr, flush=True)

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        if self._bar is None or (now := time.monotonic()) - self._drawn_s < _DRAW_EVERY_S:
            return
        self._drawn_s = now
        self._bar.update(self._task, total=ticks, completed=tick + 1, refresh=True)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()


def _bar() -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
