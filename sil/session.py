"""The lab's side of opening a session: HELLO until echoed, CONFIG until READY. States and rules: protocol/SPEC.md.

Wall-clock limits here only find a dead or foreign peer; nothing of a handshake's timing reaches run.mcap.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from protocol import config, frames
from protocol.frames import Hello, Packet, Ready, Stop, Type
from protocol.port import Port
from sil.trouble import LinkFailure

HELLO_EVERY_S = 0.2
CONFIG_EVERY_S = 2.0
TELL_EVERY_S = 10.0
READY_WITHIN_S = 300.0  # a law may take its time to compile on a slow machine; nobody compiles for longer
RESTARTS = 3
BUILD = "sil 0.1"
OTHER_VERSION = "take both from the same version; the C firmware is built anew with `make firmware`"

_T = TypeVar("_T")


class Session:
    """One session over `port`. `check_alive()` raises LinkFailure when the board's process is gone."""

    def __init__(self, port: Port, clock_rate_q16: int, check_alive: Callable[[], None]) -> None:
        self._port = port
        self._check_alive = check_alive
        self._nonce = 1 + secrets.randbelow(2**64 - 1)  # 0 means no session
        self._hello = Hello(
            frames.PROTOCOL_VERSION, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, self._nonce, clock_rate_q16, BUILD
        )
        self.board: Hello | None = None  # who answered

    def open(
        self, words: Sequence[int], table_hash: int, within_s: float, notify: Callable[[str], None]
    ) -> list[bytes]:
        """Say hello, configure, wait for READY. Returns the CONFIG packets (they are deterministic frames).

        Raises LinkFailure: nobody answers, another protocol or layout, a refused word, another table.
        """
        for _ in range(RESTARTS):
            self._greet(within_s)
            self._port.reset()
            packets = [self._port.pack(part) for part in config.split(words)]
            ready = self._configure(packets, notify)
            if ready is not None:
                break
        else:
            raise LinkFailure(f"board: it restarted {RESTARTS} times while it was configured")
        if ready.table_hash != table_hash:
            raise LinkFailure(
                f"board: READY with table {ready.table_hash:08x}, expected {table_hash:08x}: "
                "board and laboratory disagree about the law's table"
            )
        return packets

    def close(self, reason: int) -> None:
        """STOP, so that the board forgets the session; a link that is already gone is no matter."""
        self._port.send(Stop(reason))

    def _greet(self, within_s: float) -> None:
        give_up = time.monotonic() + within_s
        self.board = None
        while self.board is None:
            self._port.send(self._hello)
            self.board = self._await(HELLO_EVERY_S, self._is_echo)
            if self.board is None:
                self._check_alive()
                if time.monotonic() > give_up:
                    raise LinkFailure(f"board: no HELLO within {within_s:g} s: is it running and on this link?")
        if self.board.protocol_version != frames.PROTOCOL_VERSION:
            raise LinkFailure(
                f"board {self.board.build!r}: expected protocol {frames.PROTOCOL_VERSION}, "
                f"got {self.board.protocol_version}: {OTHER_VERSION}"
            )
        if self.board.layout_hash != frames.LAYOUT_HASH:
            raise LinkFailure(
                f"board {self.board.build!r}: expected layout {frames.LAYOUT_HASH:08x}, "
                f"got {self.board.layout_hash:08x}, built from other frame layouts: {OTHER_VERSION}"
            )
        if self._hello.clock_rate_q16 and not self.board.flags & frames.HELLO_OWN_TIMER:
            raise LinkFailure(
                f"board {self.board.build!r}: expected one with its own timer for a paced clock, got one without: "
                "use --clock lockstep"
            )

    def _is_echo(self, packet: Packet) -> Hello | None:
        if packet.type != Type.HELLO:
            return None
        hello: Hello = packet.frame
        ours = hello.role == frames.ROLE_BOARD and hello.nonce == self._nonce and hello.flags & frames.HELLO_ECHO
        return hello if ours else None

    def _configure(self, packets: list[bytes], notify: Callable[[str], None]) -> Ready | None:
        """CONFIG is idempotent: the same packets again until READY, for as long as the board lives.

        None: the board says HELLO unasked, so it was restarted and knows nothing of this session.
        """
        began = time.monotonic()
        while (waited_s := time.monotonic() - began) < READY_WITHIN_S:
            self._port.write(*packets)
            answer = self._await(CONFIG_EVERY_S, self._is_ready_or_restart)
            if isinstance(answer, Ready):
                return self._accepted(answer)
            if answer is not None:
                return None
            self._check_alive()
            if waited_s < CONFIG_EVERY_S:
                notify("the board is compiling its law (first run only)")
            elif waited_s % TELL_EVERY_S < CONFIG_EVERY_S:
                notify(f"still waiting for the board to be ready: {waited_s:.0f} s")
        raise LinkFailure(f"board: not ready within {READY_WITHIN_S:g} s")

    @staticmethod
    def _is_ready_or_restart(packet: Packet) -> Ready | Hello | None:
        frame: Ready | Hello = packet.frame
        restarted = packet.type == Type.HELLO and not packet.frame.flags & frames.HELLO_ECHO
        return frame if packet.type == Type.READY or restarted else None

    @staticmethod
    def _accepted(ready: Ready) -> Ready:
        if ready.status == frames.READY_OK:
            return ready
        reasons = {
            frames.READY_BAD_WORD: f"CONFIG word {ready.index} is out of its range",
            frames.READY_UNKNOWN_LAW: "it does not know this law or version",
            frames.READY_LAW_REFUSES: "the law refuses this period, transport delay, reading or arithmetic",
            frames.READY_MISSING_PARTS: "CONFIG words are missing",
        }
        raise LinkFailure(f"board: not ready: {reasons.get(ready.status, f'status {ready.status}')}")

    def _await(self, within_s: float, wanted: Callable[[Packet], _T | None]) -> _T | None:
        give_up = time.monotonic() + within_s
        while (left := give_up - time.monotonic()) > 0:
            packet = self._port.receive(left)
            if packet is not None and (found := wanted(packet)) is not None:
                return found
        return None
