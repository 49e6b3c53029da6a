"""Board `qemu` as a process: it ends when it should, QEMU ends with it whatever happens, and one line says why."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from powered import Powered, need_qemu

from protocol.frames import Type
from protocol.links import open_link
from protocol.port import Port
from sil.boards import BoardOrder
from sil.boards.qemu import QemuBoard
from sil.pil.qemu import _watch
from sil.pil.qemu_machine import PROGRAM, _die_with
from sil.trouble import LinkFailure, SilError, UsageError
from tools.firmware_image import IMAGES

ROOT = Path(__file__).parents[3]
SOON_S = 10.0


class Launched:
    """`python -m sil.pil.qemu` on a pty, listening."""

    def __init__(self) -> None:
        self.link = open_link("pty", listen=False)
        self.port = Port(self.link)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sil.pil.qemu", "--link", self.link.peer_url],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        )  # fmt: skip
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"listening {self.link.peer_url}\n"

    def qemu_pid(self) -> int:
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        (pid,) = (int(child) for child in children if "qemu" in Path(f"/proc/{child}/comm").read_text())
        return pid

    def said(self) -> str:
        return self.process.communicate(timeout=SOON_S)[1]


@pytest.fixture
def launched() -> Iterator[Launched]:
    board = Launched()
    yield board
    board.process.kill()
    board.process.communicate()
    board.port.close()


def ended(pid: int) -> bool:
    """Within a moment; a zombie whose parent is not ours to wait for has ended, too."""
    for _ in range(int(SOON_S / 0.02)):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False


def test_it_ends_with_its_link_and_so_does_qemu(launched):
    pid = launched.qemu_pid()
    launched.port.close()
    assert launched.process.wait(SOON_S) == 0
    assert ended(pid)


def test_qemu_outlives_no_killed_parent(launched):
    pid = launched.qemu_pid()
    launched.process.kill()
    assert ended(pid)


def test_sigterm_pulls_the_plug(launched):
    pid = launched.qemu_pid()
    launched.process.terminate()
    assert launched.process.wait(SOON_S) == 0
    assert ended(pid)


def test_a_qemu_that_dies_is_told_in_one_line(launched):
    os.kill(launched.qemu_pid(), signal.SIGKILL)
    assert launched.said().splitlines()[-1] == "qemu: it ended with signal 9"
    assert launched.process.returncode == 3


def test_a_qemu_that_lives_on_but_is_silent_is_told_too(monkeypatch, capsys):
    """Its channel gives up after a while; to wait for its end would be to wait for ever."""
    monkeypatch.setattr("sil.pil.qmp.ANSWER_S", 0.5)
    monkeypatch.setattr("sil.pil.qemu.END_S", 0.1)
    reader, writer = os.pipe()
    with Powered("mps2-an386") as board:
        board.boot_hello()
        line = os.open(board.link.peer_url.removeprefix("serial://"), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        os.kill(board.qemu.process.pid, signal.SIGSTOP)
        os.write(writer, bytes((signal.SIGUSR1,)))
        assert _watch(board.qemu, line, reader) == 3
    for fd in (line, reader, writer):
        os.close(fd)
    assert capsys.readouterr().err == "qemu: QMP: no answer within 0.5 s\n"


@pytest.mark.parametrize(("parent", "says"), [(os.getpid, "here\n"), (lambda: 1, "")])
def test_qemu_starts_under_its_parent_and_under_nobody_else(parent, says):
    """Compared with the parent's number, not with 1: in a container the parent may well be process 1."""
    done = subprocess.run(["echo", "here"], preexec_fn=partial(_die_with, parent()), capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, says)


def test_the_reset_button_resets_and_says_so(launched):
    """SIGUSR1: once more the HELLO of a board that has just started."""
    for _ in range(2):
        packet = launched.port.receive(SOON_S)
        assert packet is not None
        assert (packet.type, packet.frame.nonce) == (Type.HELLO, 0)
        launched.process.send_signal(signal.SIGUSR1)
    assert select.select([launched.process.stderr], [], [], SOON_S)[0]
    assert launched.process.stderr.readline() == "qemu: the firmware was reset: the button was pressed (SIGUSR1)\n"


def order(link_url: str, log: Path) -> BoardOrder:
    return BoardOrder(link_url, "", log, lambda line: None)


def test_another_link_than_a_pty_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(UsageError, match=r"expected pty for board qemu, .* got 'udp'; known: link\.url=pty"):
        QemuBoard(order("udp", tmp_path / "log"))


def test_without_qemu_one_line_names_the_package(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match=r"qemu-system-arm: not found; .* apt-get install .*qemu-system-arm"):
        QemuBoard(order("pty", tmp_path / "log"))


def test_an_image_that_is_missing_is_named_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr(QemuBoard, "options", lambda self, order: ["--image", str(tmp_path / "no.elf")])
    with pytest.raises(UsageError, match=r"no\.elf: no such image: build it with `make firmware`"):
        QemuBoard(order("pty", tmp_path / "log"))


def test_a_file_that_is_no_image_is_refused(monkeypatch, tmp_path):
    """QEMU would load it as it is, and run into a lockup."""
    image = tmp_path / "text.elf"
    image.write_text("this is no image")
    monkeypatch.setattr(QemuBoard, "options", lambda self, order: ["--image", str(image)])
    with pytest.raises(UsageError, match=r"text\.elf: expected an ELF image, got another file"):
        QemuBoard(order("pty", tmp_path / "log"))


def test_an_image_that_cannot_run_is_qemus_own_complaint(monkeypatch, tmp_path):
    """Another chip's: there is no code where the machine starts, which may be before or after it listens."""
    image = str(IMAGES / "stm32f405.elf")
    monkeypatch.setattr(QemuBoard, "options", lambda self, order: ["--image", image])

    def plug_in_and_wait() -> None:
        board = QemuBoard(order("pty", tmp_path / "log"))
        raise LinkFailure(board.post_mortem(LinkFailure("silent")))

    with pytest.raises(SilError, match=r"^[^\n]*Lockup[^\n]*$"):
        plug_in_and_wait()


def test_a_board_that_is_closed_leaves_no_process(tmp_path):
    board = QemuBoard(order("pty", tmp_path / "log"))
    pid = board.pid
    assert pid is not None
    began = time.monotonic()
    board.close()
    board.close()
    assert time.monotonic() - began < 1.0, "it waits for a signal instead of the hang-up"
    assert ended(pid)


def test_where_ci_is_set_a_missing_qemu_fails_instead_of_being_skipped(monkeypatch, tmp_path):
    """So these tests cannot fall silent."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CI", "true")
    with pytest.raises(AssertionError, match=PROGRAM):
        need_qemu()
    monkeypatch.delenv("CI")
    with pytest.raises(pytest.skip.Exception, match=PROGRAM):
        need_qemu()
