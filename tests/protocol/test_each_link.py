"""What is peculiar to one link: a pty's opening and hang-up, a serial port's errors, UDP's strangers and refusals."""

from __future__ import annotations

import os
import select
import socket
import stat
import termios
import threading
import time
from pathlib import Path

import pytest

from protocol import frames as f
from protocol import link as link_module
from protocol.links import LinkClosed, LinkError, open_link
from protocol.links import serial as serial_module
from protocol.links import udp as udp_module
from protocol.links.inproc import pair
from protocol.links.udp import UdpBoard, UdpLab
from protocol.port import Port

HELLO = f.pack(f.Hello(1, f.ROLE_LAB, 0, f.LAYOUT_HASH, 1, 0, "test"), 0)
STOP = f.pack(f.Stop(0), 0)
TICK = f.pack(f.Tick(3), 0)


# -- pty --------------------------------------------------------------------------------------------------------------


def test_pty_waits_for_a_board_that_is_not_there_yet() -> None:
    with open_link("pty", listen=False) as lab:
        start = time.monotonic()
        assert lab.receive(0.05) == b""
        assert time.monotonic() - start >= 0.049


def take(link: link_module.Link, count: int) -> bytes:
    """`count` bytes, in as many pieces as a byte stream likes to give them."""
    data = b""
    while len(data) < count:
        piece = link.receive(5.0)
        assert piece, f"{len(data)} of {count} bytes came"
        data += piece
    return data


def test_pty_keeps_what_was_written_before_the_board_opened() -> None:
    data = bytes(range(256)) * 10
    with open_link("pty", listen=False) as lab:
        lab.send(data)
        with open_link(lab.url, listen=True) as board:
            assert take(board, len(data)) == data


def test_pty_delivers_the_last_words_before_the_hang_up() -> None:
    with open_link("pty", listen=False) as lab:
        board = open_link(lab.url, listen=True)
        board.send(b"last words")
        board.close()
        assert lab.receive(1.0) == b"last words"
        with pytest.raises(LinkClosed, match=r"pty /dev/pts/\d+: the other end is gone"):
            lab.receive(1.0)


def test_pty_board_may_come_back() -> None:
    with open_link("pty", listen=False) as lab:
        open_link(lab.url, listen=True).close()
        with open_link(lab.url, listen=True) as board:
            board.send(b"again")
            assert lab.receive(1.0) == b"again"


def test_pty_is_raw_at_both_ends() -> None:
    with open_link("pty", listen=False) as lab, open_link(lab.url, listen=True) as board:
        for end in (lab, board):
            iflag, oflag, _, lflag, *_ = termios.tcgetattr(end.fileno())
            assert not iflag & (termios.ICRNL | termios.IXON | termios.ISTRIP | termios.BRKINT)
            assert not oflag & termios.OPOST
            assert not lflag & (termios.ECHO | termios.ICANON | termios.ISIG | termios.IEXTEN)
            assert not os.get_blocking(end.fileno())


@pytest.mark.parametrize("direction", ["down", "up"])
def test_pty_takes_more_than_its_buffer_holds(direction: str) -> None:
    """A write that fits only in part is finished as the other end reads."""
    data = os.urandom(200_000)
    with open_link("pty", listen=False) as lab, open_link(lab.url, listen=True) as board:
        sender, receiver = (board, lab) if direction == "down" else (lab, board)
        writer = threading.Thread(target=sender.send, args=(data,))
        writer.start()
        got = b""
        while len(got) < len(data):
            piece = receiver.receive(2.0)
            assert piece
            got += piece
        writer.join()
        assert got == data


def test_a_reader_that_does_not_read_is_an_error_not_a_hang(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "WRITE_TIMEOUT_S", 0.1)
    with (
        open_link("pty", listen=False) as lab,
        open_link(lab.url, listen=True),
        pytest.raises(LinkError, match="does not read"),
    ):
        lab.send(bytes(100_000))


def test_pty_is_not_for_the_board() -> None:
    with pytest.raises(LinkError, match="the board opens what the laboratory prints"):
        open_link("pty", listen=True)


# -- serial -----------------------------------------------------------------------------------------------------------


def test_serial_says_which_port_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "ttyUSB9"
    with pytest.raises(LinkError, match=rf"^serial {path}: cannot open: No such file or directory$"):
        open_link(f"serial://{path}", listen=False)


def test_serial_refuses_what_is_no_port(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.touch()
    assert stat.S_ISREG(path.stat().st_mode)
    with pytest.raises(LinkError, match="cannot open") as caught:
        open_link(f"serial://{path}", listen=False)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("url", ["serial://", "serial:///dev/x?baud=", "serial:///dev/x?baud=fast", "serial:///d?b=1"])
def test_serial_url_is_checked(url: str) -> None:
    with pytest.raises(LinkError, match=r"expected serial:///dev/X\?baud=N"):
        open_link(url, listen=True)


def test_a_real_port_is_opened_exclusively_and_drained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through pyserial, as a real port is; a pty stands in for the UART. What lay in its buffer before is gone."""
    monkeypatch.setattr(serial_module, "_is_pty", lambda path: False)
    with open_link("pty", listen=False) as lab:
        path = lab.url.removeprefix("serial://")
        lab.send(b"from another time")
        url = f"serial://{path}?baud=57600"
        with open_link(url, listen=True) as board:
            assert isinstance(board, serial_module.SerialLink)
            assert (board.url, board.baud) == (url, 57600)
            assert board.receive(0.05) == b""
            lab.send(bytes(range(256)))
            assert take(board, 256) == bytes(range(256))
            board.send(bytes(range(256)))
            assert take(lab, 256) == bytes(range(256))
            with pytest.raises(LinkError, match=rf"^serial {path}: cannot open: another program has it open$"):
                open_link(url, listen=True)
            board.close()
            board.close()
        with pytest.raises(LinkClosed):
            lab.receive(1.0)


def test_unplugged_port_is_named() -> None:
    lab = open_link("pty", listen=False)
    path = lab.url.removeprefix("serial://")
    with open_link(lab.url, listen=True) as board:
        lab.close()
        with pytest.raises(LinkClosed, match=rf"^serial {path}: the other end is gone"):
            board.receive(1.0)
        with pytest.raises(LinkClosed, match=path):
            board.send(b"x")


# -- udp --------------------------------------------------------------------------------------------------------------


def session(board: UdpBoard) -> UdpLab:
    lab = UdpLab("127.0.0.1", board.port)
    lab.send(HELLO)
    assert board.receive(1.0) == HELLO
    return lab


def test_udp_busy_port_is_one_line() -> None:
    board = open_link("udp://127.0.0.1:0", listen=True)
    with board, pytest.raises(LinkError, match=rf"^{board.url}: cannot listen: the port is busy$"):
        open_link(board.url, listen=True)


@pytest.mark.parametrize("url", ["udp://", "udp://127.0.0.1", "udp://127.0.0.1:x", "udp://127.0.0.1:99999", "udp:5"])
def test_udp_url_is_checked(url: str) -> None:
    with pytest.raises(LinkError, match="expected udp://HOST:PORT"):
        open_link(url, listen=False)


def test_udp_refusal_is_nothing_received_until_the_board_has_spoken() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    with UdpLab("127.0.0.1", port) as lab:
        assert isinstance(lab, UdpLab)
        for _ in range(3):
            lab.send(HELLO)
            start = time.monotonic()
            assert lab.receive(0.05) == b""
            assert time.monotonic() - start >= 0.049
        assert lab.refused >= 3
        with UdpBoard("127.0.0.1", port) as board:
            lab.send(HELLO)
            assert board.receive(1.0) == HELLO
            board.send(TICK)
            assert lab.receive(1.0) == TICK
        lab.send(TICK)
        with pytest.raises(LinkClosed, match="the board is gone"):
            lab.receive(1.0)


def test_udp_board_counts_and_drops_strangers_while_its_peer_is_alive() -> None:
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board) as lab, UdpLab("127.0.0.1", board.port) as stranger:
            for data in (HELLO, TICK, b"garbage"):
                stranger.send(data)
            lab.send(TICK)
            assert board.receive(1.0) == TICK
            assert board.strangers == 3
            board.send(TICK)
            assert lab.receive(1.0) == TICK
            assert stranger.receive(0.02) == b""
            lab.send(STOP)
            assert board.receive(1.0) == STOP
            stranger.send(HELLO)
            assert board.receive(1.0) == HELLO
            board.send(TICK)
            assert stranger.receive(1.0) == TICK


def test_udp_board_gives_a_silent_peer_up_for_a_hello_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A laboratory that was killed says no STOP; the next one is served after PEER_SILENCE_S."""
    monkeypatch.setattr(udp_module, "PEER_SILENCE_S", 0.05)
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board), UdpLab("127.0.0.1", board.port) as second:
            select.select([], [], [], 0.06)
            second.send(TICK)
            assert board.receive(0.05) == b""
            second.send(HELLO)
            assert board.receive(1.0) == HELLO


def test_udp_board_without_a_session_answers_any_packet_but_no_garbage() -> None:
    """That is how a laboratory in the middle of a run learns that the board restarted."""
    with UdpBoard("127.0.0.1", 0) as board, UdpLab("127.0.0.1", board.port) as lab:  # type: ignore[attr-defined]
        assert isinstance(board, UdpBoard)
        board.send(TICK)
        assert board.unsent == 1
        lab.send(b"garbage, not a packet")
        lab.send(TICK)
        assert board.receive(1.0) == TICK
        assert board.strangers == 1
        board.send(HELLO)
        assert lab.receive(1.0) == HELLO


def test_udp_garbage_does_not_prolong_the_wait() -> None:
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board), UdpLab("127.0.0.1", board.port) as stranger:
            stop = threading.Event()

            def chatter() -> None:
                while not stop.wait(0.01):
                    stranger.send(b"garbage, not a packet")

            thread = threading.Thread(target=chatter)
            thread.start()
            assert board.receive(0.1) == b""  # the chatter does not prolong the wait for ever
            stop.set()
            thread.join()


def test_udp_a_flood_of_strangers_costs_the_session_no_frame() -> None:
    """Faster than anybody could read it, and more than any buffer holds: what the peer sends is all there."""
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board) as lab, UdpLab("127.0.0.1", board.port) as stranger:
            sent = 0
            for tick in range(100):
                for _ in range(200):
                    stranger.send(HELLO if sent % 2 else b"garbage" * 100)
                    sent += 1
                lab.send(f.pack(f.Tick(tick), tick))
            got = [f.unpack(board.receive(1.0)).tick for _ in range(100)]
            assert got == list(range(100))
            assert board.receive(0.0) == b""
            assert 0 < board.strangers <= sent  # the kernel drops what has no room, uncounted


def test_udp_a_flood_does_not_prolong_a_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even one of no time at all, with more to read each time one looks."""
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board), UdpLab("127.0.0.1", board.port) as stranger:
            take = board._take

            def one_more(sock: socket.socket) -> tuple[bytes, object]:
                stranger.send(b"garbage")
                return take(sock)

            monkeypatch.setattr(board, "_take", one_more)
            for timeout_s in (0.0, 0.05):
                stranger.send(b"garbage")
                start = time.monotonic()
                assert board.receive(timeout_s) == b""
                assert time.monotonic() - start < timeout_s + 0.5


def test_udp_a_second_board_on_the_port_is_refused_during_a_session_too() -> None:
    busy = pytest.raises(LinkError, match="the port is busy")
    with UdpBoard("127.0.0.1", 0) as board, session(board), busy:  # type: ignore[arg-type]
        open_link(board.url, listen=True)


def test_udp_the_same_laboratory_comes_again_on_the_same_socket() -> None:
    """STOP and HELLO in one go, as `sil doctor` and a test bench do."""
    with UdpBoard("127.0.0.1", 0) as board:
        assert isinstance(board, UdpBoard)
        with session(board) as lab:
            for data in (STOP, HELLO, TICK):
                lab.send(data)
            assert [board.receive(1.0) for _ in range(3)] == [STOP, HELLO, TICK]
            board.send(TICK)
            assert lab.receive(1.0) == TICK


# -- inproc -----------------------------------------------------------------------------------------------------------


def test_inproc_lets_the_board_run_when_the_laboratory_waits() -> None:
    lab, board = pair()
    lab_port, board_port = Port(lab), Port(board)

    def run_board() -> None:
        while (packet := board_port.receive(0.0)) is not None:
            board_port.send(f.Command(packet.tick, (1, 2, 3), 0, 0, f.USED))

    lab.pump = run_board
    lab_port.send(f.Tick(5))
    packet = lab_port.receive(1.0)
    assert packet is not None
    assert packet.frame == f.Command(5, (1, 2, 3), 0, 0, f.USED)
    assert lab_port.receive(0.0) is None


def test_inproc_is_bounded() -> None:
    lab, _ = pair()
    lab.send(bytes(1_000_000))
    with pytest.raises(LinkError, match="does not read"):
        lab.send(bytes(100_000))
