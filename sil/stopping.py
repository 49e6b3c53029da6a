"""Ctrl-C, SIGTERM, a closed terminal: as a wish that a loop looks at each tick, or all alike as KeyboardInterrupt."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopRequests:
    """SIGINT, SIGTERM, SIGHUP. Until `hold()` they interrupt at once: nothing was run yet, nothing can be lost. After
    it the first one is a wish that the loop looks at each tick, so that log and summary are complete; a second one
    interrupts a loop that does not come round.
    """

    def __init__(self) -> None:
        self._held = False
        self._asked = 0
        self._before: dict[int, Any] = {}

    def asked(self) -> bool:
        """Somebody wants the run to end."""
        return self._asked > 0

    def hold(self) -> None:
        """From here on there is something to lose."""
        self._held = True

    def __enter__(self) -> StopRequests:
        self._before = _installed(self._ask)
        return self

    def __exit__(self, *_: object) -> None:
        _restored(self._before)

    def _ask(self, number: int, _: object) -> None:
        self._asked += 1
        if not self._held or self._asked > 1:
            raise KeyboardInterrupt


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """SIGTERM and SIGHUP end what is going on as Ctrl-C does: by KeyboardInterrupt."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = _installed(interrupt)
    try:
        yield
    finally:
        _restored(before)


def _installed(handler: Callable[[int, Any], None]) -> dict[int, Any]:
    """What stood there before. One that is ignored (nohup) stays so; outside the main thread Python installs none."""
    before: dict[int, Any] = {}
    try:
        for number in ASKING:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    except ValueError:
        before.clear()
    return before


def _restored(before: dict[int, Any]) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)
