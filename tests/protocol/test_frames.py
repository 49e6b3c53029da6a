"""Frames: what is packed is what is unpacked, every refusal has its class and sentence, layouts and tuples agree."""

from __future__ import annotations

import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wire_examples import ONE_OF_EACH, any_frame, u16

from protocol import frames as f
from protocol import layouts, refusals


def sealed(body: bytes) -> bytes:
    """Header and body with the CRC that fits."""
    start = 0 if body[1] == f.Type.HELLO else f.LAYOUT_HASH
    return body + struct.pack("<I", zlib.crc32(body, start))


@pytest.mark.parametrize("frame", ONE_OF_EACH, ids=lambda frame: type(frame).__name__)
def test_one_of_each_survives(frame: f.Frame) -> None:
    packet = f.pack(frame, 0xABCD)
    got = f.unpack(packet)
    assert got.frame == frame
    assert (got.version, got.sequence, got.raw) == (1, 0xABCD, packet)


@given(any_frame, u16)
def test_any_frame_survives_and_fits(frame: f.Frame, sequence: int) -> None:
    packet = f.pack(frame, sequence)
    assert f.MIN_PACKET <= len(packet) <= f.MAX_PACKET
    assert f.unpack(packet).frame == frame
    assert f.unpack(packet).sequence == sequence


@given(st.binary(max_size=300))
def test_garbage_is_refused_with_a_badpacket(data: bytes) -> None:
    with pytest.raises(f.BadPacket):
        f.unpack(data)


@given(any_frame, st.integers(0, 2**32), st.binary(min_size=1, max_size=3), st.integers(-3, 3))
def test_a_right_crc_over_anything_is_one_meaning_or_a_refusal(frame: f.Frame, at: int, new: bytes, cut: int) -> None:
    """Each accepted packet is exactly what pack() makes of its frame: no two packets mean the same."""
    body = bytearray(f.pack(frame, 1)[:-4])
    at %= len(body)
    body[at : at + len(new)] = new
    body = body[: len(body) + cut] if cut < 0 else body + bytes(cut)
    packet = sealed(bytes(body).ljust(8, b"\0"))
    try:
        got = f.unpack(packet)
    except f.BadPacket:
        return
    assert f.pack(got.frame, got.sequence) == packet


def test_layout_hash_separates_builds_but_not_their_hello() -> None:
    body = f.pack(f.Tick(5), 0)[:-4]
    with pytest.raises(refusals.BadCrc, match="another layout"):
        f.unpack(body + struct.pack("<I", zlib.crc32(body, f.LAYOUT_HASH ^ 1)))
    hello = f.pack(ONE_OF_EACH[7], 0)
    assert struct.unpack("<I", hello[-4:])[0] == zlib.crc32(hello[:-4])


def refused(body: bytes) -> f.BadPacket:
    with pytest.raises(f.BadPacket) as caught:
        f.unpack(sealed(body))
    return caught.value


def test_refusals_say_what_was_expected_and_what_came() -> None:
    tick = f.pack(f.Tick(5), 0)[:-4]
    assert str(refused(b"\2" + tick[1:])) == "packet: header version 2, expected 1"
    assert "type 0x77 is unknown" in str(refused(b"\1\x77" + tick[2:]))
    assert str(refused(tick + b"\0")) == "packet of type 0x83: 13 bytes, expected 12"
    assert "tick is 4294967295, expected a tick" in str(refused(tick[:4] + b"\xff" * 4))
    assert str(refusals.TooShort(3)) == "packet: 3 bytes, expected at least 12 (header and CRC)"
    stop = f.pack(f.Stop(0), 0)[:-4]
    assert "tick is 5, expected NO_TICK" in str(refused(stop[:4] + b"\5\0\0\0" + stop[8:]))
    assert "reserved is 1, expected 0" in str(refused(stop[:-2] + b"\1\0"))


@pytest.mark.parametrize(
    "frame",
    [
        f.Command(0, (2**31, 0, 0), 0, 0, f.USED),
        f.Command(0, (0, 0, 0), 0, 0, 6),
        f.Command(0, (0, 0), 0, 0, f.USED),  # type: ignore[arg-type]
        f.Config(0, 1, 0, tuple(range(58))),
        f.Telemetry(0, 1, 1, tuple(range(59))),
        f.Hello(1, 0, 0, 0, 0, 0, "x" * 25),
        f.Hello(1, 0, 0, 0, 0, 0, "µ"),
        f.Sample(0, (0, 0, 0), (0, 0, 0), (0, 0, 0), 0, 0, 0, 1, (None, None, None)),
    ],
    ids=str,
)
def test_what_does_not_fit_is_not_packed(frame: f.Frame) -> None:
    with pytest.raises(refusals.CannotPack, match="cannot pack"):
        f.pack(frame, 0)


def test_tuples_have_the_fields_of_their_layouts() -> None:
    """A field added to one table and forgotten in the other is found here."""
    renamed = {"transit_us": "transit", "busy_ns": "busy", "stack_bytes": "stack", "discarded_bytes": "discarded"}
    for layout in layouts.LAYOUTS:
        cls = getattr(f, layout.type.name.capitalize())
        names = [renamed.get(name, name) for name in cls._fields if name not in ("tick", "words", "readings")]
        assert names == [x.name for x in layout.fields if x.name not in ("reserved", "present")]
        assert ("tick" in cls._fields) == layout.ticked
        housekeeping = layout.type.name in ("HELLO", "READY", "TICK", "TIMING", "STOP")
        assert f.is_housekeeping(layout.type) == housekeeping


def test_sizes_that_spec_promises() -> None:
    sizes = {type(frame).__name__: len(f.pack(frame, 0)) for frame in ONE_OF_EACH}
    assert sizes["Command"] == 28
    assert sizes["Event"] == 24
    assert sizes["Hello"] == 56
    assert (f.MAX_CONFIG_WORDS, f.MAX_TELEMETRY_WORDS) == (57, 58)


@given(first=st.integers(0, 0xFFFF), count=st.integers(0, 18), random=st.randoms())
def test_packets_of_an_answer_come_into_their_order_over_the_end_of_the_numbers(first, count, random):
    """COMMAND(32767) may be number 65535 and its TELEMETRY number 0."""
    answer = [f.pack(f.Event(32767, 1, 2, 3), (first + i) % 2**16) for i in range(count)]
    shuffled = list(answer)
    random.shuffle(shuffled)
    assert f.in_sequence(shuffled) == answer
