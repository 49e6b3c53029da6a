"""What every registered link must do; a new line in LINKS is tested unasked, a forgotten line is found."""

from __future__ import annotations

import pkgutil
import re
import threading
import time
from collections.abc import Iterator

import pytest

import protocol.links
from protocol import frames as f
from protocol.links import LINKS, Link, LinkClosed, LinkError, link_class, open_link
from protocol.port import Port

SOON_S = 2.0
ZERO3 = (0, 0, 0)
HELLO = f.Hello(f.PROTOCOL_VERSION, f.ROLE_LAB, 0, f.LAYOUT_HASH, 1, 0, "test")
SAMPLE = f.Sample(3, (1, 2, 3), ZERO3, ZERO3, f.NO_TICK, 0, f.ZERO, 1, (f.Reading(5, (7, 8, 9)), None, None))
ANSWER = (f.Command(3, (-1, -2, -3), 0, 2, f.USED), f.Telemetry(3, 1, 1, tuple(range(58))), f.Event(3, 1, 2, 3))

Ends = tuple[Link, Link]


@pytest.fixture(params=sorted(LINKS))
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    """(laboratory, board), acquainted: the laboratory has said HELLO and was answered, as in every session."""
    lab, board = link_class(request.param).pair()
    Port(lab).send(HELLO)
    packet = Port(board).receive(SOON_S)
    assert packet is not None and packet.frame == HELLO
    Port(board).send(HELLO)
    assert Port(lab).receive(SOON_S) is not None
    yield lab, board
    lab.close()
    board.close()


def read_exactly(link: Link, count: int) -> bytes:
    data = b""
    give_up = time.monotonic() + SOON_S
    while len(data) < count and time.monotonic() < give_up:
        data += link.receive(0.05)
    return data


def knock(link: Link) -> None:
    """Twenty datagrams' worth of looking for the other end."""
    for _ in range(20):
        link.send(bytes(20))
        link.receive(0.05)


def test_every_file_in_the_folder_is_registered() -> None:
    files = {module.name for module in pkgutil.iter_modules(protocol.links.__path__)}
    assert files == {target.partition(":")[0].rpartition(".")[2] for target in LINKS.values()}


def test_an_unknown_link_is_refused_with_the_known_ones() -> None:
    known = "expected one of inproc, pty, serial, udp, or a port such as /dev/ttyUSB0"
    with pytest.raises(LinkError, match=f"{known}, got 'can'"):
        open_link("can://0", listen=False)


def test_the_path_of_a_port_is_a_link() -> None:
    with pytest.raises(LinkError, match="serial /dev/no-such-port: cannot open"):
        open_link("/dev/no-such-port", listen=False)


@pytest.mark.parametrize("name", sorted(LINKS))
@pytest.mark.parametrize("listen", [True, False])
def test_a_malformed_url_is_one_line(name: str, listen: bool) -> None:
    with pytest.raises(LinkError) as caught:
        open_link(f"{name}:/no such/thing?x", listen)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


class TestBackToBack:
    """Two ends of one link on one machine."""

    def test_every_byte_value_passes_both_ways_in_order(self, ends: Ends) -> None:
        data = bytes(range(256)) + bytes(range(255, -1, -1))
        for sender, receiver in (ends, ends[::-1]):
            for start in range(0, len(data), 64):
                sender.send(data[start : start + 64])
            assert read_exactly(receiver, len(data)) == data

    def test_frames_pass_both_ways(self, ends: Ends) -> None:
        lab, board = (Port(end) for end in ends)
        for tick in range(200):
            lab.send(SAMPLE._replace(tick=tick))
            got = board.receive(SOON_S)
            assert got is not None and got.frame.tick == tick
            sent = board.send(*ANSWER)
            for packet in sent:
                got = lab.receive(SOON_S)
                assert got is not None and got.raw == packet
        assert (lab.counters.discarded_bytes, lab.counters.sequence_gaps, lab.counters.duplicates) == (0, 0, 0)

    def test_a_burst_is_kept_until_it_is_read(self, ends: Ends) -> None:
        lab, board = (Port(end) for end in ends)
        for tick in range(40):
            lab.send(SAMPLE._replace(tick=tick))
        ticks = [packet.tick for packet in iter(lambda: board.receive(0.1), None)]
        assert ticks == list(range(40))

    def test_datagrams_keep_their_boundaries(self, ends: Ends) -> None:
        lab, board = ends
        if not lab.datagram:
            pytest.skip("a byte stream has none")
        for size in (12, 250, 13):
            lab.send(bytes(size))
        assert [len(board.receive(SOON_S)) for _ in range(3)] == [12, 250, 13]

    def test_nothing_comes_after_the_timeout_and_waiting_costs_nothing(self, ends: Ends) -> None:
        for end in ends:
            for timeout_s in (0.0, 0.003, 0.1):
                wall, cpu = time.monotonic(), time.process_time()
                assert end.receive(timeout_s) == b""
                wall, cpu = time.monotonic() - wall, time.process_time() - cpu
                assert cpu < 0.1  # it sleeps, it does not spin (process time, not the wall's)
                if end.fileno() >= 0:
                    assert wall >= timeout_s - 0.001

    def test_data_ends_the_wait(self, ends: Ends) -> None:
        lab, board = ends
        if board.fileno() < 0:
            pytest.skip("one process, nobody to wait for")
        timer = threading.Timer(0.05, lab.send, (bytes(20),))
        timer.start()
        assert board.receive(30.0) == bytes(20)
        timer.join()

    def test_closing_twice_is_as_good_as_once_and_using_it_is_an_error(self, ends: Ends) -> None:
        for end in ends:
            end.close()
            end.close()
            with pytest.raises(LinkClosed):
                end.receive(0.0)
            with pytest.raises(LinkError):
                end.send(bytes(20))

    def test_the_laboratory_learns_that_the_board_is_gone(self, ends: Ends) -> None:
        """At once, or (a datagram link) with the answer to what it sends next; one line that names the link."""
        lab, board = ends
        board.send(b"last words")
        assert read_exactly(lab, 10) == b"last words"
        board.close()
        with pytest.raises(LinkClosed) as caught:
            knock(lab)
        assert re.match(r"\S+.*gone|\S+.*closed", str(caught.value))
        assert "\n" not in str(caught.value)

    def test_the_board_survives_or_learns_that_the_laboratory_is_gone(self, ends: Ends) -> None:
        lab, board = ends
        lab.close()
        try:
            for _ in range(3):
                board.receive(0.01)
                board.send(bytes(20))
        except LinkClosed:
            return
        assert board.datagram, "a byte stream reports the hang-up"
