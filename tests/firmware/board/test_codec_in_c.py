"""The C codec against the vectors that every implementation is held against, and against the Python one on noise."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from c_board import CBoard, decoded, sanitized, script_of
from c_board import Step as Datagram
from hostile import hostile_pieces

from protocol import frames
from protocol.codec import DatagramDecoder, StreamDecoder, encode

CONFORMANCE = Path(__file__).parents[2] / "conformance"
PACKETS = json.loads((CONFORMANCE / "packets.json").read_text())
STREAMS = json.loads((CONFORMANCE / "streams.json").read_text())
OK, TOO_SHORT, TOO_LONG, CRC, VERSION, TYPE, LENGTH, VALUE = range(8)  # packet_verdict of firmware/core/frames.h
REASONS = {
    "too_short": TOO_SHORT, "too_long": TOO_LONG, "crc": CRC, "version": VERSION, "type": TYPE, "length": LENGTH,
    "value": VALUE,
}  # fmt: skip
FRAMES = 200_000


def by_name(case: Any) -> str:
    return str(case["name"])


def verdict(packet: bytes) -> int:
    """What the Python codec says of a packet with a right CRC."""
    try:
        frames.unpack_checked(packet)
    except frames.BadPacket as bad:
        return REASONS[bad.reason]
    return OK


@pytest.mark.parametrize("case", PACKETS["valid"], ids=by_name)
def test_a_valid_packet_is_taken(c_board: CBoard, case: dict[str, Any]) -> None:
    packet = bytes.fromhex(case["packet"])
    assert c_board.check(packet) == OK
    assert c_board.decode(bytes.fromhex(case["wire"]), 1)[0] == [(OK, packet)]


@pytest.mark.parametrize("case", PACKETS["invalid"], ids=by_name)
def test_an_invalid_packet_is_refused_for_its_reason(c_board: CBoard, case: dict[str, Any]) -> None:
    assert c_board.check(bytes.fromhex(case["packet"])) == REASONS[case["reason"]]


@pytest.mark.parametrize("case", STREAMS["cobs"], ids=lambda case: f"{len(case['decoded']) // 2} bytes")
def test_cobs(c_board: CBoard, case: dict[str, str]) -> None:
    plain, encoded = bytes.fromhex(case["decoded"]), bytes.fromhex(case["encoded"])
    assert c_board.cobs_decode(encoded) == plain
    if len(plain) <= frames.MAX_PACKET:
        assert c_board.cobs_encode(plain) == encoded


@pytest.mark.parametrize("encoded", STREAMS["bad"])
def test_bad_cobs(c_board: CBoard, encoded: str) -> None:
    assert c_board.cobs_decode(bytes.fromhex(encoded)) is None


@pytest.mark.parametrize("size", [1, 7, 100_000])
@pytest.mark.parametrize("case", STREAMS["streams"], ids=by_name)
def test_stream(c_board: CBoard, case: dict[str, Any], size: int) -> None:
    packets, counters = c_board.decode(bytes.fromhex(case["bytes"]), size)
    assert [packet.hex() for _, packet in packets] == case["packets"]
    assert counters == case["counters"]


def test_hostile_streams_however_they_are_cut(c_board: CBoard, sanitized_program: Path) -> None:
    """Same packets, same verdict on each, same counters; and nothing that a sanitizer objects to."""
    data = b"".join(hostile_pieces(1, FRAMES))
    python = StreamDecoder()
    packets = [packet for at in range(0, len(data), 997) for packet in python.feed(data[at : at + 997])]
    counters = asdict(python.counters) | {"pending": python.buffered}
    expected = ([(verdict(packet), packet) for packet in packets], counters)
    assert {OK, VERSION, TYPE, LENGTH, VALUE} == {seen for seen, _ in expected[0]}
    assert all(count for name, count in counters.items() if name != "pending")
    for cut in (1, 61, len(data)):
        assert c_board.decode(data, cut) == expected
    assert decoded(sanitized(sanitized_program, "decode", 4093, data)) == expected


def test_hostile_datagrams(c_board: CBoard, sanitized_program: Path) -> None:
    datagrams = [piece.strip(b"\0") for piece in hostile_pieces(2, 20_000)]
    datagrams += [packet for _, packet in c_board.decode(b"".join(hostile_pieces(3, 20_000)), 100)[0]]
    python = DatagramDecoder()
    packets = [packet for datagram in datagrams for packet in python.feed(datagram)]
    expected = ([(verdict(packet), packet) for packet in packets], asdict(python.counters) | {"pending": 0})
    assert c_board.datagrams(datagrams) == expected
    script = script_of([Datagram(datagram) for datagram in datagrams])
    assert decoded(sanitized(sanitized_program, "datagrams", 0, script)) == expected


def test_what_the_board_encodes_a_decoder_reads(c_board: CBoard) -> None:
    """All zeros, no zeros, and the longest packet."""
    for packet in (bytes(250), bytes(range(1, 251)), b"\1" * 250, bytes(12)):
        assert c_board.cobs_encode(packet) == encode(packet)[1:-1]
