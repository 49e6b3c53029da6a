"""The cable: a port that is not ours is left alone, baud rates are tried and set again, somebody else's firmware."""

from __future__ import annotations

import os
import stat
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

import pytest

from firmware_sim.board import Board
from firmware_sim.hal import HostHal
from protocol import frames
from protocol.frames import Type
from protocol.link import Link, LinkError
from protocol.links import inproc, open_link
from protocol.links.serial import SerialLink
from protocol.port import Port
from sil.board_test import FAIL, GROUPS, PASS, SKIPPED, Order, cable, examine, wanted
from sil.board_test import examinee as examinees
from sil.board_test.bench import Patience
from sil.board_test.outcome import Failed, Skipped
from sil.doctor.findings import Surroundings
from sil.trouble import UsageError

QUICK = Patience(hello_s=0.4, answer_s=0.4, quiet_s=0.005)
PATIENT = Patience(
    hello_s=10.0, answer_s=10.0, quiet_s=0.02
)  # with a board that answers, on a machine that may be busy


class Reboots(Board):
    """A board with a reset button."""

    pressed = False

    def press(self) -> None:
        self.pressed = True

    def look(self) -> None:
        """Its main loop comes round."""
        if self.pressed:
            self.pressed = False
            self._forget()
            self._nonce = None
            self.announce()


class Plugged(NamedTuple):
    """Path of a serial port with a right board on it, types of the frames that reached the board, the board."""

    path: str
    heard: list[int]
    board: Reboots


@pytest.fixture
def port() -> Iterator[Plugged]:
    heard: list[int] = []
    near = open_link("pty", listen=False)  # the board holds the master here, the lab opens the port
    board_port = Port(near, tap=lambda way, packet: heard.append(packet[1]) if way == "rx" else None)
    board = Reboots(board_port, HostHal(board_port))
    over = threading.Event()

    def live() -> None:
        while not over.is_set():
            board.look()
            try:
                packet = board_port.receive(0.02)
            except LinkError:
                over.wait(0.01)  # nobody has the other side open
                continue
            if packet is not None:
                board.handle(packet)

    thread = threading.Thread(target=live)
    thread.start()
    yield Plugged(near.url.removeprefix("serial://"), heard, board)
    over.set()
    thread.join()
    near.close()


def statuses(order: Order) -> dict[str, tuple[str, str]]:
    return {each.finding.check: (each.finding.status, each.finding.found) for each in examine(order, lambda text: None)}


def test_a_board_on_a_port_is_tested_and_left_without_a_session(port: Plugged) -> None:
    path, heard, _ = port
    found = statuses(Order(path, only=("handshake", "baud", "reset"), patience=PATIENT))
    assert {name: said for name, said in found.items() if said[0] == FAIL} == {}
    assert found["baud"] == (SKIPPED, "a pseudo-terminal has no baud rate")
    assert found["reset"] == (SKIPPED, "nobody here to press reset (--reset asks for it)")
    assert found["left"][0] == PASS
    assert Type.STOP in heard[-3:]


def test_a_reset_button_that_is_pressed_when_asked_for(port: Plugged) -> None:
    asked: list[str] = []

    def press(text: str) -> None:
        asked.append(text)
        port.board.press()

    order = Order(port.path, only=("reset",), reset=True, reset_within_s=30.0, patience=PATIENT)
    found = {each.finding.check: each.finding for each in examine(order, lambda text: None, press)}
    assert found["reset"].status == PASS, found["reset"].found
    assert asked == ["press the board's reset button, within 30 s"]


@pytest.mark.parametrize(("has_to", "status"), [(True, FAIL), (False, SKIPPED)])
def test_a_reset_button_that_nobody_presses(port: Plugged, has_to: bool, status: str) -> None:
    order = Order(
        port.path, only=("reset",), reset=has_to, reset_offered=not has_to, reset_within_s=0.2, patience=PATIENT
    )
    found = {each.finding.check: each.finding for each in examine(order, lambda text: None)}
    assert found["reset"].status == status
    assert "HELLO (nonce 0) within 0.2 s" in found["reset"].found
    assert found["left"].status == PASS


def test_a_port_that_another_process_has_open_is_left_alone(port: Plugged, tmp_path: Path) -> None:
    path, heard, _ = port
    process = tmp_path / "proc" / "99999"
    (process / "fd").mkdir(parents=True)
    (process / "fd" / "3").symlink_to(path)
    (process / "comm").write_text("picocom\n")
    (process / "cmdline").write_text(f"picocom\0{path}\0")
    (tmp_path / "dev").symlink_to("/dev")

    class Elsewhere(Surroundings):
        def at(self, path: str) -> Path:
            return tmp_path / path.lstrip("/") if path.startswith("/proc") else Path(path)

    found = statuses(Order(path, patience=QUICK, around=Elsewhere()))
    assert found["openers"][0] == FAIL
    assert "picocom" in found["openers"][1]
    assert list(found)[-1] == "openers"
    assert heard == []


def test_no_device_no_board_and_no_such_board() -> None:
    found = statuses(Order("/dev/ttyUSB77", patience=QUICK))
    assert found["device"] == (FAIL, "/dev/ttyUSB77 does not exist")
    found = statuses(Order("udp://127.0.0.1:9", patience=QUICK))
    assert found["hello"][0] == FAIL
    assert "nobody listens on udp://127.0.0.1:9" in found["hello"][1]
    for target in ("carrier-pigeon", "inproc", "pty", "wired", "serial:///dev/ttyX?speed=3", "udp://nowhere"):
        with pytest.raises(UsageError, match=r"^board-test: "):
            statuses(Order(target, patience=QUICK))


def test_a_board_of_another_layout_is_told_and_not_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    class Other(Board):
        def _hello(self, echo: bool) -> Any:
            return super()._hello(echo)._replace(layout_hash=0x12345678)

    monkeypatch.setattr("sil.boards.inproc.Board", Other)
    monkeypatch.setattr(examinees, "KINDS", ("inproc",))
    found = statuses(Order("inproc", patience=QUICK))
    assert list(found) == ["board"]
    assert "layout 12345678" in found["board"][1]
    assert found["board"][0] == FAIL


# -- baud rates --------------------------------------------------------------------------------------------------------


class OnePort(SerialLink):
    """A real port in all but the wire: a board listens at some rates, and hears noise at the others."""

    answering: ClassVar[tuple[int, ...]] = (115200,)
    opened: ClassVar[list[int]] = []

    def __init__(self, path: str, baud: int = 115200) -> None:
        self.baud, self.url, self.datagram = baud, f"serial://{path}?baud={baud}", False
        self.opened.append(baud)
        self._lab, end = inproc.pair()
        port = Port(end)
        board = Board(port, HostHal(port))

        def pump() -> None:
            while (packet := port.receive(0.0)) is not None:
                board.handle(packet)

        self._lab.pump = pump if baud in self.answering else lambda: None

    def send(self, data: bytes) -> None:
        self._lab.send(data)

    def receive(self, timeout_s: float | None) -> bytes:
        return self._lab.receive(timeout_s)

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self._lab.close()


@pytest.fixture
def scanned(monkeypatch: pytest.MonkeyPatch) -> Any:
    """scanned(rates at which the board answers): what the check says, and which rates were opened."""

    def scan(*answering: int, given: int = 115200) -> tuple[str, list[int]]:
        monkeypatch.setattr(OnePort, "answering", answering)
        monkeypatch.setattr(OnePort, "opened", [])
        for module in (cable, examinees):
            monkeypatch.setattr(module, "open_link", lambda url, listen: OnePort.open(url, listen))
        monkeypatch.setattr(cable, "TRY_BAUD_S", 0.01)
        at = examinees.Examinee(Order(f"serial:///dev/ttyX?baud={given}", patience=QUICK), lambda text: None, print)
        at.device = SimpleNamespace(is_pty=False)  # type: ignore[assignment]
        at.plug()
        try:
            return cable.bauds(at).found, OnePort.opened
        except Failed as failed:
            return f"failed: {failed}", OnePort.opened
        finally:
            at.close()

    return scan


def test_a_board_with_a_fixed_rate_answers_at_one_and_that_is_set_again(scanned: Any) -> None:
    said, opened = scanned(115200)
    assert said == "it answers at 115200 baud and at no other of 8 from 9600 to 921600"
    assert opened == [115200, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600, 115200]


def test_a_board_that_finds_the_rate_itself(scanned: Any) -> None:
    said, _ = scanned(9600, 57600, 115200, given=57600)
    assert said == "it answers at 57600, 9600, 115200 of 8 from 9600 to 921600"


def test_a_board_that_does_not_come_back_to_its_rate(scanned: Any) -> None:
    said, opened = scanned(9600, given=57600)
    assert said.startswith("failed: ")
    assert opened[-1] == 57600


def test_a_link_without_a_rate_is_skipped() -> None:
    at = examinees.Examinee(Order("udp://127.0.0.1:9"), lambda text: None, print)
    with pytest.raises(Skipped, match="no baud rate"):
        cable.bauds(at)


# -- which checks ------------------------------------------------------------------------------------------------------


def test_only_and_skip_take_groups_and_checks() -> None:
    assert wanted(Order("process", only=("ticks: stale",))) == [
        *("handshake: echo", "handshake: laws", "ticks: stale", "end: left")
    ]
    left = wanted(Order("process", skip=("ticks", "states: ready")))
    assert "states: running" in left
    assert not [name for name in left if name.startswith("ticks") or name == "states: ready"]
    assert set(GROUPS) >= {"handshake", "numbers", "timer", "end"}
    for order in (Order("process", only=("tickz",)), Order("process", skip=("ticks: stail",))):
        with pytest.raises(UsageError, match=r"(did you mean|expected one of)"):
            wanted(order)


def test_completion_offers_the_groups_there_are() -> None:
    from sil.verbs.completion import CHECK_GROUPS

    assert tuple(name for name, _ in CHECK_GROUPS) == GROUPS


def test_what_is_a_character_device_here_is_one() -> None:
    """The ports of these tests are what the checks take for ports."""
    link = open_link("pty", listen=False)
    try:
        assert stat.S_ISCHR(os.stat(link.url.removeprefix("serial://")).st_mode)
        assert isinstance(link, Link)
        assert frames.LAYOUT_HASH
    finally:
        link.close()
