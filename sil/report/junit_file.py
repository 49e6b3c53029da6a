"""--junit FILE: from the first moment on it says something true, whatever becomes of the run.

At the start it says that the run has not ended, so that neither an older green file nor nothing is left when the
process is killed; at the end what was found, or why there is nothing to find.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from sil.trouble import UsageError

if TYPE_CHECKING:
    from sil.scenario import Scenario

RUN_FILES = ("run.mcap", "timing.mcap", "run.journal", "board.log", "summary.json")


class JunitFile:
    """A context around one run; `scenario` is to be set as soon as it is known. file: None for no file at all.

    out: the run directory if it was named: it has to be empty for the run, so no file is put into it before.
    source: the scenario, run directory or log that is read. Raises UsageError where `file` would write over it, or over
    what the run itself leaves in `out`.
    """

    def __init__(
        self, file: Path | None, name: str, out: Path | None = None, about: str = "", source: Path | None = None
    ) -> None:
        if file is not None:
            _spare(file, source, out)
        self.scenario: Scenario | None = None
        self._file = file
        self._name = Path(name).stem
        self._out = out
        self._about = about
        self._over = False

    def __enter__(self) -> Self:
        if self._file is not None and not self._is_inside(self._out):
            from sil.report.junit import NOT_ENDED

            self._write_nothing_found(NOT_ENDED, "not ended")
        return self

    def leave_empty(self, out: Path | None) -> None:
        """The run is going to be in `out`, which only the scenario knew: a file of ours must not be in its way."""
        if self._file is not None and self._is_inside(out):
            self._file.unlink(missing_ok=True)

    def _is_inside(self, out: Path | None) -> bool:
        return out is not None and self._file is not None and self._file.resolve().is_relative_to(out.resolve())

    def finished(self, summary: Mapping[str, Any]) -> None:
        """The run has come to its end; summary: as run_scenario returns it. Raises UsageError."""
        if self._file is not None and self.scenario is not None:
            from sil.report.junit import of_run

            self.write(of_run(self.scenario, summary))

    def write(self, text: str) -> None:
        """The last word. Raises UsageError."""
        if self._file is not None:
            from sil.report.junit import write

            self._over = True
            write(self._file, text)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None or self._over or self._file is None:
            return
        what = "interrupted" if isinstance(error, KeyboardInterrupt) else type(error).__name__
        try:
            self._write_nothing_found(str(error) or what, what)
        except UsageError as second:
            print(second, file=sys.stderr)  # the first error is on its way out

    def _write_nothing_found(self, message: str, kind: str) -> None:
        from sil.report.junit import THE_RUN, of_no_run, write

        if self._file is not None:
            write(self._file, of_no_run(self._name, self.scenario, message, kind, self._about or THE_RUN))


def _spare(file: Path, source: Path | None, out: Path | None) -> None:
    """Refuse a file that is read, lies in the run that is read, or is one of those a run consists of."""
    target = file.resolve()
    if source is not None and source.exists():
        read = source.resolve()
        beside = read.suffix == ".mcap" and _is_of_run(target, read.parent)
        if target == read or beside or (read.is_dir() and target.is_relative_to(read)):
            raise UsageError(f"--junit: expected a file apart from what is read, got {file}, and {source} is read")
    if out is not None and _is_of_run(target, out.resolve()):
        raise UsageError(f"--junit: expected a file of its own, got {file}, which the run writes itself")


def _is_of_run(target: Path, folder: Path) -> bool:
    return target.parent == folder and target.name in RUN_FILES
