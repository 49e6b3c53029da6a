"""The lab's side of opening a session: HELLO until echoed, CONFIG until READY. States and rules: protocol/SPEC.md.

Wall-clock limits here only find a dead or foreign peer; nothing of a handshake's timing reaches run.mcap.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence

from protocol import config, frames
from protocol.frames import Hello, Packet, Ready, Stop, Type
from protocol.port import Port
from sil.trouble import LinkFailure

HELLO_EVERY_S = 0.2
CONFIG_EVERY_S = 2.0
TELL_EVERY_S = 10.0
READY_WITHIN_S = 300.0  # a law may take its time to compile on a slow machine; nobody compiles for longer
RESTARTS = 3
SOMEBODY_S = 3.0  # without a refusal by the network: somebody listens (a remote machine refuses once a second)
BUILD = "sil 0.1"
OTHER_VERSION = "take both from the same version; the C firmware is built anew with `make firmware`"

Notify = Callable[[str], None]


class Session:
    """One session after the other over `port`. `check_alive()` raises LinkFailure when the board's process is gone."""

    def __init__(self, port: Port, clock_rate_q16: int, check_alive: Callable[[], None]) -> None:
        self._port = port
        self._clock_rate_q16 = clock_rate_q16
        self._check_alive = check_alive
        self._words: Sequence[int] = ()
        self._table_hash = 0
        self._opening: Opening | None = None
        self._restarts = 0

    @property
    def board(self) -> Hello | None:
        """Who answered."""
        return self._opening.board if self._opening is not None else None

    @property
    def packets(self) -> list[bytes]:
        """CONFIG of the session as it was sent (they are deterministic frames)."""
        return self._opening.packets if self._opening is not None else []

    def open(self, words: Sequence[int], table_hash: int, within_s: float, notify: Notify) -> list[bytes]:
        """Say hello, configure, wait for READY. Returns the CONFIG packets.

        Raises LinkFailure: nobody answers, another protocol or layout, a refused word, another table.
        """
        self._words, self._table_hash = words, table_hash
        opening = self.again(within_s, _patience(notify), self._restarted)
        while not opening.done:
            packet = self._port.receive(opening.poll())
            if packet is not None:
                opening.take(packet)
        return opening.packets

    def again(self, within_s: float, waiting: Callable[[float], None], restarted: Callable[[], None]) -> Opening:
        """The same configuration in a session with a nonce of its own; who calls this polls it until it is done.

        waiting(s): READY is still to come after so many seconds. restarted(): see Opening.
        """
        nonce = 1 + secrets.randbelow(2**64 - 1)  # 0 means no session
        hello = Hello(
            frames.PROTOCOL_VERSION, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, nonce, self._clock_rate_q16, BUILD
        )
        self._opening = Opening(
            self._port, hello, self._words, self._table_hash, self._check_alive, within_s, waiting, restarted
        )
        return self._opening

    def close(self, reason: int) -> None:
        """STOP, so that the board forgets the session; a link that is already gone is no matter."""
        self._port.send(Stop(reason))

    def _restarted(self) -> None:
        self._restarts += 1
        if self._restarts == RESTARTS:
            raise LinkFailure(f"board: it restarted {RESTARTS} times while it was configured")


class Opening:
    """A session on its way to READY, by one packet (`take`) or one look at the clock (`poll`) at a time.

    restarted(): the board lost the nonce while it was configured; raises LinkFailure when that is once too often.
    """

    def __init__(
        self,
        port: Port,
        hello: Hello,
        words: Sequence[int],
        table_hash: int,
        check_alive: Callable[[], None],
        within_s: float,
        waiting: Callable[[float], None],
        restarted: Callable[[], None],
    ) -> None:
        self._port, self._hello, self._words, self._table_hash = port, hello, words, table_hash
        self._check_alive, self._within_s, self._waiting, self._restarted = check_alive, within_s, waiting, restarted
        self.board: Hello | None = None  # who echoed
        self.packets: list[bytes] = []
        self.done = False
        self._begin()

    def _begin(self) -> None:
        self._began_s = time.monotonic()
        self._due_s = 0.0  # when HELLO or CONFIG is sent again; 0: now, for the first time
        self._tell_s = 0.0
        self._refused, self._refused_s = self._port.link.refused, self._began_s

    def poll(self) -> float:
        """Send what is due, HELLO or CONFIG; returns for how many seconds nothing else will be. Raises LinkFailure."""
        now = time.monotonic()
        if now >= self._due_s:
            (self._configure if self.packets else self._greet)(now)
        return max(0.0, self._due_s - now)

    def take(self, packet: Packet) -> None:
        """One frame of the board. What is no step towards READY belongs to another time, and is dropped."""
        if not self.packets:
            if packet.type == Type.HELLO and self._is_echo(packet.frame):
                self._echoed(packet.frame)
        elif packet.type == Type.READY:
            self._ready(packet.frame)
        elif says_restart(packet):
            self.board, self.packets = None, []
            self._restarted()
            self._begin()
            self.poll()

    # -- HELLO ---------------------------------------------------------------------------------------------------------

    def _greet(self, now: float) -> None:
        if self._due_s:
            self._check_alive()
            if self._port.link.refused != self._refused:
                self._refused, self._refused_s = self._port.link.refused, now
            if now > self._began_s + self._within_s:
                raise LinkFailure(f"board: no HELLO within {self._within_s:g} s{self._why_silent(now)}")
        self._port.send(self._hello)
        self._due_s = now + HELLO_EVERY_S

    def _why_silent(self, now: float) -> str:
        """A board that another laboratory flies is silent (SPEC 4), but the network knows that its port is open."""
        if self._refused is None or now < self._refused_s + min(SOMEBODY_S, 0.5 * self._within_s):
            return ": is it running and on this link?"
        return ", though somebody listens there: has another laboratory taken the board, or does it hang?"

    def _is_echo(self, hello: Hello) -> bool:
        ours = hello.role == frames.ROLE_BOARD and hello.nonce == self._hello.nonce
        return ours and bool(hello.flags & frames.HELLO_ECHO)

    def _echoed(self, board: Hello) -> None:
        """Sequences restart at 0, and CONFIG leaves at once."""
        self.board = board
        if board.protocol_version != frames.PROTOCOL_VERSION:
            raise LinkFailure(
                f"board {board.build!r}: expected protocol {frames.PROTOCOL_VERSION}, "
                f"got {board.protocol_version}: {OTHER_VERSION}"
            )
        if board.layout_hash != frames.LAYOUT_HASH:
            raise LinkFailure(
                f"board {board.build!r}: expected layout {frames.LAYOUT_HASH:08x}, "
                f"got {board.layout_hash:08x}, built from other frame layouts: {OTHER_VERSION}"
            )
        if self._hello.clock_rate_q16 and not board.flags & frames.HELLO_OWN_TIMER:
            raise LinkFailure(
                f"board {board.build!r}: expected one with its own timer for a paced clock, got one without: "
                "use --clock lockstep"
            )
        self._port.reset()
        self.packets = [self._port.pack(part) for part in config.split(self._words)]
        self._begin()
        self.poll()

    # -- CONFIG --------------------------------------------------------------------------------------------------------

    def _configure(self, now: float) -> None:
        """CONFIG is idempotent: the same packets again until READY, for as long as the board lives."""
        if self._due_s:
            self._check_alive()
            waited_s = now - self._began_s
            if waited_s > READY_WITHIN_S:
                raise LinkFailure(f"board: not ready within {READY_WITHIN_S:g} s")
            if now >= self._tell_s:
                self._tell_s = now + TELL_EVERY_S
                self._waiting(waited_s)
        self._port.write(*self.packets)
        self._due_s = now + CONFIG_EVERY_S

    def _ready(self, ready: Ready) -> None:
        reasons = {
            frames.READY_BAD_WORD: f"CONFIG word {ready.index} is out of its range",
            frames.READY_UNKNOWN_LAW: "it does not know this law or version",
            frames.READY_LAW_REFUSES: "the law refuses this period, transport delay, reading or arithmetic",
            frames.READY_MISSING_PARTS: "CONFIG words are missing",
        }
        if ready.status != frames.READY_OK:
            raise LinkFailure(f"board: not ready: {reasons.get(ready.status, f'status {ready.status}')}")
        if ready.table_hash != self._table_hash:
            raise LinkFailure(
                f"board: READY with table {ready.table_hash:08x}, expected {self._table_hash:08x}: "
                "board and laboratory disagree about the law's table"
            )
        self.done = True


def _patience(notify: Notify) -> Callable[[float], None]:
    """What is said while READY does not come: at first that a law takes its time to compile, then how long it takes."""
    lines = iter(("the board is compiling its law (first run only)",))
    return lambda waited_s: notify(next(lines, f"still waiting for the board to be ready: {waited_s:.0f} s"))


def says_restart(packet: Packet) -> bool:
    """A board that says HELLO unasked has lost its session, if it ever had one: it was restarted."""
    if packet.type != Type.HELLO:
        return False
    hello: Hello = packet.frame
    return hello.role == frames.ROLE_BOARD and not hello.flags & frames.HELLO_ECHO
