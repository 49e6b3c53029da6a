"""A run as CSV: one row per tick, units in the header, every float with all its digits. Names: sil.runs.COLUMNS."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from sil.report.whole_file import beside
from sil.run_columns import COLUMNS
from sil.runs import Run
from sil.trouble import UsageError

_ROWS_AT_ONCE = 4096
STDOUT = "-"


class ExportError(UsageError):
    """The CSV cannot be written: one line."""


def export(run: Run, out: Path | str) -> int:
    """Write the CSV to `out` (`-`: standard output); returns the number of rows. Raises ExportError.

    Truth at the tick, not the reading; command = computed at this tick (nan where none came), applied = acting from
    this tick on; w = omega_BN in body axes; h absolute. Numbers read back to the same float64.
    """
    if str(out) == STDOUT:
        return _write(run, sys.stdout)
    try:
        with beside(Path(out)) as new, open(new, "w", encoding="ascii", newline="") as file:
            return _write(run, file)
    except OSError as error:
        raise ExportError(f"{out}: cannot write the CSV: {error.strerror or error}") from error


def header() -> str:
    """The first line."""
    return ",".join(COLUMNS)


def rows(run: Run) -> Iterator[str]:
    """The lines after it, without line ends."""
    columns = [run[name] for name in COLUMNS]
    for start in range(0, len(run), _ROWS_AT_ONCE):
        part = [column[start : start + _ROWS_AT_ONCE].tolist() for column in columns]
        for row in zip(*part, strict=True):
            yield ",".join(map(repr, row))


def _write(run: Run, file: IO[str]) -> int:
    file.write(header() + "\n")
    for row in rows(run):
        file.write(row + "\n")
    return len(run)
