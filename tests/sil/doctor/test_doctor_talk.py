"""The doctor's conversation: what it sends, what it counts, how it stays bounded, and what bytes look like to it."""

from __future__ import annotations

import random
import time

import pytest
from fake_machine import character_device
from far_ends import echo_of
from hypothesis import given
from hypothesis import strategies as st

from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.frames import Type
from protocol.link import Link, LinkError
from sil.doctor import NOTE, OK, PROBLEM, overheard, talk, verdicts
from sil.doctor import link as link_module
from sil.doctor.device import Device
from sil.doctor.overheard import Overheard, guess, rows
from sil.doctor.talk import RoundTrips, Talk


class Scripted(Link):
    """A byte stream whose other end answers the n-th HELLO with answer(n, hello): bytes, or None to answer late."""

    def __init__(
        self, flood: bytes = b"", lost: frozenset[int] = frozenset(), late: frozenset[int] = frozenset()
    ) -> None:
        self.sent: list[frames.Packet] = []
        self._decoder = StreamDecoder()
        self._flood, self._lost, self._late = flood, lost, late
        self._inbox = self._held = b""
        self._hellos = self._answers = 0
        self.closed = False

    @classmethod
    def open(cls, url: str, listen: bool) -> Link:
        raise LinkError("scripted")

    @classmethod
    def pair(cls) -> tuple[Link, Link]:
        raise LinkError("scripted")

    def send(self, data: bytes) -> None:
        for raw in self._decoder.feed(data):
            packet = frames.unpack(raw)
            self.sent.append(packet)
            if packet.type != Type.HELLO:
                continue
            number, self._hellos = self._hellos, self._hellos + 1
            answer = encode(frames.pack(echo_of(packet.frame), self._answers))
            self._answers += 1
            if number in self._late:
                self._held += answer
            elif number not in self._lost:
                self._inbox += answer

    def receive(self, timeout_s: float | None) -> bytes:
        if self._flood:
            return self._flood
        if not self._inbox:
            time.sleep(timeout_s or 0.0)
            self._inbox, self._held, now = self._held, b"", self._inbox
        else:
            now, self._inbox = self._inbox, b""
        return now

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self.closed = True


def silent(text: str) -> None:
    """Progress that nobody watches."""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(talk, "ANSWER_S", 0.02)
    monkeypatch.setattr(talk, "QUIET_S", 0.001)
    monkeypatch.setattr(talk, "HELLO_EVERY_S", 0.02)


# -- the conversation -------------------------------------------------------------------------------------------------


def test_one_nonce_all_along_and_stop_at_the_end() -> None:
    """So the board is reset once, answers the rest without doing anything, and is left without a session."""
    link = Scripted()
    conversation = Talk(link, None)
    assert conversation.greet(1.0, silent) is not None
    trips = conversation.round_trips(50, silent)
    conversation.close()
    assert (len(trips.times_ns), trips.lost, trips.stopped) == (50, 0, "")
    assert {packet.frame.nonce for packet in link.sent[:-1]} == {link.sent[0].frame.nonce}
    assert link.sent[0].frame.clock_rate_q16 == 0
    assert [packet.type for packet in link.sent].count(Type.STOP) == 1
    assert link.sent[-1].type == Type.STOP
    assert link.closed


def test_stop_is_said_even_if_nobody_answered_but_not_if_nothing_was_asked() -> None:
    """An echo may be lost on a line that works one way only."""
    asked = Scripted(lost=frozenset(range(1000)))
    conversation = Talk(asked, None)
    assert conversation.greet(0.05, silent) is None
    conversation.close()
    assert asked.sent[-1].type == Type.STOP
    unasked = Scripted()
    conversation = Talk(unasked, None)
    conversation.listen(0.01)
    conversation.close()
    assert unasked.sent == []


def test_lost_answers_are_counted_and_the_rest_is_measured() -> None:
    conversation = Talk(Scripted(lost=frozenset((5, 11))), None)
    assert conversation.greet(1.0, silent) is not None
    trips = conversation.round_trips(20, silent)
    assert (len(trips.times_ns), trips.lost) == (18, 2)


def test_a_late_echo_is_not_taken_for_the_next_one() -> None:
    """All echoes look alike; one taken for the next would make every time after it too short."""
    conversation = Talk(Scripted(late=frozenset((5,))), None)
    assert conversation.greet(1.0, silent) is not None
    trips = conversation.round_trips(20, silent)
    assert (len(trips.times_ns), trips.lost) == (19, 1)
    assert conversation.types == {}
    assert conversation.port.counters.received == 21


def test_a_board_that_falls_silent_ends_it() -> None:
    conversation = Talk(Scripted(lost=frozenset(range(10, 10_000))), None)
    assert conversation.greet(1.0, silent) is not None
    trips = conversation.round_trips(1000, silent)
    assert trips.stopped == "5 in a row were not answered"
    assert (len(trips.times_ns), trips.lost) == (9, 5)


def test_a_slow_link_ends_it_with_what_there_is() -> None:
    conversation = Talk(Scripted(), None)
    assert conversation.greet(1.0, silent) is not None
    trips = conversation.round_trips(1_000_000, silent, longest_s=0.01)
    assert trips.stopped == "0.01 s are over"
    assert trips.times_ns


def test_who_babbles_without_a_pause_does_not_hold_us_up() -> None:
    """A port reads on for as long as bytes are there and none is a frame."""
    conversation = Talk(Scripted(flood=b"never a pause. "), None)
    assert conversation.greet(0.05, silent) is None
    assert conversation.heard.count > 1000
    assert len(conversation.heard.kept) == overheard.KEEP_BYTES


def test_wire_time_of_an_exchange() -> None:
    """HELLO is 56 bytes, COBS adds one and two delimiters: 59 each way, ten bits a byte."""
    conversation = Talk(Scripted(), 115200)
    assert conversation.exchange_bytes == 118
    assert conversation.wire_ns == 10_243_056


def test_try_bauds_finds_the_one_that_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Scripted] = []

    def open_link(url: str, listen: bool) -> Link:
        nobody = frozenset(range(1000))
        console = b"login: " * 40 if url.endswith("=9600") else b""
        opened.append(Scripted(console, lost=frozenset() if url.endswith("=57600") else nobody))
        return opened[-1]

    monkeypatch.setattr(link_module, "open_link", open_link)
    monkeypatch.setattr(link_module, "TRY_BAUD_S", 0.03)
    port = Device("/dev/ttyUSB0", "/dev/ttyUSB0", character_device())
    found = link_module.try_bauds("/dev/ttyUSB0", port, silent)
    assert found.found == "a board answers at 57600 baud"
    assert found.commands == ("sil doctor --link 'serial:///dev/ttyUSB0?baud=57600'",)
    assert all(one.closed for one in opened)
    monkeypatch.setattr(link_module, "USUAL_BAUDS", (9600, 19200))
    found = link_module.try_bauds("/dev/ttyUSB0", port, silent)
    assert found.found == "no board answers at 9600, 19200; what came: 9600: text"


# -- verdicts ---------------------------------------------------------------------------------------------------------


def measured(times_us: list[float], baud: int | None = None, **more: object) -> verdicts.Finding:
    trips = RoundTrips(len(times_us), [round(t * 1000) for t in times_us], **more)  # type: ignore[arg-type]
    return verdicts.round_trips(Talk(Scripted(), baud), trips, baud)


def test_percentiles_and_histogram() -> None:
    found = measured([float(n) for n in range(1, 1001)])
    assert found.status == OK
    assert found.found == "1000 of 1000: p50 500, p99 990, p99.9 999, max 1000 us"
    assert sum(found.data["histogram"]["counts"]) == 1000
    assert len(found.data["histogram"]["edges_us"]) == len(found.data["histogram"]["counts"]) + 1


def test_share_of_the_wire() -> None:
    found = measured([11_000.0] * 10, 115200)
    assert found.status == OK
    assert "118 bytes at 115200 baud are 10.24 ms, 93% of the median; the rest is 0.76 ms" in found.lines[-1]


def test_much_more_than_the_wire_takes_is_a_note() -> None:
    found = measured([26_000.0] * 10, 115200)
    assert found.status == NOTE
    assert "latency timer" in found.advice


def test_lost_answers_are_a_problem() -> None:
    found = measured([100.0] * 9, lost=1)
    assert found.status == PROBLEM
    assert "1 not answered" in found.found
    assert verdicts.round_trips(Talk(Scripted(), None), RoundTrips(5, [], 5), None).status == PROBLEM


@given(st.lists(st.integers(1, 10**10), min_size=1, max_size=200))
def test_a_histogram_counts_everything_once(times_ns: list[int]) -> None:
    import numpy as np

    counts, edges = verdicts.histogram(np.array(times_ns) / 1000.0)
    assert sum(counts) == len(times_ns)
    assert edges == sorted(edges)
    drawn = verdicts.bars(counts)
    assert [mark == " " for mark in drawn] == [count == 0 for count in counts]


def test_errors_while_we_measured() -> None:
    class Breaks(Scripted):
        def receive(self, timeout_s: float | None) -> bytes:
            return super().receive(timeout_s) + encode(frames.pack(frames.Tick(3), 0)[:-1] + b"\xff")

    conversation = Talk(Breaks(), None)
    before = conversation.port.counters
    conversation.round_trips(3, silent)
    found = verdicts.errors(conversation, before, None, None)
    assert found.status == PROBLEM
    assert "crc errors" in found.found
    assert found.data["line"] is None


def test_what_a_uart_counted_before_we_came_is_not_ours() -> None:
    conversation = Talk(Scripted(), None)
    counters = conversation.port.counters
    old = verdicts.LineErrors(framing=100, overrun=2, parity=0, breaks=1, buffer_overrun=0)
    same = verdicts.errors(conversation, counters, old, old)
    assert (same.status, same.data["line"]["framing"]) == (OK, 0)
    more = verdicts.errors(conversation, counters, old, old._replace(framing=103, overrun=3))
    assert more.status == PROBLEM
    assert "framing 3, overrun 1" in more.found


# -- what bytes look like ---------------------------------------------------------------------------------------------


def parity_even(text: bytes) -> bytes:
    return bytes(byte | (bin(byte).count("1") & 1) << 7 for byte in text)


NOISE = random.Random(1)


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"", "few"),
        (b"\x00\xff\x13", "few"),
        (b"[    1.234] usb 1-1: new device\r\nlogin: ", "text"),
        (bytes(200), "break"),
        (parity_even(b"Hello, this is a console with seven data bits. " * 3), "parity"),
        (bytes(NOISE.choices([0x00, 0x80, 0xF8, 0xFE, 0xE0, 0x1C, 0x66], k=300)), "baud"),
        (NOISE.randbytes(500), "binary"),
    ],
)
def test_guess(data: bytes, kind: str) -> None:
    assert guess(data).kind == kind


@given(st.binary(max_size=300))
def test_any_bytes_are_guessed_and_shown_without_control_characters(data: bytes) -> None:
    seen = guess(data)
    assert seen.found
    assert seen.advice
    assert all(row.isprintable() for row in rows(data))
    assert len(rows(data)) == min(4, -(-len(data) // 16))


def test_rows() -> None:
    assert rows(b"Hello\r\n\x00 world of bytes")[0] == (
        "0000  48 65 6c 6c 6f 0d 0a 00 20 77 6f 72 6c 64 20 6f  |Hello... world o|"
    )


@given(st.lists(st.binary(max_size=3000), max_size=8))
def test_what_is_overheard_is_bounded_and_handed_on_whole(pieces: list[bytes]) -> None:
    waiting = list(pieces)

    class Pieces(Scripted):
        def receive(self, timeout_s: float | None) -> bytes:
            return waiting.pop(0)

    link = Overheard(Pieces())
    assert [link.receive(0.0) for _ in pieces] == pieces
    whole = b"".join(pieces)
    assert (bytes(link.kept), link.count) == (whole[: overheard.KEEP_BYTES], len(whole))
