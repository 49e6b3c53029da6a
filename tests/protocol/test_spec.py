"""SPEC.md is executed: its examples, vectors and texts are what the code does, its generated tables are in step."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import pytest

from protocol import events, layouts
from protocol import frames as f
from protocol.codec import StreamDecoder, encode
from protocol.law_tables import LAWS

ROOT = Path(__file__).parents[2]
SPEC = (ROOT / "protocol" / "SPEC.md").read_text()
EXAMPLES = re.findall(r"```frame\n(.*?)\n```\n\n```packet\n(.*?)\n```\n\n```stream\n(.*?)\n```", SPEC, re.DOTALL)


def frame_of(fields: dict[str, Any]) -> tuple[f.Frame, int]:
    """(frame, sequence) of an example's JSON, by the names in SPEC."""
    fields = dict(fields)
    cls = getattr(f, fields.pop("type").capitalize())
    sequence, tick = fields.pop("sequence"), fields.pop("tick")
    if tick is not None:
        fields["tick"] = tick
    if "nonce" in fields:
        fields["nonce"] = int(fields["nonce"], 16)
    if "readings" in fields:
        given = fields["readings"]
        fields["readings"] = tuple(
            f.Reading(given[name]["age_us"], tuple(given[name]["values"])) if name in given else None
            for name in ("euler", "quaternion", "rate")
        )
    return cls(**{key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}), sequence


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: json.loads(example[0])["type"])
def test_example_runs(example: tuple[str, str, str]) -> None:
    frame, sequence = frame_of(json.loads(example[0]))
    packet, stream = bytes.fromhex(example[1]), bytes.fromhex(example[2])
    assert f.pack(frame, sequence) == packet
    assert f.unpack(packet).frame == frame
    assert encode(packet) == stream
    assert StreamDecoder().feed(stream) == [packet]


def test_every_frame_type_has_an_example() -> None:
    assert {json.loads(example[0])["type"] for example in EXAMPLES} == {type_.name for type_ in f.Type}


def test_crc_vectors() -> None:
    (block,) = re.findall(r"```crc\n(.*?)\n```", SPEC, re.DOTALL)
    vectors = [line.split()[:3] for line in block.splitlines()]
    assert len(vectors) >= 3
    for data, start, crc in vectors:
        assert zlib.crc32(bytes.fromhex(data), int(start, 16)) == int(crc, 16)
        assert bitwise_crc(bytes.fromhex(data), int(start, 16)) == int(crc, 16)


def bitwise_crc(data: bytes, start: int) -> int:
    """The C of SPEC section 2, letter by letter."""
    r = start ^ 0xFFFFFFFF
    for byte in data:
        r ^= byte
        for _ in range(8):
            r = (r >> 1) ^ (0xEDB88320 if r & 1 else 0)
    return r ^ 0xFFFFFFFF


def cobs_encode(data: bytes) -> bytes:
    """The C of SPEC section 4, letter by letter."""
    out, code = bytearray(1), 0
    for byte in data:
        if byte:
            out.append(byte)
        else:
            out[code] = len(out) - code
            code = len(out)
            out.append(0)
    out[code] = len(out) - code
    return bytes(out)


def test_cobs_as_written_in_spec() -> None:
    for data in (b"", b"\0", b"\0\0", b"a", b"a\0", b"\0a", bytes(250), bytes(range(250)), b"\xff" * 250):
        assert b"\0" + cobs_encode(data) + b"\0" == encode(data)


def test_layout_text_gives_the_layout_hash() -> None:
    (text,) = re.findall(r"```layout\n(.*?)```", SPEC, re.DOTALL)
    assert zlib.crc32(text.encode("ascii")) == f.LAYOUT_HASH == layouts.LAYOUT_HASH
    assert f"0x{f.LAYOUT_HASH:08X}" in SPEC


def test_law_texts_are_the_tables() -> None:
    hashes = re.findall(r"CRC-32 0x([0-9A-F]{8}):\n\n```law\n(.*?)\n```", SPEC, re.DOTALL)
    assert len(hashes) == len(LAWS)
    for crc, text in hashes:
        assert zlib.crc32(text.encode()) == int(crc, 16)


def test_every_event_and_frame_is_in_spec() -> None:
    for kind in events.EVENTS.values():
        assert f"| 0x{kind.code:04X} | {kind.name} |" in SPEC
    for type_ in f.Type:
        assert f"### {type_.name}, type 0x{type_:02X}" in SPEC


def test_generated_parts_are_in_step() -> None:
    """After a change of a table: python -m tools.spec_tables --write."""
    command = [sys.executable, "-m", "tools.spec_tables", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
