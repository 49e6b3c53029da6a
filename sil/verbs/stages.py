"""What a command is doing, on stderr, once it takes longer than two seconds: a line that goes again on a terminal."""

from __future__ import annotations

import sys
import threading
from types import TracebackType

QUIET_S = 2.0


class Stages:
    """`begin` says what comes now. What is over soon says nothing; what takes long says every stage."""

    def __init__(self, verb: str) -> None:
        self._verb, self._stage = verb, ""
        self._lock, self._open, self._over = threading.Lock(), False, False
        self._timer = threading.Timer(QUIET_S, self._opens)
        self._timer.daemon = True

    def __enter__(self) -> Stages:
        self._timer.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._timer.cancel()
        with self._lock:
            if self._open and sys.stderr.isatty():
                sys.stderr.write("\r\033[K")
                sys.stderr.flush()
            self._open, self._over = False, True

    def begin(self, stage: str) -> None:
        """The next stage."""
        with self._lock:
            self._stage = stage
            self._say()

    def _opens(self) -> None:
        with self._lock:
            self._open = not self._over
            self._say()

    def _say(self) -> None:
        if not self._open or not self._stage:
            return
        line = f"{self._verb}: {self._stage}"
        sys.stderr.write(f"\r\033[K{line}" if sys.stderr.isatty() else f"{line}\n")
        sys.stderr.flush()
