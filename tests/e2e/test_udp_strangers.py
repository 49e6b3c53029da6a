"""Strangers on UDP, at either end: of a lockstep run not a byte changes, a paced run goes on, a second lab waits."""

from __future__ import annotations

import contextlib
import json
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_killed_and_interrupted import ticks_written, wait_for

from firmware_sim.board import Board
from firmware_sim.hal import HostHal
from protocol import frames
from protocol.frames import LAYOUT_HASH, Hello, Packet, Stop, Tick
from protocol.links import LinkClosed
from protocol.links.udp import UdpBoard, UdpLab
from protocol.port import Port
from sil import open_run
from sil.configure import orders
from sil.scenario import load_scenario
from sil.session import Session
from sil.sinks.journal import Kind, read_housekeeping, read_journal
from sil.trouble import LinkFailure

RUN = ("appc-udp", "--set", "require=[]")
LONG = (*RUN, "--set", "duration_s=4000")
FLOOD = 100_000
MODULES = {"process": "firmware_sim", "native": "sil.pil.native"}
ZERO = (0, 0, 0)


class Stranger:
    """A socket of its own that sends to both ends of a session."""

    def __init__(self, ports: list[int]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = [("127.0.0.1", port) for port in ports]
        self.heard: list[bytes] = []

    def send(self, data: bytes) -> None:
        for address in self._to:
            self._socket.sendto(data, address)

    def listen(self) -> list[bytes]:
        """What was answered."""
        self._socket.settimeout(0.05)
        try:
            while True:
                self.heard.append(self._socket.recv(2048))
        except TimeoutError:
            return self.heard


@pytest.fixture(params=sorted(MODULES))
def board(request: pytest.FixtureRequest) -> Iterator[int]:
    """A board process of its own that listens: its port."""
    command = [sys.executable, "-P", "-m", MODULES[request.param], "--link", "udp://127.0.0.1:0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    yield int(process.stdout.readline().rpartition(":")[2])
    process.kill()
    process.communicate()


def port_of_lab(board_port: int) -> int:
    """The local port of the socket that is connected to the board's: the laboratory's."""
    remote = f"0100007F:{board_port:04X}"

    def look() -> int:
        lines = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
        return next((int(fields[1].partition(":")[2], 16) for fields in lines if fields[2] == remote), 0)

    return wait_for(look)


def old_session(run: Path) -> list[bytes]:
    """All packets of a run, as they went both ways: handshake, deterministic frames, STOP."""
    housekeeping = [
        read_housekeeping(record.payload)[2]
        for record in read_journal(run / "run.journal")
        if record.kind == Kind.HOUSEKEEPING
    ]
    return housekeeping + [row.packet for row in open_run(run).packets]


def hello(nonce: int) -> bytes:
    return frames.pack(Hello(1, frames.ROLE_LAB, 0, LAYOUT_HASH, nonce, 0, "a stranger"), 0)


def sample(tick: int) -> bytes:
    reading = frames.Reading(0, (2**30, 2**30, 2**30))
    return frames.pack(frames.Sample(tick, ZERO, ZERO, ZERO, tick, 0, 1, 1, (reading, None, None)), tick & 0xFFFF)


def forged() -> list[bytes]:
    """Whatever a stranger may hope that one end takes for the other's."""
    ours = Hello(1, frames.ROLE_BOARD, frames.HELLO_ECHO, LAYOUT_HASH, 7, 0, "a stranger")
    command = [frames.pack(frames.Command(tick, (2**30,) * 3, 0, 0, 1), 0) for tick in range(0, 8000, 400)]
    restart = frames.pack(ours._replace(flags=0, nonce=0), 0)
    ticks = [frames.pack(Tick(tick), 0) for tick in range(0, 8000, 400)]
    samples = [sample(tick) for tick in range(0, 8000, 400)]
    return [hello(7), frames.pack(ours, 0), restart, frames.pack(Stop(0), 0), *command, *ticks, *samples]


def oversize() -> list[bytes]:
    packet = frames.pack(frames.Telemetry(3, 1, 1, tuple(range(58))), 0)
    return [packet + b"\0" * more for more in (1, 7, 250, 1800, 2048, 60_000)] + [b"", b"\0", bytes(65_000)]


def flood(stranger: Stranger, run: subprocess.Popen[str]) -> int:
    """As fast as it goes, to either end, while the run lasts: how many datagrams."""
    pieces = [hello(9), sample(5), b"garbage", bytes(1400), frames.pack(Stop(1), 0)]
    sent = 0
    while sent < FLOOD and run.poll() is None:
        for piece in pieces * 20:
            stranger.send(piece)
        sent += 2 * 20 * len(pieces)
    return sent


def test_of_a_lockstep_run_not_a_byte_changes(cli, recorded, board, record_property):
    """One attack after the other, while it runs."""
    clean = recorded(*LONG)
    replayed = old_session(recorded(*RUN, "--set", "duration_s=100"))
    url = f"udp://127.0.0.1:{board}"
    run = cli.start("run", *LONG, "--clock", "lockstep", "--board", url, "--out", "run", "--json")
    stranger = Stranger([board, port_of_lab(board)])
    wait_for(lambda: ticks_written(cli.folder / "run") > 10 or run.poll() is not None)
    for data in (*forged(), *oversize(), *replayed):
        stranger.send(data)
    assert stranger.listen() == []
    assert run.poll() is None, "over before the flood began"
    record_property("flood", sent := flood(stranger, run))
    out, err = run.communicate(timeout=240)
    assert run.returncode == 0, err
    assert sent > FLOOD / 20
    assert json.loads(out)["sha256"] == json.loads((clean / "summary.json").read_text())["sha256"]


def test_a_paced_run_goes_on(cli, board):
    url = f"udp://127.0.0.1:{board}"
    slack = ("--set", "timing.max_degraded_fraction=1", "--set", "duration_s=100")
    run = cli.start("run", *RUN, *slack, "--clock", "scaled:20", "--board", url, "--out", "run", "--json")
    stranger = Stranger([board, port_of_lab(board)])
    wait_for(lambda: ticks_written(cli.folder / "run") > 10 or run.poll() is not None)
    for data in (*forged(), *oversize()):
        stranger.send(data)
    assert flood(stranger, run) >= FLOOD, "over before the flood was"
    out, err = run.communicate(timeout=60)
    assert run.returncode == 0, err
    summary = json.loads(out)
    assert (summary["reason"], summary["ticks"]) == ("finished", 200)
    assert open_run(cli.folder / "run").tick.tolist() == list(range(200))


# -- a second laboratory ----------------------------------------------------------------------------------------------


class Ending(HostHal):
    """Hardware that can be switched off from outside."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self.off = threading.Event()

    def wait(self, until_ns: int | None) -> Packet | None:
        if self.off.is_set():
            raise LinkClosed("switched off")
        soon_ns = self.now() + 100_000_000
        return super().wait(soon_ns if until_ns is None else min(until_ns, soon_ns))


@pytest.fixture
def serving() -> Iterator[tuple[UdpBoard, Port]]:
    """The Python board in a thread of this process, so that its counters can be looked at."""
    with UdpBoard("127.0.0.1", 0) as link:
        assert isinstance(link, UdpBoard)
        port = Port(link)
        hal = Ending(port)

        def serve() -> None:
            with contextlib.suppress(LinkClosed):
                Board(port, hal).serve(once=False)

        thread = threading.Thread(target=serve)
        thread.start()
        yield link, port
        hal.off.set()
        thread.join()


def test_a_second_laboratory_is_refused_and_counted(cli, serving):
    """While the first one flies it hears nothing and is told so; afterwards it is welcome."""
    link, port = serving
    slack = ("--set", "timing.max_degraded_fraction=1", "--set", "duration_s=40")
    run = cli.start("run", *RUN, *slack, "--clock", "scaled:10", "--board", link.url, "--out", "run", "--json")
    wait_for(lambda: ticks_written(cli.folder / "run") > 5 or run.poll() is not None)
    made = orders(load_scenario("appc-udp"))
    before = port.counters.strangers
    with UdpLab("127.0.0.1", link.port) as second:
        talk = Session(Port(second), 0, lambda: None)
        with pytest.raises(LinkFailure, match="no HELLO within 1 s, though somebody listens there: has another lab"):
            talk.open(made.words, made.configuration.hash, 1.0, lambda line: None)
        assert port.counters.strangers - before >= 5  # a HELLO every 0.2 s
        out, err = run.communicate(timeout=60)
        assert run.returncode == 0, err
        assert json.loads(out)["ticks"] == 80
        assert talk.open(made.words, made.configuration.hash, 10.0, lambda line: None)
        talk.close(frames.STOP_DONE)


def test_where_nobody_listens_no_other_laboratory_is_blamed():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    made = orders(load_scenario("appc-udp"))
    with UdpLab("127.0.0.1", port) as link:
        talk = Session(Port(link), 0, lambda: None)
        with pytest.raises(LinkFailure, match=re.escape("no HELLO within 1 s: is it running and on this link?")):
            talk.open(made.words, made.configuration.hash, 1.0, lambda line: None)
