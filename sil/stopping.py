"""Ctrl-C and SIGTERM as a wish: the loop looks at it each tick, so that log and summary are complete."""

from __future__ import annotations

import signal
from typing import Any


class StopRequests:
    """SIGINT and SIGTERM. Until `hold()` they interrupt at once: nothing was run yet, nothing can be lost. After it the
    first one is a wish that the loop looks at each tick, so that log and summary are complete; a second one interrupts
    a loop that does not come round.

    Outside the main thread Python installs no handlers; then nobody asks.
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
        try:
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._ask)
        except ValueError:
            self._before.clear()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _ask(self, number: int, _: object) -> None:
        self._asked += 1
        if not self._held or self._asked > 1:
            raise KeyboardInterrupt
