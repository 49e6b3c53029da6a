"""What the laboratory knows of the board while a run goes on: samples sent, answers received, what is missing.

A tick's answer is COMMAND(k) and the TELEMETRY and EVENT frames it announces. In lockstep `drain` waits for the whole
answer; in real time it takes what is there. The channel's model alone decides what arrives and whether it is in time.
Where the board restarts, unasked or as the scenario says, what it has not answered stays unanswered, and a new session
is opened (rejoin.py): in lockstep `drain` waits for it, too; a paced clock goes on, and its ticks are misses.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence

from protocol import frames
from protocol.channel import TO_BOARD, TO_LAB, Channel
from protocol.frames import Command, Packet, Sample, Telemetry, Tick, Type
from protocol.port import Port
from sil.commands import CommandWindow, ExecutionModel
from sil.fates import ENCODED_EXTRA, Copy, Stale, copies_of, first_arrival_ns, first_of
from sil.rejoin import Rejoin
from sil.session import says_restart
from sil.signals import Recorder
from sil.sinks.journal import NO_ANSWER, Direction
from sil.sinks.journal import Fate as Outcome
from sil.trouble import LinkFailure

LOOK_EVERY_S = 0.25
ASK_AFTER_S = 1.0  # of silence, and as often: a board that restarted may have had nobody to tell
INTERRUPTED_WAIT_ns = 1_000_000_000
REMEMBERED_TICKS = 256
RECENT_ANSWERS = 1000  # whose times are kept for whoever watches; the log has them all
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
        sample_timeout_ns: int,
        lockstep: bool,
        check_alive: Callable[[], None],
        dead_after_s: float,
        rejoin: Rejoin,
    ) -> None:
        self._port, self._channel, self._model, self._window = port, channel, model, window
        self._recorder, self._torque_Nm, self._lockstep = recorder, torque_Nm, lockstep
        self._sample_timeout_ns = sample_timeout_ns
        self._check_alive, self._dead_after_s = check_alive, dead_after_s
        self._rejoin = rejoin
        self._first = 0  # tick the session began with
        self._tick = -1  # newest tick a SAMPLE was sent for, or would have been, had there been a session
        self._complete = -1  # newest tick of which no more is to come: its whole answer is here, or the board lost it
        self._followers = 0  # frames still to come of the answer under way
        self._events = 0  # of the answer under way that are here
        self._timer_runs = False  # of the board: a SAMPLE of this session was in time
        self._stale = Stale()
        self._done_ns: dict[int, int] = {}
        self._should_use: set[int] = set()  # ticks whose SAMPLE the board has in time, by the model
        self._early: list[Packet] = []  # answers to ticks that are still to come: the board's own timer was faster
        self._sent_wall_ns = 0
        self._advanced_wall_ns = self._asked_wall_ns = time.monotonic_ns()
        self._knows_us = False  # it was asked since its last answer, and is in session
        self.answered = 0  # answers that came before the next SAMPLE left ...
        self.answer_ns: deque[int] = deque(maxlen=RECENT_ANSWERS)  # ... and how long the newest of them took
        self.last_answer_ns = NO_ANSWER
        self.telemetry: Telemetry | None = None  # the newest that came, for whoever watches
        self.corrupted = 0  # frames that the modelled link altered, copies apart
        self.strays = 0  # frames that belong to no answer under way: repeated, too old, too far ahead; dropped
        self._sample_size = 0  # bytes on the wire

    # -- up ------------------------------------------------------------------------------------------------------

    def send(self, sample: Sample, t_ns: int) -> None:
        """SAMPLE(k); where the link does not deliver it in time TICK(k), or nothing if the board's own timer steps."""
        tick = self._tick = sample.tick
        self.last_answer_ns = NO_ANSWER
        if self._rejoin.switches_off(tick):
            self._switched_off(tick)
        if self._rejoin.under_way or self._rejoin.off(tick):
            self._without_board(tick)
            return
        if self._rejoin.begins(tick):
            self._first, self._timer_runs = tick, False
            self._model.restart(tick)
        if not self._sample_size:
            self._sample_size = len(frames.pack(sample, 0)) + ENCODED_EXTRA
        fates = self._channel.fates(TO_BOARD, tick, Type.SAMPLE, 0, self._sample_size, t_ns)
        transit_us = (first_arrival_ns(fates, self._sample_size) - t_ns) // 1000
        packet = self._port.pack(sample._replace(transit_us=transit_us))
        copies = copies_of(packet, fates)
        self._sent_wall_ns = time.monotonic_ns()
        stepped = self._put(tick, t_ns, copies)
        for copy in copies:
            in_time = copy.arrival_ns <= t_ns + self._sample_timeout_ns
            self._record(tick, Direction.UP, packet, copy, in_time, copy.fate.slow)
        self._done_ns[tick] = self._model.done_ns(tick, transit_us * 1000 if stepped else None)
        if stepped and not self._model.overrun and sample.valid == self._valid_mask(sample):
            self._should_use.add(tick)
        self._done_ns.pop(tick - REMEMBERED_TICKS, None)
        self._should_use.discard(tick - REMEMBERED_TICKS)
        if self._early:
            self._take_early()

    def _put(self, tick: int, t_ns: int, copies: Sequence[Copy]) -> bool:
        """Copies of SAMPLE(tick) on the real link, behind stale ones that are there by now. True: one is in time."""
        first = first_of(copies)
        in_time = first is not None and first.arrival_ns <= t_ns + self._sample_timeout_ns
        for copy in copies:
            if copy.packet is None and copy.wire:
                self._port.write_altered(copy.wire)
            elif copy.packet is not None and not (in_time and copy is first):
                self._stale.add(copy.arrival_ns, tick, copy.number, copy.packet)
        if first is not None and first.packet is not None and in_time:
            self._timer_runs = True
            self._port.write(*(each.packet for each in self._stale.due(t_ns, tick)), first.packet)
        elif self._lockstep or not self._timer_runs:
            self._port.send(Tick(tick))
        return in_time

    def _record(
        self, tick: int, direction: Direction, packet: bytes, copy: Copy, in_time: bool = True, why_late: str = ""
    ) -> None:
        fate = copy.fate
        outcome, cause = copy.outcome(in_time), copy.cause(in_time, why_late)
        self.corrupted += outcome == Outcome.CORRUPTED and not copy.number
        self._recorder.packet(tick, direction, outcome, packet, cause, copy.number, fate.arrival_ns, copy.wire)

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
        if self._rejoin.under_way:
            self._rejoin.poll()
        self._watch_silence()

    def listen(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` for a frame and take it; what a paced clock does between ticks."""
        if self._rejoin.under_way:
            timeout_s = min(timeout_s, self._rejoin.poll())
        packet = self._port.receive(timeout_s)
        if packet is not None:
            self._take(packet)

    def finish(self, tick: int, overdue: bool) -> None:
        """The last answer that counts. `overdue`: its tick is over, so one that is not here by now is a real miss.

        It is waited for all the same: a board that never gives it, or does not come back from a restart, is dead, and
        the run has failed. Who interrupts a run does not wait for a dead board.
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
        while (self._complete < tick or self._followers or self._rejoin.under_way) and not given_up():
            wait_s = min(LOOK_EVERY_S, self._rejoin.poll()) if self._rejoin.under_way else LOOK_EVERY_S
            packet = self._port.receive(wait_s)
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
            raise LinkFailure(self._why_dead())
        if silent_s > ASK_AFTER_S and (time.monotonic_ns() - self._asked_wall_ns) * 1e-9 > ASK_AFTER_S:
            self._asked_wall_ns = time.monotonic_ns()
            self._rejoin.ask()

    def _why_dead(self) -> str:
        if self._followers:
            missing = f"{self._followers} frames too few of the answer to tick {self._complete}"
            return f"board: {missing} in {self._dead_after_s:g} s"
        missing = f"no answer to tick {self._complete + 1} in {self._dead_after_s:g} s"
        if self._knows_us:
            return f"board: {missing}, though it is there and in session: a frame was lost on the link"
        return f"board: it hangs: {missing}, and no watchdog has reset it"

    def _take(self, packet: Packet) -> None:
        kind = packet.type
        if self._rejoin.under_way:
            if self._rejoin.take(packet):
                self._advanced_wall_ns = time.monotonic_ns()
        elif kind in ANSWERS and packet.tick > self._tick:
            if len(self._early) < EARLY_LIMIT:
                self._early.append(packet)
            else:
                self._stray(packet.tick)
        elif kind == Type.COMMAND:
            self._command(packet)
        elif kind in (Type.TELEMETRY, Type.EVENT):
            self._follower(packet)
        elif kind == Type.READY:
            self._knows_us = True
        elif says_restart(packet):
            self._restarted()

    def _restarted(self) -> None:
        """What the board had not answered is lost with its memory. What it had answered still acts."""
        self._lost(self._tick)
        self._stale.forget()
        self._early.clear()
        self._should_use.clear()
        self._rejoin.restarted(max(self._tick, 0))

    def _switched_off(self, tick: int) -> None:
        """The scenario switches the board off before SAMPLE(tick). What it answered by the model has come by now."""
        if self._followers:
            self._window.incomplete(self._complete)
        self._complete, self._followers = tick - 1, 0
        self._stale.forget()
        self._early.clear()
        self._should_use.clear()
        self._rejoin.switch_off(tick)

    def _without_board(self, tick: int) -> None:
        """No session, no SAMPLE. A board that a planned restart should have brought back by now is the clock's miss."""
        if self._rejoin.overdue and not self._rejoin.off(tick):
            self._window.unanswered(tick)
            self._complete = tick
        else:
            self._lost(tick)

    def _lost(self, tick: int) -> None:
        """No more answers up to `tick`: COMMANDs that are not here are misses, and no real ones."""
        for each in range(self._complete + 1, tick + 1):
            self._window.lost(each)
        self._complete, self._followers = tick, 0

    def _command(self, packet: Packet) -> None:
        command: Command = packet.frame
        tick = command.tick
        if tick <= self._complete or tick not in self._done_ns:
            self._stray(tick)
            return
        if self._followers:
            self._window.incomplete(self._complete)
        now_ns = self._advanced_wall_ns = time.monotonic_ns()
        self._knows_us = False
        self._complete, self._followers = tick, command.follows
        if command.used in frames.WITHOUT_SAMPLE and tick in self._should_use:
            self._window.board_was_faster(tick)
        if tick == self._tick:
            self.last_answer_ns = now_ns - self._sent_wall_ns
            self.answered += 1
            self.answer_ns.append(self.last_answer_ns)
        self._events = 0
        copies = self._copies(packet, 0)
        self._arrived(tick, packet, copies)

    def _arrived(self, tick: int, packet: Packet, copies: Sequence[Copy]) -> None:
        """COMMAND(tick) as the modelled link delivers it: the first copy that is whole counts."""
        first = first_of(copies)
        acts = False
        if first is None or first.packet is None:
            self._window.lost(tick)
        else:
            command = packet.frame if first.packet == packet.raw else frames.unpack(first.packet).frame
            x, y, z = command.torque
            unit = self._torque_Nm
            acts = self._window.arrive(tick, (x * unit, y * unit, z * unit), first.arrival_ns)
        for copy in copies:
            in_time = acts if copy is first else self._window.in_time(tick, copy.arrival_ns)
            why_late = "" if in_time else self._why_late(tick, copy)
            self._record(tick, Direction.DOWN, packet.raw, copy, in_time, why_late)

    def _why_late(self, tick: int, copy: Copy) -> str:
        """By the model; or on the clock of this machine, where the model had it in time."""
        if self._window.in_time(tick, copy.arrival_ns):
            return "host clock"
        return copy.fate.slow if self._window.in_time(tick, self._done_ns[tick]) else "execution"

    def _follower(self, packet: Packet) -> None:
        """TELEMETRY or EVENT of the answer under way."""
        if packet.tick != self._complete or not self._followers:
            self._stray(packet.tick)
            return
        self._followers -= 1
        self._advanced_wall_ns = time.monotonic_ns()
        is_event = packet.type == Type.EVENT
        copies = self._copies(packet, self._events if is_event else 0)
        self._events += is_event
        if not is_event and first_of(copies) is not None:
            self.telemetry = packet.frame
        for copy in copies:
            self._record(packet.tick, Direction.DOWN, packet.raw, copy)

    def _stray(self, tick: int) -> None:
        """Dropped. A fresh board that is up to four ticks behind steps them and answers (B8): that is no anomaly."""
        self.strays += tick >= self._first

    def _copies(self, packet: Packet, number: int) -> list[Copy]:
        size, sent_ns = len(packet.raw) + ENCODED_EXTRA, self._done_ns.get(packet.tick, 0)
        return copies_of(packet.raw, self._channel.fates(TO_LAB, packet.tick, packet.type, number, size, sent_ns))
