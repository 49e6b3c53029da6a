"""Benches for the timing contract: a board driven frame by frame, and a lab whose channel a test scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from firmware_sim.board import Board
from protocol import config, frames
from protocol.channel import TO_BOARD, TO_LAB, Fate
from protocol.frames import NO_TICK, Command, Event, Hello, Packet, Reading, Sample, Telemetry, Tick, Type
from protocol.law_tables import config_words, law_by_name
from protocol.links import inproc
from protocol.port import Port
from sil.rig import assemble, record_config
from sil.scenario import load_values

ROWS = ((0, 2**28, 0, 0),)  # set-point: a sixteenth of a turn about x, from tick 0


class FakeHal:
    """A board's hardware whose clock the test sets."""

    def __init__(self) -> None:
        self.time_ns = 0
        self.kicks = 0

    def now(self) -> int:
        return self.time_ns

    def wait(self, until_ns: int | None) -> Packet | None:
        raise AssertionError("these tests drive the board themselves")

    def kick(self) -> None:
        self.kicks += 1


class BoardBench:
    """A board at the end of an in-memory cable; answers come back as frames."""

    def __init__(self, law: str = "appc", clock_rate_q16: int = 0, **values: Any) -> None:
        self.table = law_by_name(law)
        self.words = config_words(self.table, values, ROWS)
        lab_end, board_end = inproc.pair()
        self.lab, self.port, self.hal = Port(lab_end), Port(board_end), FakeHal()
        self.board = Board(self.port, self.hal)
        lab_end.pump = self.pump
        self.rate = clock_rate_q16

    def pump(self) -> None:
        while (packet := self.port.receive(0.0)) is not None:
            self.board.handle(packet)

    def hello(self, nonce: int) -> list[Any]:
        return self.send(Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, nonce, self.rate, "test"))

    def configure(self) -> list[Any]:
        return self.send(*config.split(self.words))

    def open(self, nonce: int = 7) -> BoardBench:
        self.hello(nonce)
        self.lab.reset()
        (ready,) = self.configure()[-1:]
        assert ready.status == frames.READY_OK, ready
        return self

    def send(self, *out: Any) -> list[Any]:
        self.lab.send(*out)
        self.pump()
        return self.received()

    def received(self) -> list[Any]:
        answers = []
        while (packet := self.lab.receive(0.0)) is not None:
            answers.append(packet.frame)
        return answers

    def sample(self, tick: int, **changes: Any) -> list[Any]:
        return self.send(make_sample(tick, **changes))

    def tick(self, tick: int) -> list[Any]:
        return self.send(Tick(tick))

    def timer(self) -> list[Any]:
        """The board's own timer fires, at the time it was set for."""
        assert self.board.timer_ns is not None
        self.hal.time_ns = max(self.hal.time_ns, self.board.timer_ns)
        self.board.on_timer()
        return self.received()


def make_sample(tick: int, **changes: Any) -> Sample:
    """A plausible SAMPLE: all readings present and valid, attitude 1 deg about x."""
    zero = (0, 0, 0)
    readings = (Reading(0, (11930465, 0, 0)), Reading(0, (2**30, 0, 0, 0)), Reading(0, zero))
    ack = tick - 1 if tick else NO_TICK
    sample = Sample(tick, zero, zero, zero, ack, 0, frames.FRESH if tick else frames.ZERO, 7, readings)
    return sample._replace(**changes)


def commands(answers: Iterable[Any]) -> list[Command]:
    return [frame for frame in answers if isinstance(frame, Command)]


def events_of(answers: Iterable[Any]) -> list[Event]:
    return [frame for frame in answers if isinstance(frame, Event)]


def telemetry(answers: Iterable[Any]) -> list[Telemetry]:
    return [frame for frame in answers if isinstance(frame, Telemetry)]


class Script:
    """A channel that loses or delays what a test says, and delivers the rest at once."""

    def __init__(
        self,
        lose_up: Sequence[int] = (),
        lose_down: Sequence[int] = (),
        delay_down_ns: dict[int, int] | None = None,
    ) -> None:
        self.lose_up, self.lose_down, self.delay_down_ns = set(lose_up), set(lose_down), delay_down_ns or {}

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        if direction == TO_BOARD and frame_type == Type.SAMPLE and tick in self.lose_up:
            return (Fate(False, t_ns, "scripted"),)
        if direction == TO_LAB and frame_type == Type.COMMAND and tick in self.lose_down:
            return (Fate(False, t_ns, "scripted"),)
        return (Fate(True, t_ns + (self.delay_down_ns.get(tick, 0) if direction == TO_LAB else 0)),)


class Rows:
    """A recorder that keeps rows in lists."""

    def __init__(self) -> None:
        self.packets: list[tuple[int, int, int, bytes]] = []
        self.copies: list[tuple[str, int, int]] = []  # cause, copy, arrival of each packet
        self.events: list[tuple[int, int, int, int]] = []
        self.truths: list[tuple[int, tuple[float, ...], int]] = []
        self.commits: list[int] = []
        self.sessions: list[int] = []
        self.kept_house: list[tuple[int, bytes]] = []

    def packet(
        self,
        tick: int,
        direction: int,
        fate: int,
        packet: bytes,
        cause: str = "",
        copy: int = 0,
        arrival_ns: int = -1,
        encoded: bytes = b"",
    ) -> None:
        self.packets.append((tick, direction, fate, packet))
        self.copies.append((cause, copy, arrival_ns))

    def session(self, tick: int) -> None:
        self.sessions.append(tick)

    def housekeeping(self, direction: int, packet: bytes) -> None:
        self.kept_house.append((direction, packet))

    def event(self, tick: int, code: int, a: int, b: int) -> None:
        self.events.append((tick, code, a, b))

    def truth(self, motion: Any, applied_Nm: Any, setpoint_bam: Any, source: int, tick: int) -> None:
        self.truths.append((tick, tuple(applied_Nm.tolist()), source))

    def timing(self, tick: int, wake: Any, answer_ns: int) -> None:
        pass

    def commit(self, tick: int) -> None:
        self.commits.append(tick)

    # -- what tests ask for ----------------------------------------------------------------------------------------

    def samples(self) -> list[Sample]:
        return [frames.unpack(p).frame for _, d, _, p in self.packets if d == 0 and p[1] == Type.SAMPLE]

    def commands(self) -> list[Command]:
        return [frames.unpack(p).frame for _, d, _, p in self.packets if d == 1 and p[1] == Type.COMMAND]

    def events_with(self, code: int) -> list[tuple[int, int, int]]:
        return [(tick, a, b) for tick, c, a, b in self.events if c == code]

    def sources(self) -> list[int]:
        return [source for _, _, source in self.truths]


class LabBench:
    """A whole lab with the board in process, lockstep, and a scripted channel; `rows` is what was recorded."""

    def __init__(self, channel: Script | None = None, clock: Any = None, **values: Any) -> None:
        content = {"board": "inproc", "link": "inproc", "duration_s": 20.0, **values}
        self.scenario = load_values(content)
        self.rows = Rows()
        quiet = lambda line: None  # noqa: E731
        self.rig = assemble(self.scenario, self.rows, None, quiet, channel=channel or Script(), clock=clock)
        record_config(self.rig, self.rows, 0)

    def run(self) -> Rows:
        self.rig.loop.run(lambda: False, lambda tick, motion: None)
        self.rig.stop(0)
        return self.rows


class StallingClock:
    """A paced clock whose wake-ups are as late as a test says; `at_wait` is called as the lab goes to sleep."""

    paced = True
    scale = 1.0

    def __init__(self, late_ns: dict[int, int] | None = None, at_wait: Any = None) -> None:
        self.late_ns, self.at_wait = late_ns or {}, at_wait
        self.rebased: list[int] = []

    def start(self, first_tick_ns: int) -> None:
        pass

    def wait(self, t_ns: int, listen: Any) -> int:
        listen(0.0)
        if self.at_wait is not None:
            self.at_wait(t_ns)
        return self.late_ns.get(t_ns, 0)

    def rebase(self, t_ns: int) -> None:
        self.rebased.append(t_ns)
