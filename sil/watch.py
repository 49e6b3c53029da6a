"""What a run shows of itself while it goes on: the calls it makes, and a guard against a view that fails."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from sil.signals import Motion

if TYPE_CHECKING:
    from sil.rig import Rig
    from sil.scenario import Scenario


class Watch:
    """What a run shows of itself while it goes on; this one shows nothing. The CLI hands in one that draws."""

    def note(self, line: str) -> None:
        """Something worth a line: a board that compiles, a pty that waits for its board."""

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        """Everything is assembled and the board READY; the rig may be read from now on, never written."""

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        """A tick is over."""

    def event(self, tick: int, code: int, a: int, b: int, origin: int = 0) -> None:
        """Something happened, in the numbers of protocol.events; origin 0: the laboratory says so, 1: the board."""

    def close(self) -> None:
        """Leave the terminal as it was found; called on a watch that failed."""

    def stage(self, name: str) -> None:
        """`start`, `run`, `seal`."""


class Guarded(Watch):
    """Another watch, whose failure costs the view and never the run: said once, and the watch is not called again."""

    def __init__(self, watch: Watch) -> None:
        self._watch: Watch | None = watch

    def note(self, line: str) -> None:
        self._call("note", line)

    def stage(self, name: str) -> None:
        self._call("stage", name)

    def plugged(self, scenario: Scenario, rig: Rig) -> None:
        self._call("plugged", scenario, rig)

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        self._call("tick", tick, ticks, motion)

    def event(self, tick: int, code: int, a: int, b: int, origin: int = 0) -> None:
        self._call("event", tick, code, a, b, origin)

    def _call(self, name: str, *arguments: object) -> None:
        if self._watch is None:
            return
        try:
            getattr(self._watch, name)(*arguments)
        except Exception as error:
            with contextlib.suppress(Exception):
                self._watch.close()
            self._watch = None
            with contextlib.suppress(OSError, ValueError):  # standard error may be what failed
                print(f"view: {type(error).__name__}: {error}; the run goes on without it", file=sys.stderr, flush=True)
