"""The C board and the Python board on the same scripted hardware: bytes that come, a clock, and what either answers."""

from __future__ import annotations

import ctypes
import hashlib
import os
import struct
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from firmware_sim.board import BUILD, Board
from protocol.link import Link
from protocol.port import Port
from sil.pil import library

HERE = Path(__file__).parent
CORE = library.FIRMWARE / "core"
WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{CORE}")
SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
DATAGRAM, NO_TIMER, HEALTH, ONCE = 1, 2, 4, 8
FOREVER = 2**63 - 1
ROOM = 1 << 28
DECODER_COUNTERS = ("frames", "empty", "too_short", "too_long", "cobs_errors", "crc_errors", "discarded_bytes")
PORT_COUNTERS = ("sent", "received", "unknown", "sequence_gaps", "duplicates")


class Step(NamedTuple):
    """One record of a script: bytes that come (`data`), or the clock's time from here on."""

    data: bytes = b""
    time_ns: int | None = None


class Heard(NamedTuple):
    """What a board did: ("W", bytes) for each write, ("U", ns or None) for what it waited for before each step."""

    records: list[tuple[str, Any]]
    counters: dict[str, int]

    @property
    def writes(self) -> list[bytes]:
        return [payload for kind, payload in self.records if kind == "W"]


# -- C ----------------------------------------------------------------------------------------------------------------


class CBoard:
    """firmware/core with script.c, as a library. `options`: more for the compiler; `law`: a file instead of laws.c."""

    def __init__(self, folder: Path, *options: str, law: str = "") -> None:
        files = ["script.c", *([law] if law else [])]
        path = built(folder, "scripted.so", [*library.FLAGS, *library.SHARED, *options], files)
        self._lib = ctypes.CDLL(str(path))
        for name in ("script_serve", "script_decode", "script_datagrams", "cobs_decode"):
            getattr(self._lib, name).restype = ctypes.c_size_t
        self._out = ctypes.create_string_buffer(ROOM // 8)

    def serve(self, steps: Sequence[Step], options: int = 0, build: str = BUILD) -> Heard:
        """From boot to the end of the script."""
        script = script_of(steps)
        return heard(self._call("script_serve", script, len(script), options, build.encode()))

    def decode(self, data: bytes, cut: int) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
        """Packets with a right CRC and the verdict on each; counters."""
        return decoded(self._call("script_decode", data, len(data), ctypes.c_size_t(cut)))

    def datagrams(self, datagrams: Sequence[bytes]) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
        """The same for a datagram link."""
        script = script_of([Step(datagram) for datagram in datagrams])
        return decoded(self._call("script_datagrams", script, len(script)))

    def check(self, packet: bytes) -> int:
        """packet_check(), a packet_verdict."""
        return int(self._lib.packet_check(packet, ctypes.c_size_t(len(packet))))

    def cobs_encode(self, plain: bytes) -> bytes:
        """cobs_encode(), in place as the port does it."""
        buffer = ctypes.create_string_buffer(b"\xff" + plain, len(plain) + 1)
        start = ctypes.addressof(buffer)
        self._lib.cobs_encode(ctypes.c_void_p(start + 1), ctypes.c_size_t(len(plain)), ctypes.c_void_p(start))
        return buffer.raw

    def cobs_decode(self, encoded: bytes) -> bytes | None:
        """cobs_decode(), in place as the decoder does it; None where it is no COBS."""
        buffer = ctypes.create_string_buffer(encoded, max(len(encoded), 1))
        size = self._lib.cobs_decode(buffer, ctypes.c_size_t(len(encoded)), buffer)
        return None if size == 2**64 - 1 else buffer.raw[:size]

    def _call(self, name: str, data: bytes, size: int, *more: Any) -> bytes:
        room = ctypes.c_size_t(len(self._out))
        used: int = getattr(self._lib, name)(data, ctypes.c_size_t(size), *more, self._out, room)
        assert used <= len(self._out), "the output has no room"
        return ctypes.string_at(self._out, used)


def built(folder: Path, name: str, flags: Sequence[str], files: Sequence[str]) -> Path:
    """The core with files of this folder; built once for all workers of a test run."""
    mine = [HERE / file for file in files]
    digest = hashlib.sha256(library.source_hash().encode() + "\0".join(flags).encode())
    for path in [*mine, HERE / "script.h"]:
        digest.update(path.read_bytes())
    path = folder / f"{digest.hexdigest()[:16]}-{name}"
    if not path.exists():
        compiler = next(library.compilers())
        folder.mkdir(parents=True, exist_ok=True)
        core = library.c_files(library.FOLDERS[:2])
        if any(file.endswith("law.c") for file in files):
            core.remove(str(CORE / "laws.c"))
        library.build(path, compiler, [*flags, *WARNINGS, *core, *map(str, mine)])
    return path


def sanitized(program: Path, mode: str, number: int, data: bytes) -> bytes:
    """Output of scripted.c; whatever a sanitizer finds is the failure."""
    done = subprocess.run([str(program), mode, str(number)], input=data, capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr.decode(errors="replace")[-4000:]
    return done.stdout


def script_of(steps: Sequence[Step]) -> bytes:
    """A script as script.h has it."""
    return b"".join(
        b"B" + struct.pack("<I", len(step.data)) + step.data
        if step.time_ns is None
        else b"T" + struct.pack("<Iq", 8, step.time_ns)
        for step in steps
    )


def heard(output: bytes) -> Heard:
    """An output of script_serve()."""
    records: list[tuple[str, Any]] = []
    for kind, payload in _records(output):
        if kind == ord("W"):
            records.append(("W", payload))
        elif kind == ord("U"):
            (until_ns,) = struct.unpack("<q", payload)
            records.append(("U", None if until_ns == FOREVER else until_ns))
        else:
            numbers = struct.unpack(f"<{len(payload) // 4}I", payload)
    return Heard(records, dict(zip(DECODER_COUNTERS + PORT_COUNTERS, numbers, strict=True)))


def decoded(output: bytes) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
    """An output of script_decode() or script_datagrams()."""
    *packets, (_, last) = _records(output)
    numbers = struct.unpack(f"<{len(last) // 4}I", last)
    return packets, dict(zip((*DECODER_COUNTERS, "pending"), numbers, strict=True))


def _records(output: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at < len(output):
        kind, size = struct.unpack_from("<BI", output, at)
        yield kind, output[at + 5 : at + 5 + size]
        at += 5 + size


# -- Python -----------------------------------------------------------------------------------------------------------


class ScriptLink(Link):
    """The board's end of a link: hands out what it is given, a piece at a time, and keeps what is sent."""

    def __init__(self, datagram: bool) -> None:
        self.datagram = datagram
        self.inbox: list[bytes] = []
        self.records: list[tuple[str, Any]] = []

    @classmethod
    def open(cls, url: str, listen: bool) -> Link:
        raise NotImplementedError

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        raise NotImplementedError

    def send(self, data: bytes) -> None:
        self.records.append(("W", data))

    def receive(self, timeout_s: float | None) -> bytes:
        return self.inbox.pop(0) if self.inbox else b""

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        pass


class ScriptHal:
    """The clock of a script."""

    def __init__(self) -> None:
        self.time_ns = 0

    def now(self) -> int:
        return self.time_ns

    def wait(self, until_ns: int | None) -> None:
        raise AssertionError("the script drives the board itself")

    def kick(self) -> None:
        pass


def python_board(steps: Sequence[Step], options: int = 0) -> Heard:
    """The Python board on the same hardware.

    Bytes are handed over one candidate at a time: a port checks the numbers of all that it has read, before a HELLO
    among it lets them begin anew.
    """
    link, hal = ScriptLink(bool(options & DATAGRAM)), ScriptHal()
    port = Port(link)
    board = Board(port, hal)
    board.announce()
    for step in steps:
        link.records.append(("U", _until(board)))
        if step.time_ns is not None:
            hal.time_ns = step.time_ns
        handled = 0
        for piece in [step.data] if link.datagram else _cut(step.data):
            link.inbox = [piece]
            while (packet := port.receive(0.0)) is not None:
                board.handle(packet)
                handled += 1
        if not handled and board.timer_ns is not None and hal.time_ns >= board.timer_ns:
            board.on_timer()
    link.records.append(("U", _until(board)))
    counters = port.counters
    names = {name: getattr(counters, name) for name in (*DECODER_COUNTERS, *PORT_COUNTERS) if name != "frames"}
    return Heard(link.records, names | {"frames": counters.received + counters.unknown})


def _until(board: Board) -> int | None:
    """When its timer fires; what does not fit 64 bits is for ever."""
    return board.timer_ns if board.timer_ns is not None and board.timer_ns < FOREVER else None


def assert_same(heard: Heard, expected: Heard) -> None:
    """Fails with the first difference."""
    for number, (one, other) in enumerate(zip(heard.records, expected.records, strict=False)):
        before = expected.records[max(0, number - 3) : number]
        assert one == other, f"record {number}: C {one}, Python {other}; before: {before}"
    assert len(heard.records) == len(expected.records)
    assert heard.counters == expected.counters


def _cut(data: bytes) -> list[bytes]:
    """`data` after each zero."""
    pieces = data.split(b"\0")
    return [piece + b"\0" for piece in pieces[:-1]] + [pieces[-1]]


def parallel_folder(base: Path) -> Path:
    """One folder for all workers of a run: `base` is a worker's own."""
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "firmware"
