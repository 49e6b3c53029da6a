"""Scenario to rig: who is plugged into whom. Builds plant, sensors, wheels, link, board, loop, and takes them down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from protocol import frames
from protocol.channel import Channel, Clear
from protocol.faulty import Faulty
from protocol.law_tables import ConfigError, refusal
from protocol.links import LinkError
from protocol.outages import Disconnected
from protocol.port import Port
from sil import scenario_faults, timeline
from sil.answers import Answers
from sil.boards import FIRMWARE, BoardHost, BoardOrder, plug_in
from sil.clock import Clock, clock_rate_q16, new_clock
from sil.commands import CommandWindow, Decides, ExecutionModel
from sil.configure import Orders, orders, row_at
from sil.instruments import actuator_of, sensors_of
from sil.loop import Loop, Scales, Timing
from sil.realtime import may_lock_memory
from sil.rejoin import Rejoin
from sil.scenario import Scenario
from sil.scenario_law import is_user_law
from sil.schedule import read_schedule
from sil.session import Session
from sil.signals import Counterpart, Recorder
from sil.sinks.journal import Direction
from sil.sinks.journal import Fate as Outcome
from sil.trouble import LinkFailure, UsageError
from sil.unplugged import Nobody, Scheduled
from sil.user_plant import plant_of

Notify = Callable[[str], None]
TYPE_AT = 1  # of a packet
HELLO_WITHIN_S = 10.0
WIRED_WITHIN_S = 60.0  # a person types the other command
DEAD_AFTER_S = 10.0


@dataclass
class Rig:
    """A rig that is plugged together. What concerns a board is None without one."""

    loop: Loop
    clock: Clock
    window: CommandWindow | None = None
    port: Port | None = None
    session: Session | None = None
    host: BoardHost | None = None
    orders: Orders | None = None
    answers: Answers | None = None
    rejoin: Rejoin | None = None
    config_packets: tuple[bytes, ...] = ()
    plugged: tuple[str, str] = ("none", "")  # kind of board and URL of its link, as board_and_link() found them

    def stop(self, reason: int) -> None:
        """Tell the board that the session is over, and unplug. Leaves no process behind; safe to call twice."""
        try:
            if self.session is not None:
                self.session.close(reason)
        except LinkError:
            pass  # the link may be what failed
        finally:
            self.session = None
            if self.host is not None:
                self.host.close()


def assemble(
    scenario: Scenario,
    recorder: Recorder,
    log: Path | None,
    notify: Notify,
    wired: bool = False,
    channel: Channel | None = None,
    clock: Clock | None = None,
) -> Rig:
    """Build everything; with a board, the session is open and the board READY. Raises SilError with one line.

    log: file for a board process's stderr. wired: somebody else starts the board, whatever the scenario says.
    channel: what happens to frames on the way; None: what section `link` says. clock: None: the scenario's.
    """
    try:
        clock = clock or new_clock(scenario.clock.mode, scenario.period_ns, scenario.clock.spin_us)
        if scenario.board == "none":
            return Rig(_loop(scenario, clock, Nobody(), _scheduled(scenario), recorder, None), clock)
        return _with_board(scenario, clock, recorder, log, notify, wired, channel_of(scenario, channel))
    except LinkError as error:
        raise LinkFailure(str(error)) from None


def channel_of(scenario: Scenario, wire: Channel | None = None) -> Channel:
    """The modelled link: clear or with faults, or the one that is handed over; with the outages of the scenario."""
    if wire is None:
        faults = scenario.link.faults.any
        models = scenario.link.models()
        wire = Faulty(scenario.seed, scenario.period_ns, *models) if faults else Clear(scenario.link.baud)
    outages = timeline.outages(scenario.events, scenario.period_us, scenario.ticks)
    return Disconnected(wire, outages) if outages else wire


def law_orders(scenario: Scenario) -> Orders:
    """CONFIG of the scenario, or UsageError where its law will not fly so."""
    try:
        made = orders(scenario)
    except ConfigError as error:
        raise UsageError(str(error)) from None
    reason = refusal(made.configuration)
    if reason is not None:
        raise UsageError(reason)
    return made


def _with_board(
    scenario: Scenario,
    clock: Clock,
    recorder: Recorder,
    log: Path | None,
    notify: Notify,
    wired: bool,
    channel: Channel,
) -> Rig:
    made = law_orders(scenario)
    window = CommandWindow(scenario.transport_delay_ticks, scenario.period_ns, scenario.hold_limit)
    kind, url = board_and_link(scenario, wired)
    locks = scenario.clock.locks_memory and may_lock_memory()
    host = plug_in(kind, BoardOrder(url, user_law_spec(scenario), log, notify, locks))
    rig = Rig(loop=None, clock=clock, window=window, host=host, orders=made, plugged=(kind, url))  # type: ignore[arg-type]
    try:
        # The plant compiles or loads while the board process starts and does the same.
        rig.port = Port(host.link, tap=_housekeeping_to(recorder))
        rig.session = Session(rig.port, clock_rate_q16(clock), host.check_alive)
        loop = _loop(scenario, clock, Nobody(), window, recorder, made)
        packets = rig.session.open(
            made.words, made.configuration.hash, WIRED_WITHIN_S if wired else HELLO_WITHIN_S, notify
        )
        rig.config_packets = tuple(packets)
        planned = timeline.restarts(scenario.events, scenario.period_us, scenario.ticks)
        rig.rejoin = Rejoin(rig.port, rig.session, scenario.restart_limit, recorder, notify, planned)
        rig.answers = loop.board = _answers(scenario, rig, recorder, channel)
        rig.loop = loop
    except LinkError as error:
        reason = host.post_mortem(error)
        rig.stop(frames.STOP_FAILED)
        raise LinkFailure(reason) from None
    except BaseException:
        rig.stop(frames.STOP_FAILED)
        raise
    return rig


def record_config(rig: Rig, recorder: Recorder, tick: int) -> None:
    """The CONFIG packets are deterministic frames: part of the log, at the tick where their session starts."""
    for packet in rig.config_packets:
        recorder.packet(tick, Direction.UP, Outcome.DELIVERED, packet)


def _housekeeping_to(recorder: Recorder) -> Callable[[str, bytes], None]:
    """The recorder's tap: HELLO, READY, TICK, TIMING, STOP; the deterministic frames come with their fate."""

    def tap(way: str, packet: bytes) -> None:
        if frames.is_housekeeping(packet[TYPE_AT]):
            recorder.housekeeping(Direction.UP if way == "tx" else Direction.DOWN, packet)

    return tap


def _answers(scenario: Scenario, rig: Rig, recorder: Recorder, channel: Channel) -> Answers:
    assert rig.orders is not None and rig.port is not None and rig.host is not None and rig.window is not None
    assert rig.rejoin is not None
    common = rig.orders.configuration.common
    model = ExecutionModel(scenario.period_ns, common["sample_timeout_us"] * 1000, common["answer_delay_us"] * 1000)
    return Answers(
        rig.port,
        channel,
        model,
        rig.window,
        recorder,
        2.0 ** -common["torque_bits"],
        common["sample_timeout_us"] * 1000,
        lockstep=not rig.clock.paced,
        check_alive=rig.host.check_alive,
        dead_after_s=DEAD_AFTER_S,
        rejoin=rig.rejoin,
    )


def board_and_link(scenario: Scenario, wired: bool = False) -> tuple[str, str]:
    """(kind in BOARDS, URL of the link that is used); ("none", "") without a board.

    A serial port has a board on its other end already: nobody has to be launched. For the Python board, link inproc is
    board inproc, and the other way round. wired: somebody starts the board by hand, so it needs a link that can be
    found.
    """
    board, link = scenario.board, scenario.link.url
    if board == "none":
        return "none", ""
    if "://" in board:
        return "wired", board
    if wired and link in ("inproc", "udp"):
        raise UsageError(f"link: expected pty, udp://HOST:PORT or serial://PATH to a board of its own, got {link!r}")
    if wired or (board == "process" and link.startswith("serial:")):
        return "wired", link
    if board in FIRMWARE:
        return board, link
    return ("inproc", "inproc") if "inproc" in (board, link) else (board, link)


def user_law_spec(scenario: Scenario) -> str:
    """`/abs/file.py:Class` of a user's own law, or ""."""
    if not is_user_law(scenario.law.name):
        return ""
    file = scenario.file_of("law.name")
    return f"{file.resolve()}:{scenario.law.name.rpartition(':')[2]}" if file is not None else ""


def _scheduled(scenario: Scenario) -> Scheduled:
    file = scenario.file_of("schedule")
    if file is None:
        return Scheduled(np.zeros((scenario.ticks, 3)))
    asked = read_schedule(file, scenario.period_s, scenario.ticks)
    return Scheduled(asked if scenario.actuators.kind == "wheels" else -asked)


def _loop(
    scenario: Scenario, clock: Clock, board: Counterpart, decides: Decides, recorder: Recorder, made: Orders | None
) -> Loop:
    rows = made.rows if made is not None else ()
    delay = scenario.transport_delay_ticks if made is not None else 0
    sensors, units = sensors_of(scenario)
    instruments = scenario_faults.given(scenario.sensors, scenario.actuators)
    planned = (
        *timeline.notices(scenario.events, scenario.period_us, scenario.ticks),
        *scenario_faults.notices(instruments, scenario.period_us, scenario.ticks),
    )
    return Loop(
        Timing(scenario.period_ns, delay, scenario.ticks),
        Scales(2.0**-scenario.torque_bits, 2.0**-scenario.wire.momentum_bits),
        plant_of(scenario),
        actuator_of(scenario),
        sensors,
        lambda tick: row_at(rows, tick),
        board,
        decides,
        recorder,
        clock,
        scenario.metrics.diverged_deg,
        planned,
        units,
    )
