"""Target `stream`: any bytes through the Python decoders and unpack(): a frame or a BadPacket, whatever the cut."""

from __future__ import annotations

from dataclasses import asdict
from random import Random

from protocol import frames
from protocol.codec import MAX_ENCODED, DatagramDecoder, StreamDecoder, encode
from tools.fuzz import expect, expect_lines, with_board_tests
from tools.fuzz.mutation import mutated
from tools.fuzz.session import with_crc


class Stream:
    """Input: how the stream is cut (u8), then the stream."""

    about = "Python: any bytes through the decoders and unpack"

    def __init__(self) -> None:
        with_board_tests()
        from hostile import hostile_pieces

        self._pieces = hostile_pieces(7, 400)

    def seeds(self) -> list[bytes]:
        return [bytes([cut]) + b"".join(self._pieces[at : at + 6]) for cut, at in enumerate(range(0, 240, 6))]

    def mutate(self, data: bytes, random: Random) -> bytes:
        """Bytes of the stream, or a field of one packet, whose CRC is right again afterwards."""
        if random.random() < 0.4:
            return mutated(data, random, self._pieces)
        candidates = data[1:].split(b"\0")
        at = random.randrange(len(candidates))
        packets = StreamDecoder().feed(b"\0" + candidates[at] + b"\0")
        body = packets[0][:-4] if packets else random.choice(self._pieces)
        candidates[at] = encode(with_crc(mutated(body, random)[:246].ljust(8, b"\0")))[1:-1]
        return data[:1] + b"\0".join(candidates)

    def check(self, data: bytes) -> None:
        if not data:
            return
        cut, stream = max(data[0], 1), data[1:]
        packets, seen = _decoded([stream])
        in_pieces = _decoded([stream[at : at + cut] for at in range(0, len(stream), cut)])
        expect((packets, seen) == in_pieces, f"cut by {cut}: {in_pieces}, whole: {packets, seen}")
        for packet in packets:
            frames_again(packet)
        datagrams = DatagramDecoder()
        for piece in (stream, with_crc(stream) if len(stream) > 1 else b""):
            for packet in datagrams.feed(piece):
                frames_again(packet)
            try:
                frames.unpack(piece)
            except frames.BadPacket as bad:
                expect_lines(bad)


def frames_again(packet: bytes) -> None:
    """What unpack() takes, pack() gives back."""
    try:
        found = frames.unpack_checked(packet)
    except frames.BadPacket:
        return
    expect(frames.pack(found.frame, found.sequence) == packet, f"packed again it is another packet: {found}")


def _decoded(pieces: list[bytes]) -> tuple[list[bytes], dict[str, int]]:
    decoder = StreamDecoder()
    packets: list[bytes] = []
    for piece in pieces:
        packets += decoder.feed(piece)
        expect(decoder.buffered <= MAX_ENCODED, f"{decoder.buffered} bytes kept")
    return packets, asdict(decoder.counters) | {"buffered": decoder.buffered}
