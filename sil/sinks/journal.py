"""run.journal: the append-only file a run writes while it runs, one write per tick, safe against kill -9.

    file   = "SILJRNL\\n", version u32, record*
    record = length u32 (of the payload), tick u32, kind u8, payload, CRC-32 u32 (zlib.crc32 over length..payload)

All little endian. A COMMIT record ends the records that one `commit` wrote: what follows the last COMMIT is an
incomplete tick. A record's tick is the tick it belongs to (a packet's header tick; the tick of the session's start for
CONFIG), not the one it was written in; the two differ by less than seal.REORDER_TICKS. run.mcap and timing.mcap are
pure functions of this file (sil.sinks.seal).
"""

from __future__ import annotations

import errno
import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

MAGIC = b"SILJRNL\n"
VERSION = 3  # 1 and 2, still read: without causes of lateness (1); packets without cause, copy and arrival (1, 2)
PAYLOAD_LIMIT = 16 * 2**20  # bytes; more is taken for a damaged length
READ_BLOCK = 2**20
NO_ANSWER = -1  # TIMING.answer_ns where no answer came

_FILE_HEADER = struct.Struct("<8sI")
_HEAD = struct.Struct("<IIB")
_CRC = struct.Struct("<I")
_TRUTH = struct.Struct("<16d3iB")
_LAB_EVENT = struct.Struct("<Hii")
_TIMING, _TIMING_1 = struct.Struct("<qqqqqI"), struct.Struct("<qqI")
_HOUSEKEEPING = struct.Struct("<Bq")
_PACKET, _PACKET_2 = struct.Struct("<BBBBqH"), struct.Struct("<BBH")
_SAYS_MORE = 0x80  # in a PACKET's direction: the layout since version 3
NOT_MODELLED = -1  # PACKET.arrival_ns of a frame that the model exempts


class Kind(IntEnum):
    """What a record holds. META, PACKET, TRUTH, LAB_EVENT, SESSION and END go to run.mcap, the rest to timing.mcap."""

    META = 1  # JSON: everything that decides the numbers
    HOST = 2  # JSON: everything about this machine and this link
    PACKET = 3  # a deterministic frame and its fate
    TRUTH = 4  # the plant at t_k and what acts from t_k on
    LAB_EVENT = 5  # code, a, b
    TIMING = 6  # wall-clock lateness of one tick, and why
    HOUSEKEEPING = 7  # a housekeeping frame with host time
    SESSION = 8  # a board session started at this tick
    END = 9  # JSON: {"reason": "finished|interrupted|failed|diverged", "ticks": N}
    COMMIT = 255  # the records of one commit are complete


class Direction(IntEnum):
    """Which way a frame goes: up from the laboratory to the board, down from the board."""

    UP = 0
    DOWN = 1


class Fate(IntEnum):
    """What became of a frame on the link."""

    DELIVERED = 0
    LATE = 1
    DROPPED = 2
    CORRUPTED = 3
    IN_FLIGHT = 4  # not yet arrived when the run ended


class Truth(NamedTuple):
    """One TRUTH record: the plant at t_k; `applied_Nm` acts on [t_k, t_k+1). Frames as in sil.signals.Motion."""

    q_BN: tuple[float, ...]  # (4,) scalar first
    omega_BN_B: tuple[float, ...]  # (3,) rad/s
    momentum_B: tuple[float, ...]  # (3,) N m s, absolute wheel momentum
    euler_rad: tuple[float, ...]  # (3,) [x, y, z]
    applied_Nm: tuple[float, ...]  # (3,) on the body, after limits
    setpoint_bam: tuple[int, ...]  # (3,) r(k) as the laboratory resolved it, 2^-32 turn
    source: int  # 0 zero, 1 fresh, 2 held


class PacketRecord(NamedTuple):
    """One PACKET record: a copy of a frame, what became of it and why."""

    direction: int
    fate: int
    packet: bytes  # header to CRC
    encoded: bytes  # the bytes on the wire where a byte fault altered them, else empty
    cause: str = ""  # of loss, damage or lateness
    copy: int = 0  # 0: the frame's own, 1: of a duplicate
    arrival_ns: int = NOT_MODELLED  # modelled, had it not been lost


class Record(NamedTuple):
    """One record as read back; `offset` is where it begins in the file."""

    kind: int
    tick: int
    payload: bytes
    offset: int


class JournalError(Exception):
    """The journal cannot be written or is not a journal: one line with the path."""


# -- payloads ------------------------------------------------------------------------------------------------------


def truth_payload(
    q_BN: Any, omega_BN_B: Any, momentum_B: Any, euler_rad: Any, applied_Nm: Any, setpoint_bam: Any, source: int
) -> bytes:
    """TRUTH: 4 + 3 + 3 + 3 + 3 float64 (any sequences; units of Truth), set-point 3 int32, then the torque's source."""
    return _TRUTH.pack(*q_BN, *omega_BN_B, *momentum_B, *euler_rad, *applied_Nm, *setpoint_bam, source)


def read_truth(payload: bytes) -> Truth:
    """The inverse of truth_payload."""
    v = _TRUTH.unpack(payload)
    return Truth(v[0:4], v[4:7], v[7:10], v[10:13], v[13:16], v[16:19], v[19])


def packet_payload(
    direction: int,
    fate: int,
    packet: bytes,
    encoded: bytes = b"",
    cause: str = "",
    copy: int = 0,
    arrival_ns: int = NOT_MODELLED,
) -> bytes:
    """PACKET: direction u8 (and 0x80), fate u8, copy u8, length of the cause u8, arrival i64 ns, packet length u16;
    cause (ASCII), packet, encoded (where a byte fault altered it)."""
    said = cause.encode("ascii")
    head = _PACKET.pack(direction | _SAYS_MORE, fate, copy, len(said), arrival_ns, len(packet))
    return head + said + packet + encoded


def read_packet(payload: bytes) -> PacketRecord:
    """The inverse of packet_payload."""
    if not payload[0] & _SAYS_MORE:
        direction, fate, length = _PACKET_2.unpack_from(payload)
        start = _PACKET_2.size
        return PacketRecord(direction, fate, payload[start : start + length], payload[start + length :])
    direction, fate, copy, said, arrival_ns, length = _PACKET.unpack_from(payload)
    start = _PACKET.size + said
    cause = payload[_PACKET.size : start].decode("ascii")
    packet, encoded = payload[start : start + length], payload[start + length :]
    return PacketRecord(direction & ~_SAYS_MORE, fate, packet, encoded, cause, copy, arrival_ns)


def event_payload(code: int, a: int, b: int) -> bytes:
    """LAB_EVENT: code u16, a i32, b i32 (texts: sil.sinks.events)."""
    return _LAB_EVENT.pack(code, a, b)


def read_event(payload: bytes) -> tuple[int, int, int]:
    """(code, a, b)."""
    code, a, b = _LAB_EVENT.unpack(payload)
    return code, a, b


class Timing(NamedTuple):
    """One TIMING record, in ns: what the host's clock says of a tick."""

    lateness_ns: int
    answer_ns: int  # SAMPLE to COMMAND; NO_ANSWER: none came
    work_ns: int  # CPU time the laboratory took for the tick before
    gc_ns: int
    log_ns: int
    cause: int  # sil.lateness.Cause


def timing_payload(
    lateness_ns: int, answer_ns: int = NO_ANSWER, work_ns: int = 0, gc_ns: int = 0, log_ns: int = 0, cause: int = 0
) -> bytes:
    """TIMING: five i64 ns and the cause u32, as in Timing."""
    return _TIMING.pack(lateness_ns, answer_ns, work_ns, gc_ns, log_ns, cause)


def read_timing(payload: bytes) -> Timing:
    """The inverse of timing_payload."""
    if len(payload) == _TIMING_1.size:
        lateness_ns, answer_ns, _ = _TIMING_1.unpack(payload)
        return Timing(lateness_ns, answer_ns, 0, 0, 0, 0)
    return Timing(*_TIMING.unpack(payload))


def housekeeping_payload(direction: int, host_ns: int, packet: bytes) -> bytes:
    """HOUSEKEEPING: direction u8, host time i64 ns (CLOCK_MONOTONIC), packet bytes."""
    return _HOUSEKEEPING.pack(direction, host_ns) + packet


def read_housekeeping(payload: bytes) -> tuple[int, int, bytes]:
    """(direction, host_ns, packet)."""
    direction, host_ns = _HOUSEKEEPING.unpack_from(payload)
    return direction, host_ns, payload[_HOUSEKEEPING.size :]


def json_payload(content: Mapping[str, Any]) -> bytes:
    """META, HOST, SESSION, END: canonical JSON, so equal content gives equal bytes."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


# -- writing -------------------------------------------------------------------------------------------------------


class Journal:
    """Appends records; nothing reaches the file before `commit`, and each commit is one write.

    Raises JournalError where the file exists, cannot be made, or a write fails (disk full): then the file is cut back
    to the last commit, nothing written before is lost, and the journal accepts no more.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._pending: list[bytes] = []
        self._size = 0
        self._failed = ""
        try:
            self._fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_APPEND, 0o644)
        except OSError as error:
            raise JournalError(f"{self.path}: cannot create the journal: {_reason(error)}") from error
        self._write(_FILE_HEADER.pack(MAGIC, VERSION), None)

    def add(self, kind: int, tick: int, payload: bytes) -> None:
        """Put one record into the next commit."""
        head = _HEAD.pack(len(payload), tick, kind) + payload
        self._pending.append(head)
        self._pending.append(_CRC.pack(zlib.crc32(head)))

    def commit(self, tick: int) -> None:
        """Hand all pending records to the kernel with one write, ended by COMMIT(tick): tick is done."""
        if self._failed:
            raise JournalError(self._failed)
        self.add(Kind.COMMIT, tick, b"")
        data = b"".join(self._pending)
        self._pending.clear()
        self._write(data, tick)

    def close(self) -> None:
        """Close the file; records that were not committed are dropped. May be called twice."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _write(self, data: bytes, tick: int | None) -> None:
        done = 0
        try:
            while done < len(data):
                done += os.write(self._fd, data[done:] if done else data)
        except OSError as error:
            where = "at its first bytes" if tick is None else f"at tick {tick}"
            self._failed = f"{self.path}: the journal ends {where}: {_reason(error)}; everything before it is kept"
            self._cut_back()
            if tick is None:
                self.close()
            raise JournalError(self._failed) from error
        self._size += done

    def _cut_back(self) -> None:
        """Remove a half-written commit; a reader would stop there anyway, so a refusal does no harm."""
        try:
            os.ftruncate(self._fd, self._size)
        except OSError:
            return


def _reason(error: OSError) -> str:
    return "no space left on the disk" if error.errno == errno.ENOSPC else (error.strerror or str(error))


# -- reading -------------------------------------------------------------------------------------------------------


class JournalReader:
    """Iterates over the Records of a journal up to its end or its first truncated or corrupt record.

    After the iteration: `damage` is "" or says where and why it stopped; `committed` is the offset behind the last
    COMMIT; `commit_tick` is that COMMIT's tick (-1: none). COMMIT records are yielded like all others.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.damage = ""
        self.committed = _FILE_HEADER.size
        self.commit_tick = -1
        self._check_header()

    def __iter__(self) -> Iterator[Record]:
        for record in self.follow():
            if record is None:
                return
            yield record

    def follow(self) -> Iterator[Record | None]:
        """The same of a journal that is still being written: None wherever there is nothing more to read yet."""
        with open(self.path, "rb") as file:
            base = _FILE_HEADER.size
            file.seek(base)
            data = b""
            at = 0  # data[at] is the file's byte base + at
            while True:
                self.damage = ""  # a record that was cut off may be whole by now
                block = file.read(READ_BLOCK)
                data = data[at:] + block
                base += at
                at = 0
                while (record := self._next(data, at, base)) is not None:
                    at = record.offset - base + _HEAD.size + len(record.payload) + _CRC.size
                    if record.kind == Kind.COMMIT:
                        self.committed = base + at
                        self.commit_tick = record.tick
                    yield record
                if self.damage:
                    return
                if not block:
                    if (left := len(data) - at) > 0:
                        self.damage = f"{self.path}: the record at byte {base + at} is cut off after {left} bytes"
                    yield None

    def _next(self, data: bytes, at: int, base: int) -> Record | None:
        """The record at data[at:], or None: not all there yet, or damaged (then self.damage says so)."""
        left = len(data) - at
        if left < _HEAD.size:
            return None
        length, tick, kind = _HEAD.unpack_from(data, at)
        end = at + _HEAD.size + length
        if length > PAYLOAD_LIMIT:
            self.damage = f"{self.path}: the record at byte {base + at} claims {length} bytes (limit {PAYLOAD_LIMIT})"
            return None
        if end + _CRC.size > len(data):
            return None
        stored = _CRC.unpack_from(data, end)[0]
        computed = zlib.crc32(memoryview(data)[at:end])
        if stored != computed:
            self.damage = (
                f"{self.path}: the record at byte {base + at} has CRC {stored:#010x}, its bytes give {computed:#010x}"
            )
            return None
        return Record(kind, tick, data[at + _HEAD.size : end], base + at)

    def _check_header(self) -> None:
        try:
            with open(self.path, "rb") as file:
                header = file.read(_FILE_HEADER.size)
        except OSError as error:
            raise JournalError(f"{self.path}: cannot read the journal: {_reason(error)}") from error
        if len(header) < _FILE_HEADER.size:
            raise JournalError(f"{self.path}: expected a journal, got {len(header)} bytes")
        magic, version = _FILE_HEADER.unpack(header)
        if magic != MAGIC:
            raise JournalError(f"{self.path}: expected a journal (it starts with {MAGIC!r}), got {magic!r}")
        if not 1 <= version <= VERSION:
            raise JournalError(f"{self.path}: expected journal version 1 to {VERSION}, got {version}")


def read_journal(path: str | os.PathLike[str]) -> JournalReader:
    """The records of the journal at `path`, in the order written; see JournalReader."""
    return JournalReader(path)
