"""run.mcap and timing.mcap from run.journal. run.mcap is a pure function of the journal: same records, same bytes.

Only simulation time stands in run.mcap: log_time = publish_time = t_k = tick * period_ns. Order: tick by tick; within
a tick sessions, packets by (direction, type, sequence), each followed by its decoded form, then truth, /tf,
/joint_states, /scene and events. Never arrival order, so clock, link and process boundaries leave no trace.

What the bytes depend on besides the journal: the files of this folder and sil/pointing.py; the protobuf descriptors of
the installed foxglove-schemas-protobuf; the `lz4` library's compressor (its output for given input changes rarely
between releases, which is why it is preferred to zstd); and the record layout of the `mcap` writer, whose library
string is replaced by a fixed one. The versions used are written to timing.mcap.

Every topic with its fields: docs/reference/topics.md.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.writer import CompressionType, Writer

from protocol import events
from sil.sinks import journal as jn
from sil.sinks.events import OF_THE_HOST
from sil.sinks.journal import Direction, JournalError, JournalReader, Kind, Record
from sil.sinks.mcap_rows import RunRows, TimingRows

LIBRARY = "attitude-sil"
CHUNK_BYTES = 256 * 1024  # the grain of seeking in a viewer
REORDER_TICKS = 512  # a record may be journalled this many ticks late: twice what sil.answers remembers
TRUNCATED = "truncated"  # the `end` reason of a run whose journal has no END
LIBRARIES = ("mcap", "lz4", "foxglove-schemas-protobuf", "protobuf", "numpy")
_UNREADABLE = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, struct.error, RecursionError)
_TO_TIMING = frozenset((Kind.HOST, Kind.TIMING, Kind.HOUSEKEEPING))


class SealError(Exception):
    """The log cannot be made from the journal: one line."""


class SealReport(NamedTuple):
    """What seal made. `complete` is False where the journal ended without END; `left_out` says what was dropped."""

    run_mcap: Path
    timing_mcap: Path
    sha256: str  # of run.mcap
    ticks: int
    reason: str  # finished, interrupted, failed, diverged, truncated
    complete: bool
    damage: str  # "" or where and why reading the journal stopped
    left_out: str  # "" or which incomplete ticks are missing
    undecoded: int  # packets that `frames.unpack` refused; they are in /packet/* all the same
    too_late: int  # records journalled more than REORDER_TICKS late: left out, for the log never goes back in time
    messages: int
    wall_s: float
    fates: Mapping[tuple[int, int, str, bool], int]  # how many copies: direction, fate, cause, whether a further one
    answers_ns: Sequence[int]  # from SAMPLE to COMMAND, of every tick whose answer came in time to be measured


def seal(run_dir: str | os.PathLike[str]) -> SealReport:
    """Write run.mcap and timing.mcap beside run.journal; each appears complete under its name or not at all.

    Raises SealError or JournalError (no journal, not a journal, no META, records that make no sense, disk full).
    """
    started = time.perf_counter()
    folder = Path(run_dir)
    reader = jn.read_journal(folder / "run.journal")
    run_path, timing_path = folder / "run.mcap", folder / "timing.mcap"
    try:
        with _Target(run_path) as run_file, _Target(timing_path) as timing_file:
            sealing = _Sealing(reader, run_file, timing_file)
            sealing.all()
    except OSError as error:
        why = f"cannot write the log: {error.strerror or error}"
        raise SealError(f"{folder}: {why}; run.journal keeps it, `sil recover` makes it where there is room") from error
    except _UNREADABLE as error:  # every CRC is right
        raise SealError(f"{reader.path}: written by another version, or damaged: {repr(error)[:200]}") from error
    with open(run_path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    end = sealing.end
    return SealReport(
        run_path,
        timing_path,
        digest,
        end["ticks"],
        end["reason"],
        sealing.complete,
        reader.damage,
        sealing.left_out,
        sealing.run.undecoded,
        sealing.too_late,
        sealing.run.messages,
        time.perf_counter() - started,
        sealing.run.fates,
        sealing.timing.answers_ns,
    )


def recover(run_dir: str | os.PathLike[str]) -> SealReport:
    """The log of a run that was killed: `seal` on whatever the journal holds, up to its last complete tick."""
    return seal(run_dir)


class _Target:
    """A file that is renamed to its name when everything went well, and removed when not."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._partial = path.with_name(path.name + ".partial")

    def __enter__(self) -> IO[bytes]:
        self._file = open(self._partial, "wb")
        return self._file

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            try:
                if kind is None:
                    self._file.flush()
                    os.fsync(self._file.fileno())
            finally:
                self._file.close()  # on a full disk it raises, too: what is still buffered has no room either
            if kind is None:
                os.replace(self._partial, self._path)
        finally:
            self._partial.unlink(missing_ok=True)


class _Sealing:
    """One pass over the journal; memory: REORDER_TICKS ticks, one chunk, and 8 bytes for each answer."""

    def __init__(self, reader: JournalReader, run_file: IO[bytes], timing_file: IO[bytes]) -> None:
        self._reader = reader
        self._writers = (_writer(run_file), _writer(timing_file))
        self.run = RunRows(self._writers[0])
        self.timing = TimingRows(self._writers[1])
        self._period_ns = 0
        self._end: dict[str, Any] = {}
        self._last_truth = self._written = -1  # newest tick with a truth; newest tick in the files
        self.left_out = ""
        self.too_late = 0

    @property
    def complete(self) -> bool:
        """The journal ends with END."""
        return bool(self._end)

    @property
    def end(self) -> dict[str, Any]:
        """END as recorded, or one that says `truncated`."""
        return self._end or {"reason": TRUNCATED, "ticks": self._last_truth + 1}

    def all(self) -> None:
        """Everything: both files, finished."""
        waiting: dict[int, list[Record]] = {}
        newest = session_tick = 0
        for record in _committed(self._reader):
            tick = record.tick
            if record.kind in (Kind.META, Kind.HOST, Kind.END):
                self._identity(record)
                continue
            if record.kind == Kind.SESSION:
                session_tick = tick
            if tick == 0xFFFFFFFF:  # a frame that belongs to no tick: its session's first
                tick = session_tick
            if tick <= self._written:
                self.too_late += 1
                continue
            waiting.setdefault(tick, []).append(record)
            if tick > newest:
                newest = tick
                while (oldest := min(waiting)) < newest - REORDER_TICKS:
                    self._tick(oldest, waiting.pop(oldest))
        self._rest(waiting)

    def _rest(self, waiting: dict[int, list[Record]]) -> None:
        if not self._period_ns:
            raise SealError(f"{self._reader.path}: the journal ends before its META record: nothing was run")
        if not self._end:
            self._drop_incomplete(waiting)
        if self._end:  # no modelled delay is as long as REORDER_TICKS: what is in flight at the end is here
            self.run.ends_at(self._end["ticks"] * self._period_ns)
        for tick in sorted(waiting):
            self._tick(tick, waiting[tick])
        self.run.end(self.end)
        for writer in self._writers:
            writer.finish()

    def _drop_incomplete(self, waiting: dict[int, list[Record]]) -> None:
        """Without END the newest ticks may lack their answer: leave them out, so that every row is a whole one."""
        dropped = []
        for tick in sorted(waiting, reverse=True):
            if _is_whole(waiting[tick]):
                break
            dropped.append(tick)
            del waiting[tick]
        if dropped:
            span = f"tick {dropped[0]}" if len(dropped) == 1 else f"ticks {dropped[-1]} to {dropped[0]}"
            self.left_out = f"{span} left out: the run ended before the answer was recorded"

    def _tick(self, tick: int, records: list[Record]) -> None:
        if not self._period_ns:
            raise SealError(f"{self._reader.path}: expected META before tick {tick}")
        t_ns = tick * self._period_ns
        self._written = tick
        for_run: list[Record] = []
        for_timing: list[Record] = []
        for record in records:
            (for_timing if _is_of_the_host(record) else for_run).append(record)
        if any(record.kind == Kind.TRUTH for record in records):
            self._last_truth = max(self._last_truth, tick)
        self.run.tick(tick, t_ns, for_run)
        self.timing.tick(tick, t_ns, for_timing)

    def _identity(self, record: Record) -> None:
        content = json.loads(record.payload)
        if record.kind == Kind.META:
            self._period_ns = int(content["period_ns"])
            self.run.meta(content)
        elif record.kind == Kind.HOST:
            self.timing.host({**content, "sealed_with": {name: version(name) for name in LIBRARIES}})
        else:
            ticks = int(content["ticks"])
            if ticks < 0:
                raise ValueError(f"END: expected a number of ticks, got {ticks}")
            self._end = {**content, "reason": str(content["reason"]), "ticks": ticks}


def _committed(reader: JournalReader) -> Iterator[Record]:
    """The records of complete commits, in order; a commit that was cut off gives none."""
    pending: list[Record] = []
    for record in reader:
        if record.kind != Kind.COMMIT:
            pending.append(record)
            continue
        yield from pending
        pending.clear()


def _is_of_the_host(record: Record) -> bool:
    """The record says something about this machine, not about the simulated run."""
    if record.kind == Kind.LAB_EVENT:
        return jn.read_event(record.payload)[0] in OF_THE_HOST
    return record.kind in _TO_TIMING


def _is_whole(records: list[Record]) -> bool:
    """The tick has its truth and, where a SAMPLE was sent, COMMAND and all frames that COMMAND announces.

    Where the board restarted, what is missing never came.
    """
    packets = [jn.read_packet(record.payload) for record in records if record.kind == Kind.PACKET]
    if not any(record.kind == Kind.TRUTH for record in records):
        return False
    asked = any(p.direction == Direction.UP and RunRows.is_sample(p.packet) for p in packets)
    if not asked or _lost_its_board(records):
        return True
    answers = [p.packet for p in packets if p.direction == Direction.DOWN and not p.copy]
    expected = [RunRows.answer_frames(packet) for packet in answers]
    return any(expected) and len(answers) >= max(expected)


def _lost_its_board(records: list[Record]) -> bool:
    lab_events = [jn.read_event(record.payload)[0] for record in records if record.kind == Kind.LAB_EVENT]
    return events.BOARD_RESTARTED in lab_events


def _writer(file: IO[bytes]) -> Writer:
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4, enable_data_crcs=True)
    writer.start(profile="", library=LIBRARY)
    return writer


__all__ = ["JournalError", "SealError", "SealReport", "recover", "seal"]
