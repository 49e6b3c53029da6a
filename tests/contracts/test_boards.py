"""Boards: every file is registered, and every board that is ours to start keeps the contract, new ones unasked."""

from __future__ import annotations

import importlib.util
import inspect
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from protocol import frames
from protocol.config import split
from protocol.frames import LAYOUT_HASH, Hello, Ready, Stop
from protocol.law_tables import config_words, law_by_name
from protocol.port import Port
from sil import boards
from sil.boards import BOARDS, BoardHost, BoardOrder, plug_in
from sil.plugins import load

NEEDS = {"cortex-m": importlib.util.find_spec("unicorn"), "qemu": shutil.which("qemu-system-arm")}
OURS = sorted(set(BOARDS) - {"wired"})  # a wired board is somebody else's to start
WAIT_S = 20.0


def test_every_file_is_registered_and_every_entry_is_a_file() -> None:
    files = {path.stem for path in Path(boards.__file__).parent.glob("*.py")} - {"__init__"}
    modules = [entry.partition(":")[0] for entry in BOARDS.values()]
    assert sorted(modules) == sorted(f"sil.boards.{file}" for file in files)


def test_every_entry_loads_and_says_what_it_is() -> None:
    for name in BOARDS:
        assert inspect.getdoc(load(BOARDS, "board", name))


@pytest.fixture(params=OURS)
def board(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[BoardHost]:
    kind = request.param
    if not NEEDS.get(kind, True):
        pytest.skip(f"what board {kind} needs is not installed")
    link = "inproc" if kind == "inproc" else "pty"
    host = plug_in(kind, BoardOrder(link, "", tmp_path / "board.log", lambda line: None))
    yield host
    host.close()


def answer(port: Port, wanted: type) -> object:
    """The next frame of this type."""
    while (packet := port.receive(WAIT_S)) is not None:
        if isinstance(packet.frame, wanted):
            return packet.frame
    raise AssertionError(f"no {wanted.__name__} within {WAIT_S:g} s")


def test_a_board_opens_a_session_is_configured_and_stops(board: BoardHost) -> None:
    """HELLO is echoed, a CONFIG answered with READY and the hash of the tables; after close() nothing is left of it."""
    words = config_words(law_by_name("pd"), {})
    port = Port(board.link)
    port.send(Hello(1, frames.ROLE_LAB, 0, LAYOUT_HASH, 7, 0, "test"))
    while not (hello := answer(port, Hello)).flags & frames.HELLO_ECHO:  # type: ignore[attr-defined]
        pass
    assert (hello.nonce, hello.layout_hash) == (7, LAYOUT_HASH)  # type: ignore[attr-defined]
    port.reset()
    port.send(*split(words))
    ready = answer(port, Ready)
    assert isinstance(ready, Ready)
    assert ready.status == frames.READY_OK
    board.check_alive()
    port.send(Stop(0))
    pid = board.pid
    board.close()
    board.close()
    assert pid is None or not Path(f"/proc/{pid}").exists()
