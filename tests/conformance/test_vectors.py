"""The Python codec against the vectors that the C codec will be held against, too; they are files, not code."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from cobs import cobs

from protocol import frames as f
from protocol.codec import StreamDecoder, encode

HERE = Path(__file__).parent
PACKETS = json.loads((HERE / "packets.json").read_text())
STREAMS = json.loads((HERE / "streams.json").read_text())


def by_name(case: Any) -> str:
    return str(case["name"])


def plain(frame: f.Frame) -> dict[str, Any]:
    """A frame's own fields as the vectors write them."""
    fields: dict[str, Any] = {
        key: list(value) if isinstance(value, tuple) else value for key, value in frame._asdict().items()
    }
    fields.pop("tick", None)
    if isinstance(frame, f.Hello):
        fields["nonce"] = f"{frame.nonce:016x}"
    if isinstance(frame, f.Sample):
        named = zip(("euler", "quaternion", "rate"), frame.readings, strict=True)
        fields["readings"] = {
            name: {"age_us": reading.age_us, "values": list(reading.values)} for name, reading in named if reading
        }
    return fields


def test_vectors_are_of_this_layout() -> None:
    assert PACKETS["layout_hash"] == STREAMS["layout_hash"] == f"{f.LAYOUT_HASH:08x}"


@pytest.mark.parametrize("case", PACKETS["valid"], ids=by_name)
def test_valid_packet(case: dict[str, Any]) -> None:
    packet = bytes.fromhex(case["packet"])
    got = f.unpack(packet)
    expected = dict(case["frame"])
    assert f.Type(got.type).name == expected.pop("type")
    assert got.sequence == expected.pop("sequence")
    assert got.tick == (f.NO_TICK if (tick := expected.pop("tick")) is None else tick)
    assert plain(got.frame) == expected
    assert f.pack(got.frame, got.sequence) == packet
    assert encode(packet) == bytes.fromhex(case["wire"])


@pytest.mark.parametrize("case", PACKETS["invalid"], ids=by_name)
def test_invalid_packet(case: dict[str, Any]) -> None:
    with pytest.raises(f.BadPacket) as caught:
        f.unpack(bytes.fromhex(case["packet"]))
    assert caught.value.reason == case["reason"]


def test_every_type_and_every_reason_has_a_vector() -> None:
    assert {case["frame"]["type"] for case in PACKETS["valid"]} == {type_.name for type_ in f.Type}
    reasons = {cls.reason for cls in f.BadPacket.__subclasses__()}
    assert {case["reason"] for case in PACKETS["invalid"]} == reasons


@pytest.mark.parametrize("case", STREAMS["cobs"], ids=lambda case: f"{len(case['decoded']) // 2} bytes")
def test_cobs(case: dict[str, str]) -> None:
    decoded, encoded = bytes.fromhex(case["decoded"]), bytes.fromhex(case["encoded"])
    assert cobs.encode(decoded) == encoded
    assert cobs.decode(encoded) == decoded


@pytest.mark.parametrize("encoded", STREAMS["bad"])
def test_bad_cobs(encoded: str) -> None:
    with pytest.raises(cobs.DecodeError):
        cobs.decode(bytes.fromhex(encoded))


@pytest.mark.parametrize("size", [1, 7, 100_000])
@pytest.mark.parametrize("case", STREAMS["streams"], ids=by_name)
def test_stream(case: dict[str, Any], size: int) -> None:
    data = bytes.fromhex(case["bytes"])
    decoder = StreamDecoder()
    got = [packet for at in range(0, len(data), size) for packet in decoder.feed(data[at : at + size])]
    assert [packet.hex() for packet in got] == case["packets"]
    assert asdict(decoder.counters) | {"pending": decoder.buffered} == case["counters"]


def test_vectors_are_in_step_with_the_code() -> None:
    """A difference is a change of the wire: on purpose, or a bug."""
    command = [sys.executable, "-m", "tools.make_vectors", "--check"]
    done = subprocess.run(command, cwd=HERE.parents[1], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
