"""The command's own standard streams: a reader that leaves early, or a stream that was closed, never ends a command.

`sil info RUN | head -1` reads one line and goes: what nobody reads any more is dropped, and the command goes on to its
own exit code (a run that failed says so, read or unread). `2>&-` starts a command without standard error.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO

STDOUT, STDERR = 1, 2


def settle() -> None:
    """Put forgiving streams in place of sys.stdout and sys.stderr; the closed ones of 0, 1, 2 become the null device.

    A free number among these three would go to the next file that is opened, such as a journal, and get our messages.
    """
    for number in (0, STDOUT, STDERR):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest free number: this one
    sys.stdout = _text(_Output(STDOUT, (BrokenPipeError,)), sys.stdout)
    sys.stderr = _text(_Output(STDERR, (OSError,)), sys.stderr, line_buffering=True)


class _Output(io.FileIO):
    """A standard stream that turns into the null device at its first error, which is raised if it is not `forgiven`."""

    def __init__(self, number: int, forgiven: tuple[type[OSError], ...]) -> None:
        super().__init__(number, "w", closefd=False)
        self._forgiven = forgiven

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self.fileno())
            os.close(null)
            if not isinstance(error, self._forgiven):
                raise
            return len(data)


def _text(raw: io.FileIO, before: TextIO | None, line_buffering: bool = False) -> TextIO:
    """A text stream over `raw`, of the encoding that the stream `before` it had."""
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=before.encoding if before is not None else "utf-8",
        errors=before.errors if before is not None else "replace",
        line_buffering=line_buffering or raw.isatty(),
    )
