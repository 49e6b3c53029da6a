"""How many ticks a viewer is shown: at most so many a second, spread evenly over those that there are."""

from __future__ import annotations

TICKS_PER_S = 50.0  # a screen shows no more, and viewers warn of topics beyond 60 Hz
SAVED_UP = 50.0  # after a pause, at once


class Allowance:
    """Ticks that may be shown: TICKS_PER_S of wall time, of which at most SAVED_UP are kept for later."""

    def __init__(self, now_s: float) -> None:
        self._saved = SAVED_UP
        self._at_s = now_s

    def of(self, ticks: int, now_s: float) -> list[bool]:
        """Which of so many ticks are shown: all, or as many as are allowed, evenly spread, the newest among them."""
        self._saved = min(SAVED_UP, self._saved + (now_s - self._at_s) * TICKS_PER_S)
        self._at_s = now_s
        shown = min(ticks, int(self._saved))
        self._saved -= shown
        return spread(shown, ticks)


def spread(shown: int, of: int) -> list[bool]:
    """`shown` times True among `of`, at even distances, the last one True."""
    return [(k + 1) * shown // of > k * shown // of for k in range(of)]
