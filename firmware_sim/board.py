"""The board's main loop: one tick is stepped exactly once, by SAMPLE, by TICK or by its own timer, and always answered.

States (protocol/SPEC.md has the table): unconfigured -> configuring -> running. A HELLO with a new nonce resets the
board from any state; an unconfigured board answers anything with HELLO, which is how a restart is noticed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from firmware_sim.flight import Flight, FlightRefused
from firmware_sim.hal import Hal
from protocol import frames
from protocol.config import Assembly
from protocol.frames import AHEAD_LIMIT, Config, Hello, Packet, Ready, Sample, Type
from protocol.law_tables import ConfigError, LawTable
from protocol.port import Port

BUILD = "firmware_sim 1"
UserLawClass: TypeAlias = tuple[LawTable, type]


class Board:
    """Serves one laboratory at a time over `port`; knows no wall clock but `hal.now` and no plant at all.

    user_law: table and class of a law that is not built in (`firmware_sim.controllers.user`), or None. configured() is
    called when a law is built and warm, before READY leaves.
    """

    def __init__(
        self,
        port: Port,
        hal: Hal,
        user_law: UserLawClass | None = None,
        configured: Callable[[], None] = lambda: None,
    ) -> None:
        self._port = port
        self._hal = hal
        self._user_law = user_law
        self._configured = configured
        self._nonce: int | None = None
        self._clock_rate_q16 = 0
        self._handlers: dict[int, Callable[[Packet], None]] = {
            Type.HELLO: self._on_hello,
            Type.CONFIG: self._on_config,
            Type.SAMPLE: self._on_sample,
            Type.TICK: self._on_tick,
            Type.STOP: self._on_stop,
        }
        self.stopped = False
        self._forget()

    # -- main loop -----------------------------------------------------------------------------------------------

    def serve(self, once: bool) -> None:
        """Run until the link closes (LinkClosed reaches the caller) or, with `once`, until a session was stopped."""
        self.announce()
        while not (once and self.stopped):
            self._hal.kick()
            packet = self._hal.wait(self.timer_ns)
            if packet is not None:
                self.handle(packet)
            elif self.timer_ns is not None and self._hal.now() >= self.timer_ns:
                self.on_timer()

    def announce(self) -> None:
        """At boot the board sends nothing but HELLO, so a laboratory that was there first learns of the restart."""
        self._port.send(self._hello(echo=False))

    def handle(self, packet: Packet) -> None:
        """One frame from the laboratory, whatever the state."""
        handler = self._handlers.get(packet.type)
        if handler is None:
            return
        if self._nonce is None and packet.type != Type.HELLO:
            self._port.send(self._hello(echo=False))
            return
        handler(packet)

    # -- session -------------------------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._assembly = Assembly()
        self._ready: Ready | None = None
        self._flight: Flight | None = None
        self.timer_ns: int | None = None
        self._next_tick = 0

    def _hello(self, echo: bool) -> Hello:
        flags = frames.HELLO_OWN_TIMER
        flags |= frames.HELLO_CONFIGURED if self._flight else 0
        flags |= frames.HELLO_ECHO if echo else 0
        return Hello(frames.PROTOCOL_VERSION, frames.ROLE_BOARD, flags, frames.LAYOUT_HASH, self._nonce or 0, 0, BUILD)

    def _on_hello(self, packet: Packet) -> None:
        hello: Hello = packet.frame
        if hello.role != frames.ROLE_LAB:
            return
        if hello.nonce != self._nonce:
            self._forget()
            self._port.reset(forget=False)
            self._nonce = hello.nonce
            self._clock_rate_q16 = hello.clock_rate_q16
            self.stopped = False
        self._port.send(self._hello(echo=True))

    def _on_config(self, packet: Packet) -> None:
        part: Config = packet.frame
        if self._ready is None:
            if not self._assembly.add(part):
                return
            self._ready = self._configure()
        self._port.send(self._ready)

    def _configure(self) -> Ready:
        """Build the law, warm it up on a copy, and say READY: the next SAMPLE is answered in time."""
        words = self._assembly.words()
        if words is None:
            return Ready(frames.READY_MISSING_PARTS, frames.NO_INDEX, 0)
        try:
            self._flight = Flight(words, self._user_law)
        except ConfigError as error:
            return Ready(error.status, error.index, 0)
        except FlightRefused:
            return Ready(frames.READY_LAW_REFUSES, frames.NO_INDEX, 0)
        self._configured()
        return Ready(frames.READY_OK, frames.NO_INDEX, self._flight.table_hash)

    def _on_stop(self, packet: Packet) -> None:
        self._forget()
        self._nonce = None
        self.stopped = True

    # -- ticks ---------------------------------------------------------------------------------------------------

    def _on_sample(self, packet: Packet) -> None:
        flight = self._flight
        if flight is None:
            self._port.send(self._hello(echo=False))
            return
        sample: Sample = packet.frame
        if sample.tick < self._next_tick:
            flight.count_dropped(sample.tick)
            self._phase_timer(flight, self._next_tick - sample.tick)
            return
        if sample.tick - self._next_tick > AHEAD_LIMIT:
            flight.restart(self._next_tick, sample.tick)
            self._next_tick = sample.tick
        while self._next_tick < sample.tick:
            self._step(None)
        self._step(sample)
        self._phase_timer(flight, 1)

    def _on_tick(self, packet: Packet) -> None:
        """TICK(k), sent in lockstep where no valid SAMPLE(k) survived the link: step up to and including k."""
        if self._flight is None:
            self._port.send(self._hello(echo=False))
            return
        if packet.tick - self._next_tick > AHEAD_LIMIT:
            self._flight.restart(self._next_tick, packet.tick)
            self._next_tick = packet.tick
        while self._next_tick <= packet.tick:
            self._step(None)

    def on_timer(self) -> None:
        """The board's own timer: no SAMPLE came within sample_timeout of its expected arrival."""
        flight = self._flight
        if flight is None or self.timer_ns is None:
            return
        if self._next_tick == frames.NO_TICK:  # the last tick there is was stepped
            self.timer_ns = None
            return
        self.timer_ns += self._wall_ns(flight.period_ns)
        self._step(None)

    def _phase_timer(self, flight: Flight, ticks: int) -> None:
        """The SAMPLE of `_next_tick` is expected `ticks` periods from now.

        Each SAMPLE re-phases the timer, so clock drift accumulates only in gaps. A stale one does too: a laboratory
        that stood still (ticks are never skipped) finds the board ahead, and the board then waits for it.
        """
        if self._clock_rate_q16:
            self.timer_ns = self._hal.now() + self._wall_ns(ticks * flight.period_ns + flight.sample_timeout_ns)

    def _wall_ns(self, simulated_ns: int) -> int:
        return simulated_ns * 65536 // self._clock_rate_q16

    def _step(self, sample: Sample | None) -> None:
        flight = self._flight
        assert flight is not None
        answer = flight.step(self._next_tick, sample)
        self._next_tick += 1
        self._port.send(*answer)
