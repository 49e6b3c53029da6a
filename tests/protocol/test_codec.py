"""Codec: any cut of the bytes gives the same frames and counters; garbage costs itself and nothing else."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st
from wire_examples import ONE_OF_EACH, any_frame

from protocol import frames as f
from protocol.codec import MAX_ENCODED, DatagramDecoder, StreamDecoder, decoder_for, encode

PACKETS = [f.pack(frame, number) for number, frame in enumerate(ONE_OF_EACH)]

pieces = st.lists(
    st.one_of(
        st.sampled_from(PACKETS).map(encode),
        any_frame.map(lambda frame: encode(f.pack(frame, 0))),
        st.binary(max_size=40),
        st.integers(200, 700).map(lambda n: b"\x55" * n),
        st.just(b"\0"),
    ),
    max_size=12,
)


def decoded(chunks: list[bytes]) -> tuple[list[bytes], StreamDecoder]:
    decoder = StreamDecoder()
    out: list[bytes] = []
    for chunk in chunks:
        out += decoder.feed(chunk)
        assert decoder.buffered <= MAX_ENCODED
    return out, decoder


@given(pieces, st.lists(st.integers(0, 4000), max_size=30))
def test_any_cut_gives_the_same_frames_and_counters(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    whole, one = decoded([stream])
    cut, many = decoded([stream[a:b] for a, b in itertools.pairwise(edges)])
    bytewise, single = decoded([stream[i : i + 1] for i in range(len(stream))])
    assert whole == cut == bytewise
    assert one.counters == many.counters == single.counters


@given(pieces)
def test_every_byte_is_accounted_for(parts: list[bytes]) -> None:
    """Frames, delimiters, discarded bytes and what is still pending make up the stream."""
    stream = b"".join(parts)
    packets, decoder = decoded([stream])
    in_frames = sum(len(encode(packet)) - 2 for packet in packets)
    assert in_frames + stream.count(0) + decoder.counters.discarded_bytes + decoder.buffered == len(stream)


@given(st.lists(st.binary(max_size=600), max_size=8))
def test_garbage_never_raises_and_is_bounded(chunks: list[bytes]) -> None:
    packets, decoder = decoded(chunks)
    assert packets == []
    assert decoder.buffered <= MAX_ENCODED


@given(st.binary(max_size=600), st.sampled_from(PACKETS))
def test_back_in_step_at_the_next_delimiter(garbage: bytes, packet: bytes) -> None:
    assert decoded([garbage, encode(packet)])[0] == [packet]


def test_each_kind_of_refusal_has_its_counter() -> None:
    good = encode(PACKETS[0])
    damaged = bytearray(good)
    damaged[-4] ^= 0x10
    stream = [good, bytes(damaged), b"\0\5ab\0", b"\0" + b"\x7f" + b"a" * 30 + b"\0", b"\0" + b"\1" * 300 + b"\0", good]
    packets, decoder = decoded(stream)
    seen = decoder.counters
    assert packets == [PACKETS[0]] * 2
    assert (seen.frames, seen.crc_errors, seen.too_short, seen.cobs_errors, seen.too_long) == (2, 1, 1, 1, 1)
    assert seen.discarded_bytes == len(good) - 2 + 3 + 31 + 300


def test_tap_sees_the_encoded_bytes_and_the_reason() -> None:
    seen: list[tuple[bytes, str]] = []
    decoder = StreamDecoder(lambda encoded, reason: seen.append((encoded, reason)))
    good = encode(PACKETS[4])
    decoder.feed(good + good[1:-2] + b"\0" + b"\2" * 1000 + b"\0")
    assert seen == [(good[1:-1], ""), (good[1:-2], "cobs"), (b"\2" * (MAX_ENCODED + 1), "too_long")]


def test_reset_forgets_the_candidate() -> None:
    decoder = StreamDecoder()
    decoder.feed(b"\0abc")
    decoder.reset()
    assert decoder.buffered == 0
    assert decoder.feed(encode(PACKETS[0])) == [PACKETS[0]]


def test_datagrams_stand_alone() -> None:
    decoder = decoder_for(datagram=True)
    assert isinstance(decoder, DatagramDecoder)
    assert decoder.feed(PACKETS[1]) == [PACKETS[1]]
    for bad in (b"", PACKETS[1][:-1], b"short", b"x" * 251):
        assert decoder.feed(bad) == []
    seen = decoder.counters
    assert (seen.frames, seen.crc_errors, seen.too_short, seen.too_long, seen.empty) == (1, 1, 1, 1, 1)
    assert seen.discarded_bytes == len(PACKETS[1]) - 1 + 5 + 251
