"""Conformance vectors for every codec, in whatever language: `python -m tools.make_vectors [--check]`.

Writes tests/conformance/packets.json (all frame types, valid and invalid with the reason) and streams.json (COBS and
whole byte streams). The header in each file says when to make them anew. Deterministic: the same code, the same files.
"""

from __future__ import annotations

import argparse
import json
import random
import struct
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cobs import cobs

from protocol import frames as f
from protocol.codec import StreamDecoder, encode
from tools.frame_json import to_json

FOLDER = Path(__file__).parent.parent / "tests" / "conformance"
UPDATE = (
    "made by `python -m tools.make_vectors`: fields and reasons are written there by hand, bytes and counters are what "
    "the Python codec makes of them. Make anew only when a layout changes on purpose (then layout_hash differs, and "
    "flashed boards and old logs are void), and read the diff"
)
ZERO3 = (0, 0, 0)
LOW, HIGH = -(2**31), 2**31 - 1


def valid_frames() -> Iterator[tuple[str, int, f.Frame]]:
    """(name, sequence, frame): every type, every subset of readings, the ends of every range."""
    yield "config, one word", 0, f.Config(0, 1, 0, (1,))
    yield "config, no word", 1, f.Config(0, 1, 0, ())
    yield "config, full part", 65535, f.Config(319, 320, 0xFFFF, tuple([LOW, HIGH, -1, 0] * 14 + [7]))
    for present in range(8):
        readings = tuple(
            f.Reading(1000 * bit + 1, tuple(range(-bit - 1, count - bit - 1))) if present >> bit & 1 else None
            for bit, count in enumerate((3, 4, 3))
        )
        frame = f.Sample(7, (1, -2, 3), (4, -5, 6), (7, -8, 9), 6, 6857, f.FRESH, present, readings)  # type: ignore[arg-type]
        yield f"sample, readings {present:03b}", 10 + present, frame
    euler = (f.Reading(0xFFFFFFFF, (LOW, HIGH, 0)), None, None)
    yield "sample, reading invalid", 20, f.Sample(8, ZERO3, ZERO3, ZERO3, 7, 0, f.HELD, 0, euler)
    extreme = (LOW, HIGH, -1)
    yield (
        "sample, extremes",
        21,
        f.Sample(0xFFFFFFFE, extreme, extreme, extreme, f.NO_TICK, 0xFFFFFFFF, f.ZERO, 0, (None,) * 3),
    )
    for used in (f.USED, f.PROPAGATED, f.REPEATED, f.RESTARTED, f.REUSED):
        yield f"command, used {used}", used, f.Command(used, (100, -200, 300), 1 << used, used, used)
    yield "command, extremes", 0xFFFF, f.Command(0xFFFFFFFE, extreme, 0xFFFF, 255, f.USED)
    yield "telemetry, no word", 5, f.Telemetry(9, 1, 1, ())
    yield "telemetry, full", 6, f.Telemetry(9, 0xFFFF, 0xFFFF, tuple(range(-29, 29)))
    yield "event", 7, f.Event(9, 2, 9, 1)
    yield "event, extremes", 8, f.Event(0, 0xFFFF, LOW, HIGH)
    yield "hello, lab", 0, f.Hello(1, f.ROLE_LAB, 0, f.LAYOUT_HASH, 0x0102030405060708, 20 << 16, "sil 0.1")
    yield "hello, board echo", 0, f.Hello(1, f.ROLE_BOARD, 7, f.LAYOUT_HASH, 0x0102030405060708, 0, "")
    yield "hello, another protocol", 1, f.Hello(0xFFFF, 1, 0xFF, 0, 2**64 - 1, 0xFFFFFFFF, "~" * 24)
    yield "ready", 1, f.Ready(f.READY_OK, f.NO_INDEX, 0xCAFEF00D)
    yield "ready, bad word", 2, f.Ready(f.READY_BAD_WORD, 27, 0)
    yield "tick", 3, f.Tick(7)
    yield "tick, zeros throughout", 0, f.Tick(0)
    yield "timing", 4, f.Timing(7, 345_000_000, 512, 1, 251)
    yield "stop", 5, f.Stop(f.STOP_INTERRUPTED)


def sealed(body: bytes | bytearray) -> bytes:
    """Header and body with the CRC that fits."""
    start = 0 if body[1] == f.Type.HELLO else f.LAYOUT_HASH
    return bytes(body) + struct.pack("<I", zlib.crc32(body, start))


def changed(frame: f.Frame, at: int, new: bytes) -> bytes:
    """A packet of `frame` with some bytes changed and the CRC made to fit."""
    body = bytearray(f.pack(frame, 3)[:-4])
    body[at : at + len(new)] = new
    return sealed(body)


def invalid_packets() -> Iterator[tuple[str, str, bytes]]:
    """(reason of the refusal, name, packet), each with one fault."""
    tick, stop = f.Tick(7), f.Stop(0)
    sample = f.Sample(7, ZERO3, ZERO3, ZERO3, 6, 0, f.FRESH, 1, (f.Reading(0, ZERO3), None, None))
    command, hello = f.Command(7, ZERO3, 0, 0, f.USED), f.Hello(1, 0, 0, f.LAYOUT_HASH, 5, 0, "x")
    config, event = f.Config(0, 1, 0, (1, 2)), f.Event(7, 1, 2, 3)
    packet = f.pack(tick, 3)
    yield "too_short", "nothing", b""
    yield "too_short", "eleven bytes", packet[:11]
    yield "too_long", "251 bytes", sealed(f.pack(f.Telemetry(7, 1, 1, (0,) * 58), 0)[:-4] + b"\0" * 3)
    damaged = bytearray(f.pack(command, 3))
    damaged[10] ^= 1
    yield "crc", "one bit wrong in the body", bytes(damaged)
    yield "crc", "one bit wrong in the CRC", packet[:-1] + bytes([packet[-1] ^ 0x80])
    yield "crc", "CRC from 0 where it should be from L", packet[:-4] + struct.pack("<I", zlib.crc32(packet[:-4]))
    body = f.pack(hello, 3)[:-4]
    yield "crc", "hello with CRC from L", body + struct.pack("<I", zlib.crc32(body, f.LAYOUT_HASH))
    yield "crc", "CRC big endian", packet[:-4] + packet[-4:][::-1]
    yield "version", "header version 2", changed(tick, 0, b"\2")
    yield "version", "hello with header version 2", changed(hello, 0, b"\2")
    yield "type", "type 0", changed(tick, 1, b"\0")
    yield "type", "type 0x06", changed(tick, 1, b"\x06")
    yield "type", "type 0x86", changed(tick, 1, b"\x86")
    yield "length", "tick with a byte too many", sealed(packet[:-4] + b"\0")
    yield "length", "command two bytes short", sealed(f.pack(command, 3)[:-6])
    yield "length", "config whose words end in the middle", sealed(f.pack(config, 3)[:-6])
    yield "length", "sample without its readings", sealed(f.pack(sample, 3)[:-20])
    yield "length", "sample with more than its readings", sealed(f.pack(sample, 3)[:-4] + bytes(4))
    yield "value", "sample, a bit of present that is none", changed(sample, 53, b"\x09")
    yield "value", "sample, valid without present", changed(sample, 54, b"\x02")
    yield "value", "sample, source 3", changed(sample, 52, b"\x03")
    yield "value", "sample, reserved", changed(sample, 55, b"\x01")
    yield "value", "sample of no tick", changed(sample, 4, b"\xff" * 4)
    yield "value", "tick of no tick", changed(tick, 4, b"\xff" * 4)
    yield "value", "stop with a tick", changed(stop, 4, bytes(4))
    yield "value", "stop, reserved", changed(stop, 10, b"\1")
    yield "value", "command, used 0", changed(command, 23, b"\0")
    yield "value", "command, used 6", changed(command, 23, b"\6")
    yield "value", "config, part not below parts", changed(config, 8, b"\1\0")
    yield "value", "config, reserved", changed(config, 14, b"\1")
    yield "value", "event, reserved", changed(event, 10, b"\1")
    yield "value", "hello, role 2", changed(hello, 10, b"\2")
    yield "value", "hello, build not ASCII", changed(hello, 28, b"\xb5")
    yield "value", "hello, build after a NUL", changed(hello, 28, b"a\0b")


def packets() -> dict[str, Any]:
    """packets.json: valid with fields and wire form; invalid with the reason a receiver counts it under."""
    valid = []
    for name, sequence, frame in valid_frames():
        packet = f.pack(frame, sequence)
        assert f.unpack(packet).frame == frame
        fields = to_json(packet)
        valid.append({"name": name, "frame": fields, "packet": packet.hex(), "wire": encode(packet).hex()})
    invalid = [{"name": name, "packet": packet.hex(), "reason": reason} for reason, name, packet in invalid_packets()]
    about = "packets (header to CRC): a receiver reads `valid` as `frame` and refuses `invalid` for `reason`"
    return {"about": about, "how": UPDATE, "layout_hash": f"{f.LAYOUT_HASH:08x}", "valid": valid, "invalid": invalid}


def cobs_pairs() -> list[dict[str, str]]:
    """Decoded and encoded, zeros and 0xFF blocks included; beyond 250 bytes only to test a codec's edges."""
    runs = [b"", b"\0", b"\0\0", b"\1", b"\1\0", b"\0\1", b"\x11\x22\0\x33", b"\x11\0\0\0", b"\xff" * 3, bytes(250)]
    runs += [bytes(1 + i % 255 for i in range(n)) for n in (249, 250, 253, 254, 255)]
    runs += [bytes(range(250)), bytes(range(249, -1, -1))]
    return [{"decoded": run.hex(), "encoded": cobs.encode(run).hex()} for run in runs]


def bad_cobs() -> list[str]:
    """Encoded forms whose chain does not end where they end."""
    return [run.hex() for run in (b"\2", b"\5abc", b"\1\3a", b"\xff" + b"a" * 100)]


def streams() -> dict[str, Any]:
    """streams.json: COBS pairs, and bytes as they come with the packets and counters they give."""
    cases = [stream_case(name, data) for name, data in byte_streams()]
    about = "cobs: decoded and encoded; bad: not COBS; streams: bytes, the packets they hold, and a decoder's counters"
    head = {"about": about, "how": UPDATE, "layout_hash": f"{f.LAYOUT_HASH:08x}"}
    return head | {"cobs": cobs_pairs(), "bad": bad_cobs(), "streams": cases}


def stream_case(name: str, data: bytes) -> dict[str, Any]:
    decoder = StreamDecoder()
    got = decoder.feed(data)
    counters = asdict(decoder.counters) | {"pending": decoder.buffered}
    return {"name": name, "bytes": data.hex(), "packets": [packet.hex() for packet in got], "counters": counters}


def byte_streams() -> Iterator[tuple[str, bytes]]:
    """Clean, shared delimiters, garbage before, within and after, cut short, too long, random damage."""
    one, two = f.pack(f.Tick(0), 0), f.pack(f.Command(7, (1, -2, 3), 0, 0, f.USED), 1)
    a, b = encode(one), encode(two)
    full = encode(f.pack(f.Telemetry(9, 1, 1, tuple(range(58))), 2))
    yield "empty", b""
    yield "only delimiters", bytes(5)
    yield "two frames", a + b
    yield "shared delimiter", a + b[1:]
    yield "longest frame", full
    yield "garbage before", b"\x55\xaa garbage" + a
    yield "garbage between", a + b"boot: hello\r\n" + b
    yield "garbage after", a + b"\x01\x02\x03"
    yield "first half of a frame, then another", full[:100] + b
    yield "second half of a frame, then another", full[100:] + b
    yield "too long, then a frame", b"\0" + b"\x42" * 252 + b"\0" + a
    yield "longest candidate that is no frame", b"\0" + b"\xfb" + b"\x42" * 250 + b"\0" + a
    yield "endless without delimiter", b"\x42" * 2000
    yield "end of an endless one, then a frame", b"\x42" * 2000 + a
    yield "a frame in the too long one's tail is lost with it", b"\x42" * 2000 + b[1:] + a
    yield "twelve bytes", b"\0" + b"\x0c" + b"\x01" * 11 + b"\0" + a
    yield "code byte beyond the end", b"\0" + b"\xf0" + b"\x11" * 20 + b"\0" + b
    yield "one bit wrong, then a frame", bytes([*b[:6], b[6] ^ 4, *b[7:]]) + a
    yield "delimiter lost between two", a[:-1] + b[1:] + a
    yield "a zero within a frame", b[:12] + b"\0" + b[13:] + a
    rng = random.Random(5)
    for number in range(10):
        wire = bytearray(a + b + full + a + b)
        for _ in range(number + 1):
            wire[rng.randrange(len(wire))] = rng.randrange(256)
        yield f"random damage {number}", bytes(wire) + a


def text(data: dict[str, Any]) -> str:
    """JSON with one case per line: readable, and a diff names the case."""
    lines = []
    for key, value in data.items():
        if isinstance(value, list):
            cases = ",\n".join(f"  {json.dumps(case)}" for case in value)
            lines.append(f"{json.dumps(key)}: [\n{cases}\n]")
        else:
            lines.append(f"{json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def main(argv: Sequence[str] | None = None) -> int:
    """0 written or in step, 1 out of step."""
    parser = argparse.ArgumentParser(prog="python -m tools.make_vectors", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, exit 1 where a file would change")
    options = parser.parse_args(argv)
    stale = False
    for name, data in (("packets.json", packets()), ("streams.json", streams())):
        path, new = FOLDER / name, text(data)
        if options.check:
            stale |= not path.exists() or path.read_text() != new
        else:
            path.write_text(new)
            print(f"{path.name}: {len(new)} bytes")
    if stale:
        print("conformance vectors are out of step: python -m tools.make_vectors", file=sys.stderr)
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
