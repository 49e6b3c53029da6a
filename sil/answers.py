"""What the laboratory knows of the board while a run goes on: samples sent, answers received, what is missing.

A tick's answer is COMMAND(k) and the TELEMETRY and EVENT frames it announces. In lockstep `drain` waits for the whole
answer; in real time it takes what is there. The modelled arrival alone decides whether a command is in time.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable

from protocol import events, frames
from protocol.channel import TO_BOARD, TO_LAB, Channel, Fate
from protocol.frames import Command, Packet, Sample, Telemetry, Tick, Type
from protocol.port import Port
from sil.commands import CommandWindow, ExecutionModel
from sil.signals import Recorder
from sil.sinks.journal import NO_ANSWER, Direction
from sil.sinks.journal import Fate as Outcome
from sil.trouble import LinkFailure

ENCODED_EXTRA = 3  # COBS adds one byte to a packet of up to 254, and a zero stands on either side
LOOK_EVERY_S = 0.25
INTERRUPTED_WAIT_ns = 1_000_000_000
REMEMBERED_TICKS = 256
EARLY_LIMIT = 1024  # frames; a laboratory that stood still for longer has lost the rest
ANSWERS = (Type.COMMAND, Type.TELEMETRY, Type.EVENT)


class Answers:
    """The board as the loop sees it. `check_alive()` raises LinkFailure when the board's process is gone."""

    def __init__(
        self,
        port: Port,
        channel: Channel,
        model: ExecutionModel,
        window: CommandWindow,
        recorder: Recorder,
        torque_Nm: float,
        lockstep: bool,
        check_alive: Callable[[], None],
        dead_after_s: float,
    ) -> None:
        self._port, self._channel, self._model, self._window = port, channel, model, window
        self._recorder, self._torque_Nm, self._lockstep = recorder, torque_Nm, lockstep
        self._check_alive, self._dead_after_s = check_alive, dead_after_s
        self._tick = -1  # newest tick a SAMPLE was sent for
        self._complete = -1  # newest tick whose whole answer is here
        self._followers = 0  # frames still to come of the answer under way
        self._done_ns: dict[int, int] = {}
        self._should_use: set[int] = set()  # ticks whose SAMPLE the board has in time, by the model
        self._early: list[Packet] = []  # answers to ticks that are still to come: the board's own timer was faster
        self._sent_wall_ns = 0
        self._advanced_wall_ns = time.monotonic_ns()
        self.answer_ns = array("q")
        self.last_answer_ns = NO_ANSWER
        self.telemetry: Telemetry | None = None  # the newest that came, for whoever watches
        self.strays = 0  # frames that belong to no answer under way: repeated, too old, too far ahead; dropped
        self._sample_size = 0  # bytes on the wire

    # -- up ------------------------------------------------------------------------------------------------------

    def send(self, sample: Sample, t_ns: int) -> None:
        """SAMPLE(k), or in lockstep TICK(k) where the link does not deliver it (TICK is never faulted)."""
        tick = self._tick = sample.tick
        self.last_answer_ns = NO_ANSWER
        if not self._sample_size:
            self._sample_size = len(frames.pack(sample, 0)) + ENCODED_EXTRA
        fate = self._channel.fate(TO_BOARD, tick, Type.SAMPLE, 0, self._sample_size, t_ns)
        transit_us = (fate.arrival_ns - t_ns) // 1000
        packet = self._port.pack(sample._replace(transit_us=transit_us))
        self._sent_wall_ns = time.monotonic_ns()
        if fate.delivered:
            self._port.write(packet)
        elif self._lockstep:
            self._port.send(Tick(tick))
        self._recorder.packet(tick, Direction.UP, Outcome.DELIVERED if fate.delivered else Outcome.DROPPED, packet)
        self._done_ns[tick] = self._model.done_ns(tick, transit_us * 1000 if fate.delivered else None)
        if fate.delivered and not self._model.overrun and sample.valid == self._valid_mask(sample):
            self._should_use.add(tick)
        self._done_ns.pop(tick - REMEMBERED_TICKS, None)
        self._should_use.discard(tick - REMEMBERED_TICKS)
        if self._early:
            self._take_early()

    @staticmethod
    def _valid_mask(sample: Sample) -> int:
        return sum(1 << bit for bit, reading in enumerate(sample.readings) if reading is not None)

    def _take_early(self) -> None:
        early, self._early = self._early, []
        for packet in early:
            self._take(packet)

    # -- down ----------------------------------------------------------------------------------------------------

    def drain(self, tick: int) -> None:
        """Lockstep: wait until the whole answer to `tick` is here. Real time: take what has come by now."""
        if self._lockstep:
            self._await(tick)
            return
        while (packet := self._port.receive(0.0)) is not None:
            self._take(packet)
        self._watch_silence()

    def listen(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` for a frame and take it; what a paced clock does between ticks."""
        packet = self._port.receive(timeout_s)
        if packet is not None:
            self._take(packet)

    def finish(self, tick: int, overdue: bool) -> None:
        """The last answer that counts. `overdue`: its tick is over, so one that is not here by now is a real miss.

        It is waited for all the same: a board that never gives it is dead, and the run has failed. Who interrupts a run
        does not wait for a dead board.
        """
        if not overdue:
            give_up_ns = time.monotonic_ns() + INTERRUPTED_WAIT_ns
            self._await(tick, lambda: time.monotonic_ns() > give_up_ns)
            return
        if not self._lockstep:
            self.drain(tick)
            if self._complete < tick:
                self._window.unanswered(tick)
        self._await(tick)

    def _await(self, tick: int, given_up: Callable[[], bool] = lambda: False) -> None:
        while (self._complete < tick or self._followers) and not given_up():
            packet = self._port.receive(LOOK_EVERY_S)
            if packet is not None:
                self._take(packet)
            self._watch_silence()

    def _watch_silence(self) -> None:
        """Wall limits only detect a dead peer, they decide no byte. Only what advances an answer ends a silence."""
        silent_s = (time.monotonic_ns() - max(self._advanced_wall_ns, self._sent_wall_ns)) * 1e-9
        if silent_s < LOOK_EVERY_S or (self._complete >= self._tick and not self._followers):
            return
        self._check_alive()
        if silent_s > self._dead_after_s:
            missing = f"{self._followers} frames too few of the answer to" if self._followers else "no answer to"
            tick = self._complete if self._followers else self._complete + 1
            raise LinkFailure(f"board: {missing} tick {tick} in {self._dead_after_s:g} s")

    def _take(self, packet: Packet) -> None:
        kind = packet.type
        if kind in ANSWERS and packet.tick > self._tick:
            if len(self._early) < EARLY_LIMIT:
                self._early.append(packet)
            else:
                self.strays += 1
        elif kind == Type.COMMAND:
            self._command(packet)
        elif kind in (Type.TELEMETRY, Type.EVENT):
            self._follower(packet)
        elif kind == Type.HELLO and not packet.frame.flags & frames.HELLO_ECHO:
            self._recorder.event(max(self._tick, 0), events.BOARD_RESTARTED, max(self._tick, 0), 0)
            raise LinkFailure(f"board: restarted after tick {self._complete} (it says HELLO unasked)")

    def _command(self, packet: Packet) -> None:
        command: Command = packet.frame
        tick = command.tick
        if tick <= self._complete or tick not in self._done_ns:
            self.strays += 1
            return
        if self._followers:
            self._window.incomplete(self._complete)
        now_ns = self._advanced_wall_ns = time.monotonic_ns()
        self._complete, self._followers = tick, command.follows
        if command.used in (frames.PROPAGATED, frames.REPEATED) and tick in self._should_use:
            self._window.board_was_faster(tick)
        if tick == self._tick:
            self.last_answer_ns = now_ns - self._sent_wall_ns
            self.answer_ns.append(self.last_answer_ns)
        fate = self._fate(packet)
        if not fate.delivered:
            self._window.lost(tick)
            self._recorder.packet(tick, Direction.DOWN, Outcome.DROPPED, packet.raw)
            return
        x, y, z = command.torque
        unit = self._torque_Nm
        in_time = self._window.arrive(tick, (x * unit, y * unit, z * unit), fate.arrival_ns)
        self._recorder.packet(tick, Direction.DOWN, Outcome.DELIVERED if in_time else Outcome.LATE, packet.raw)

    def _follower(self, packet: Packet) -> None:
        """TELEMETRY or EVENT of the answer under way."""
        if packet.tick != self._complete or not self._followers:
            self.strays += 1
            return
        self._followers -= 1
        self._advanced_wall_ns = time.monotonic_ns()
        outcome = Outcome.DELIVERED if self._fate(packet).delivered else Outcome.DROPPED
        if packet.type == Type.TELEMETRY and outcome is Outcome.DELIVERED:
            self.telemetry = packet.frame
        self._recorder.packet(packet.tick, Direction.DOWN, outcome, packet.raw)

    def _fate(self, packet: Packet) -> Fate:
        sent_ns = self._done_ns.get(packet.tick, 0)
        return self._channel.fate(TO_LAB, packet.tick, packet.type, 0, len(packet.raw) + ENCODED_EXTRA, sent_ns)
