"""A sweep's directory: plan.json before anything runs, results.jsonl while it runs, the finished tables at its end.

| file | what |
|---|---|
| plan.json | base scenario, axes, every point; written and synced first |
| results.jsonl | a line for each finished point, in the order they finished; its first line names the plan |
| results.csv, results.json | every finished point in the plan's order, no wall times: the same bytes on any workers |
| summary.json | median, p95, max of every metric, verdicts counted; over all, and for each cell of the grid |
| workers.log | what the workers printed |
| runs/0001 | run directories that were kept |
"""

from __future__ import annotations

import csv
import fcntl
import hashlib
import io
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from sil.campaign.figures import summarise
from sil.campaign.plan import Plan, read_plan
from sil.campaign.records import HOST, Record
from sil.scenario_metrics import METRICS
from sil.trouble import EXIT_LINK, SilError, UsageError

PLAN, LINES, RUNS, LOG = "plan.json", "results.jsonl", "runs", "workers.log"
CSV, JSON, SUMMARY = "results.csv", "results.json", "summary.json"


class NotRecorded(SilError):
    """A full disk or the like: what was flown could not be written. What was written before stays."""

    exit_code = EXIT_LINK


class Results:
    """The open directory of a sweep; nobody else writes into it meanwhile. `records` has what is finished by point."""

    def __init__(self, directory: Path, plan: Plan, file: IO[bytes]) -> None:
        self.directory, self.plan = directory, plan
        self.records: dict[int, Record] = {}
        self.torn = 0
        self._file = file

    def add(self, record: Record) -> None:
        """One more point is finished: its line reaches the kernel before this returns."""
        with _recording(self.directory / LINES):
            _append(self._file, record.line().encode())
        self.records[record.point] = record

    def forget_failed(self) -> int:
        """Points that failed for link, board or worker count as not run; returns how many."""
        failed = [number for number, record in self.records.items() if record.exit_code == EXIT_LINK]
        for number in failed:
            del self.records[number]
        return len(failed)

    def finish(self) -> dict[str, Any]:
        """Write the tables of what is finished; returns the summary, which is in summary.json too."""
        with _recording(self.directory / LINES):
            os.fsync(self._file.fileno())
        ordered = [self.records[number] for number in sorted(self.records)]
        summary = summarise(self.plan, ordered)
        _replace(self.directory / CSV, _csv(self.plan, ordered))
        _replace(self.directory / JSON, _json(self.plan, ordered))
        _replace(self.directory / SUMMARY, json.dumps(summary, indent=2, allow_nan=False) + "\n")
        return summary

    def close(self) -> None:
        """Let others in."""
        self._file.close()


def create(directory: Path, plan: Plan) -> Results:
    """Write the plan, synced to the disk, and begin results.jsonl."""
    text = plan.text()
    _synced(directory / PLAN, text)
    file = _locked(directory / LINES)
    with _recording(directory / LINES):
        _append(file, _header(text))
        os.fsync(file.fileno())
    _sync_directory(directory)
    return Results(directory, plan, file)


def reopen(directory: Path) -> Results:
    """A sweep that was begun, with what is finished of it; raises UsageError.

    A line that was cut off, as by a power failure, is dropped, and its point counts as not run.
    """
    try:
        text = (directory / PLAN).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UsageError(f"--resume: expected the directory of a sweep, got {directory}: {PLAN}: {reason}") from None
    plan = read_plan(text, str(directory / PLAN))
    file = _locked(directory / LINES)
    results = Results(directory, plan, file)
    try:
        good = _read_lines(results, file, _header(text))
        if good is not None:
            results._file = _replaced(file, directory / LINES, good)
    except BaseException:
        file.close()
        raise
    return results


def _read_lines(results: Results, file: IO[bytes], header: bytes) -> bytes | None:
    """Fill in the records; returns what the file should be where it is not, without its damaged lines."""
    file.seek(0)
    lines = file.read().splitlines(keepends=True)
    if lines and lines[0].endswith(b"\n") and lines[0] != header:
        raise UsageError(
            f"{results.directory / LINES}: expected results of {PLAN} beside it, got those of another plan"
        )
    good = [header]
    for line in lines[1:]:
        record = _record(line)
        if record is None or not 1 <= record.point <= len(results.plan.points):
            results.torn += 1
        else:
            results.records[record.point] = record
            good.append(line)
    return b"".join(good) if good != lines else None


def _replaced(file: IO[bytes], path: Path, content: bytes) -> IO[bytes]:
    """Another file in the place of `file`, synced and locked before it gets there: all of the old one, or of it."""
    fresh = path.with_suffix(path.suffix + ".new")
    fresh.unlink(missing_ok=True)
    other = _locked(fresh)
    try:
        with _recording(fresh):
            _append(other, content)
            os.fsync(other.fileno())
        fresh.replace(path)
    except BaseException:
        other.close()
        fresh.unlink(missing_ok=True)
        raise
    _sync_directory(path.parent)
    file.close()
    return other


def _append(file: IO[bytes], content: bytes) -> None:
    """To the kernel; nothing is left in a buffer, so that a close() after an error has nothing to write."""
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]


@contextmanager
def _recording(file: Path) -> Iterator[None]:
    """An error of the disk, with the file's name."""
    try:
        yield
    except OSError as error:
        raise NotRecorded(f"{file}: results could not be recorded: {error.strerror or error}") from None


def _record(line: bytes) -> Record | None:
    """None for a line that is not whole."""
    try:
        return Record.read(line) if line.endswith(b"\n") else None
    except ValueError:
        return None


def _header(plan_text: str) -> bytes:
    return json.dumps({"plan_sha256": hashlib.sha256(plan_text.encode()).hexdigest()}).encode() + b"\n"


def _locked(path: Path) -> IO[bytes]:
    file = open(path, "a+b", buffering=0)  # noqa: SIM115
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(file.fileno()), path.stat()):  # not one that was replaced while we opened it
            return file
    except OSError:
        pass
    file.close()
    raise UsageError(f"{path.parent}: expected a sweep that nobody runs, got one that runs at this moment")


# -- tables -----------------------------------------------------------------------------------------------------------


def metric_columns(records: Sequence[Record]) -> list[str]:
    """All metrics in a fixed order, known ones first."""
    names = {name: parts for name, parts in METRICS.items() if name not in HOST}
    known = [f"{name}.{part}" if part else name for name, parts in names.items() for part in parts or ("",)]
    others = {name for record in records for name in record.metrics} - set(known)
    return [*known, *sorted(others)]


def _csv(plan: Plan, records: Sequence[Record]) -> str:
    metrics = metric_columns(records)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["point", *plan.keys, "verdict", "exit_code", "reason", *metrics, "sha256"])
    for record in records:
        values = plan.points[record.point - 1].values
        table.writerow(
            [
                record.point,
                *(_cell(values[key]) for key in plan.keys),
                record.verdict,
                record.exit_code,
                record.reason,
                *(_cell(record.metrics.get(name)) for name in metrics),
                record.sha256,
            ]
        )
    return out.getvalue()


def _cell(value: Any) -> str:
    """Texts bare, nothing for nothing, inf for never, else as JSON writes it: numbers with all their digits."""
    if value is None:
        return ""
    if value == math.inf:
        return "inf"
    return value if isinstance(value, str) else json.dumps(value)


def _json(plan: Plan, records: Sequence[Record]) -> str:
    rows = ",\n".join(f"    {json.dumps(_row(plan, record), allow_nan=False)}" for record in records)
    head = json.dumps({"name": plan.name, "axes": plan.keys, "sample": plan.sample}, indent=2).removesuffix("\n}")
    return f'{head},\n  "points": [\n{rows}\n  ]\n}}\n'


def _row(plan: Plan, record: Record) -> Mapping[str, Any]:
    """JSON has no infinity: null, and the name of the metric in `never`."""
    never = [name for name, value in record.metrics.items() if value == math.inf]
    return {
        "point": record.point,
        "values": plan.points[record.point - 1].values,
        "verdict": record.verdict,
        "exit_code": record.exit_code,
        "reason": record.reason,
        "metrics": {name: None if name in never else value for name, value in record.metrics.items()},
        "never": never,
        "sha256": record.sha256,
    }


# -- files ------------------------------------------------------------------------------------------------------------


def _replace(file: Path, text: str) -> None:
    """The whole new content or the whole old one, never half of it."""
    fresh = file.with_suffix(file.suffix + ".new")
    _synced(fresh, text)
    with _recording(file):
        fresh.replace(file)


def _synced(file: Path, text: str) -> None:
    with _recording(file), open(file, "w", encoding="utf-8", newline="") as out:
        out.write(text)
        out.flush()
        os.fsync(out.fileno())


def _sync_directory(directory: Path) -> None:
    number = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
