"""Port: numbering per class, gaps and duplicates counted, the tap, one write per answer, time kept under garbage."""

from __future__ import annotations

import time
import zlib

import pytest

from protocol import frames as f
from protocol.codec import encode
from protocol.link import Link
from protocol.links.inproc import InprocLink, pair
from protocol.port import Port

COMMAND = f.Command(3, (1, 2, 3), 0, 1, f.USED)
EVENT = f.Event(3, 1, 2, 3)


class Script(Link):
    """A link that plays back what it is given and remembers what was sent."""

    def __init__(self, *chunks: bytes, datagram: bool = False) -> None:
        self.chunks, self.sent, self.datagram = list(chunks), list[bytes](), datagram

    @classmethod
    def open(cls, url: str, listen: bool) -> Link:
        return cls()

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        return cls(), cls()

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def receive(self, timeout_s: float | None) -> bytes:
        return self.chunks.pop(0) if self.chunks else b""

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self.chunks.clear()


def test_sequences_count_per_class() -> None:
    port = Port(Script())
    packets = port.send(COMMAND, EVENT, f.Stop(0), EVENT, f.Tick(1))
    assert [f.unpack(packet).sequence for packet in packets] == [0, 1, 0, 2, 1]
    port.reset()
    assert [f.unpack(packet).sequence for packet in port.send(COMMAND, f.Tick(1))] == [0, 2]


def test_sequences_wrap() -> None:
    lab, board = pair()
    sender, receiver = Port(lab), Port(board)
    for number in range(0x10003):
        packet = sender.pack(EVENT)
        if number > 0xFFFC:
            sender.write(packet)
    got = [packet.sequence for packet in iter(lambda: receiver.receive(0.0), None)]
    assert got == [0xFFFD, 0xFFFE, 0xFFFF, 0, 1, 2]
    assert (receiver.counters.duplicates, receiver.counters.sequence_gaps) == (0, 0)


def test_one_write_per_answer_and_one_datagram_per_frame() -> None:
    stream, datagrams = Script(), Script(datagram=True)
    packets = Port(stream).send(COMMAND, EVENT)
    assert stream.sent == [b"".join(encode(packet) for packet in packets)]
    assert Port(datagrams).send(COMMAND, EVENT) == tuple(datagrams.sent)
    Port(stream).send()
    assert len(stream.sent) == 1


def test_gaps_and_duplicates_are_counted_and_delivered() -> None:
    chunks = [encode(f.pack(EVENT, number)) for number in (0, 1, 4, 4, 3, 5)]
    port = Port(Script(*chunks))
    port.reset()
    assert len([*iter(lambda: port.receive(0.0), None)]) == 6
    assert (port.counters.sequence_gaps, port.counters.duplicates, port.counters.received) == (2, 2, 6)


def test_a_right_crc_over_an_unknown_type_is_counted_as_unknown() -> None:
    packet = bytearray(f.pack(f.Tick(1), 0)[:-4])
    packet[1] = 0x70
    sealed = bytes(packet) + zlib.crc32(packet, f.LAYOUT_HASH).to_bytes(4, "little")
    port = Port(Script(encode(sealed) + encode(f.pack(COMMAND, 0))))
    got = port.receive(0.0)
    assert got is not None and got.frame == COMMAND
    assert port.counters.unknown == 1


def test_tap_sees_every_frame_both_ways() -> None:
    seen: list[tuple[str, bytes]] = []
    lab, board = pair()
    one = Port(lab, tap=lambda direction, packet: seen.append((direction, packet)))
    two = Port(board)
    sent = one.send(COMMAND, EVENT)
    (answer,) = two.send(f.Tick(9))
    assert one.receive(0.0) is not None
    assert seen == [("tx", sent[0]), ("tx", sent[1]), ("rx", answer)]


def test_candidates_see_what_was_thrown_away() -> None:
    seen: list[tuple[bytes, str]] = []
    damaged = bytearray(encode(f.pack(COMMAND, 0)))
    damaged[-3] ^= 1
    port = Port(Script(bytes(damaged)), candidates=lambda encoded, reason: seen.append((encoded, reason)))
    assert port.receive(0.0) is None
    assert seen == [(bytes(damaged[1:-1]), "crc")]
    assert (port.counters.crc_errors, port.counters.discarded_bytes) == (1, len(damaged) - 2)


def test_garbage_does_not_prolong_the_wait() -> None:
    class Chatter(Script):
        def receive(self, timeout_s: float | None) -> bytes:
            assert timeout_s is not None
            if timeout_s <= 0.0:
                return b""
            time.sleep(0.005)
            return b"\0garbage\0"

    port = Port(Chatter())
    start = time.monotonic()
    assert port.receive(0.05) is None
    assert time.monotonic() - start > 0.045


@pytest.mark.parametrize("timeout_s", [0.0, 0.01])
def test_a_flood_of_garbage_ends_a_wait_all_the_same(timeout_s: float) -> None:
    class Flood(Script):
        reads = 0

        def receive(self, timeout_s: float | None) -> bytes:
            self.reads += 1
            assert self.reads < 10**6, "it never ends"
            return b"\0garbage\0"

    assert Port(Flood()).receive(timeout_s) is None


def test_some_garbage_before_a_frame_costs_a_drain_nothing() -> None:
    port = Port(Script(b"\0garbage\0", b"\0more\0", encode(f.pack(EVENT, 0))))
    packet = port.receive(0.0)
    assert packet is not None and packet.frame == EVENT


def test_reset_forgets_queued_frames_but_not_a_candidate_under_way() -> None:
    first, second = encode(f.pack(COMMAND, 0)), encode(f.pack(EVENT, 0))
    port = Port(Script(first + first + second[:10], second[10:]))
    assert port.receive(0.0) is not None
    port.reset()
    got = port.receive(0.0)
    assert got is not None and got.frame == EVENT


def test_port_passes_its_link_on() -> None:
    lab, _ = InprocLink.pair()
    port = Port(lab)
    assert port.fileno() == -1
    port.close()
    assert lab._closed
