"""`sil doctor --link` and every kind of far end, over real ptys and sockets: the verdict, and what is left behind."""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from far_ends import FakeBoard, babble, echo, far_end, nobody

from protocol import frames
from protocol.codec import encode
from protocol.frames import Command
from protocol.link import Link, LinkError
from protocol.links import open_link
from protocol.links import serial as serial_module
from sil.doctor import NOTE, OK, PROBLEM, Finding, device, link
from sil.doctor.link import Examination, examine_link

CONSOLE = b"[    1.234567] usb 1-1: new full-speed USB device\r\nlogin: "


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "LISTEN_S", 0.1)


def examined(url: str, hello_within_s: float = 0.25, **options: object) -> dict[str, Finding]:
    """The findings by check."""
    order = Examination(url, round_trips=30, hello_within_s=hello_within_s, **options)  # type: ignore[arg-type]
    return {finding.check: finding for finding in examine_link(order, lambda text: None)}


def eventually(holds: Callable[[], bool]) -> None:
    """The other thread reads what was sent to it when it comes to it."""
    give_up = time.monotonic() + 10
    while not holds() and time.monotonic() < give_up:
        time.sleep(0.005)
    assert holds()


# -- a board ----------------------------------------------------------------------------------------------------------


def test_a_board_is_named_measured_and_left_without_a_session() -> None:
    board = FakeBoard()
    with far_end(board) as path:
        found = examined(path, 5.0)
        eventually(lambda: board.stopped)
    assert {finding.status for finding in found.values()} == {OK}
    assert list(found) == ["device", "permission", "openers", "driver", "board", "round trips", "errors"]
    assert found["board"].data["build"] == "fake board 7"
    assert found["round trips"].data["answered"] == 30


def test_a_board_with_other_layouts_is_told_from_a_silent_one() -> None:
    """HELLO gets through between builds whose other frames do not."""
    with far_end(FakeBoard(layout_hash=0xDEADBEEF)) as path:
        found = examined(path, 5.0)
    assert found["board"].status == PROBLEM
    assert f"layout deadbeef, own timer; expected protocol 1, layout {frames.LAYOUT_HASH:08x}" in found["board"].found
    assert found["round trips"].status == OK


def test_a_board_in_the_middle_of_a_session_and_garbage_before_it() -> None:
    boot = CONSOLE * 6 + b"\0" + encode(frames.pack(Command(7, (0, 0, 0), 0, 0, 1), 0))
    with far_end(FakeBoard(boot=boot)) as path:
        found = examined(path, 5.0)
    assert found["unasked"].status == NOTE
    assert "1 COMMAND" in found["unasked"].found
    assert found["undecoded"].status == NOTE
    assert found["undecoded"].data["kind"] == "text"
    assert found["round trips"].status == OK


def test_udp_board() -> None:
    board = FakeBoard()
    with far_end(board, open_link("udp://127.0.0.1:0", listen=True)) as url:
        found = examined(url, 5.0)
        eventually(lambda: board.stopped)
    assert list(found) == ["board", "round trips", "errors"]
    assert found["board"].status == OK


def test_a_board_process_of_this_installation_to_compare_with() -> None:
    found = examined("pty", 30.0)
    assert {finding.status for finding in found.values()} == {OK}
    assert found["board"].data["layout"] == f"{frames.LAYOUT_HASH:08x}"


# -- no board ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("behaviour", "kind", "says"),
    [
        (babble(CONSOLE), "text", "Wrong baud, or text? Text: a console"),
        (babble(random.Random(2).randbytes(120).replace(b"\0", b"\1")), "binary", "neither text nor frames"),
        (babble(bytes(100)), "break", "the line is held low"),
    ],
)
def test_what_cannot_be_decoded_is_shown_raw(behaviour: Callable[[Link], None], kind: str, says: str) -> None:
    with far_end(behaviour) as path:
        hello = examined(path)["hello"]
    assert hello.status == PROBLEM
    assert hello.data["kind"] == kind
    assert says.lower() in hello.found.lower()
    assert len(hello.raw) == 4


def test_a_loop_is_recognised_by_our_own_frames() -> None:
    with far_end(echo) as path:
        hello = examined(path)["hello"]
    assert hello.status == PROBLEM
    assert "our own frames come back" in hello.found


def test_frames_that_are_no_answer() -> None:
    command = encode(frames.pack(Command(7, (0, 0, 0), 0, 0, 1), 0))
    with far_end(babble(command)) as path:
        hello = examined(path)["hello"]
    assert hello.status == PROBLEM
    assert "COMMAND" in hello.found
    assert "HELLO is not answered" in hello.found


def test_silence_comes_with_a_list() -> None:
    with far_end(nobody) as path:
        hello = examined(path)["hello"]
    assert (hello.status, hello.found) == (PROBLEM, "nothing came, neither unasked nor in answer to HELLO")
    assert len(hello.lines) >= 2


def test_the_other_side_goes_away() -> None:
    lab = open_link("pty", listen=False)

    def leave(end: Link) -> None:
        end.receive(0.1)
        end.close()

    with far_end(leave, lab) as path:
        found = examined(path)
    assert found["link"].status == PROBLEM
    assert "the other end is gone" in found["link"].found


def test_nobody_listens_on_a_udp_port() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    hello = examined(f"udp://127.0.0.1:{port}")["hello"]
    assert hello.status == PROBLEM
    assert hello.commands == (f"sil board --link udp://127.0.0.1:{port}",)


def test_a_udp_link_that_cannot_be_opened_has_no_device_to_ask_about(monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: an advice that introduces a command comes with one."""

    def refuse(*_: object, **__: object) -> None:
        raise LinkError("udp: refused")

    monkeypatch.setattr(link, "open_link", refuse)
    found = examined("udp://127.0.0.1:9")["open"]
    assert (found.status, found.found, found.advice, found.commands) == (PROBLEM, "udp: refused", "", ())
    with far_end(nobody) as path:
        monkeypatch.setattr(link, "open_link", refuse)
        found = examined(path)["open"]
    assert (found.advice, found.commands) == ("who has it open, of all users:", (f"sudo fuser -v {path}",))


# -- not even opened --------------------------------------------------------------------------------------------------


def test_a_path_that_does_not_exist_ends_it(tmp_path: Path) -> None:
    found = examined(str(tmp_path / "ttyUSB0"))
    assert list(found) == ["device"]
    assert found["device"].status == PROBLEM


def test_a_device_without_permission_is_not_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may open everything, so the answer to "may I" is handed in."""
    monkeypatch.setattr(link, "open_link", lambda *_, **__: pytest.fail("opened"))
    with far_end(nobody) as path:
        found = examined(path, access=lambda path, mode: False)
    assert found["permission"].status == PROBLEM
    assert list(found) == ["device", "permission"]


def test_a_port_that_another_process_has_open_is_left_alone() -> None:
    """HELLO would end that one's session, and each would get half of the bytes."""
    board = FakeBoard()
    hold = "import sys; f = open(sys.argv[1], 'r+b', buffering=0); print('open', flush=True); sys.stdin.read()"
    with far_end(board) as path:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen([sys.executable, "-c", hold, path], **pipes) as other:  # type: ignore[call-overload]
            assert other.stdout.readline() == b"open\n"
            found = examined(path)
            other.communicate()
    assert found["openers"].status == PROBLEM
    assert f"(pid {other.pid})" in found["openers"].found
    assert list(found)[-1] == "openers"
    assert board.seen == []


@pytest.mark.parametrize("url", ["serial:///dev/x?baud=fast", "udp://", "carrier-pigeon", "inproc", "/dev/x?baud=0"])
def test_what_is_no_link_is_a_usage_error(url: str) -> None:
    with pytest.raises(LinkError, match=r"^link: expected"):
        examined(url)


# -- a real port, for which a pty stands in ---------------------------------------------------------------------------


@pytest.fixture
def uart(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pty is taken for a port with a baud rate, and the driver counts two framing errors each time it is asked."""
    monkeypatch.setattr(serial_module, "_is_pty", lambda path: False)
    monkeypatch.setattr(device, "PTY_MAJORS", range(0))
    asked = iter(range(0, 1000, 2))
    whole = serial_module.fcntl.ioctl

    def ioctl(fd: int, request: int, *rest: object) -> object:
        if request == serial_module.TIOCGICOUNT:
            return serial_module.ICOUNT.pack(*[0] * 6, next(asked), *[0] * 13)
        return whole(fd, request, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(serial_module.fcntl, "ioctl", ioctl)


@pytest.mark.usefixtures("uart")
def test_a_uart_has_a_wire_time_and_counters() -> None:
    with far_end(FakeBoard()) as path:
        found = examined(f"serial://{path}?baud=57600", 5.0)
    assert found["round trips"].data["wire_us"] == pytest.approx(118 * 10 / 57600 * 1e6, abs=0.1)
    assert found["errors"].status == PROBLEM
    assert found["errors"].data["line"] == {"framing": 2, "overrun": 0, "parity": 0, "breaks": 0, "buffer_overrun": 0}


def test_a_pty_has_no_line_errors() -> None:
    with open_link("pty", listen=False) as lab, open_link(lab.url, listen=True) as port:
        assert isinstance(port, serial_module.SerialLink)
        assert port.line_errors() is None
        assert os.get_blocking(port.fileno()) is False
