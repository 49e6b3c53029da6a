"""QMP, QEMU's control channel: one JSON object a line, commands that return, and events that come when they like."""

from __future__ import annotations

import json
import select
import socket
import time
from typing import Any

ANSWER_S = 20.0


class QmpError(Exception):
    """QEMU is gone, silent, or refuses a command."""


class Qmp:
    """The far end of `-mon mode=control` on a connected socket. `events` holds what came and nobody has taken yet."""

    def __init__(self, channel: socket.socket) -> None:
        self._channel = channel
        self._rest = b""
        self.events: list[dict[str, Any]] = []

    def fileno(self) -> int:
        """To poll for events."""
        return self._channel.fileno()

    def open(self) -> None:
        """The greeting, and the end of negotiation: the machine is built by then. Raises QmpError."""
        self._next(time.monotonic() + ANSWER_S)
        self.run("qmp_capabilities")

    def run(self, command: str, **arguments: Any) -> Any:
        """What the command returns; events that come before are kept. Raises QmpError."""
        request = {"execute": command, "arguments": arguments}
        try:
            self._channel.sendall(json.dumps(request).encode() + b"\n")
        except OSError:
            raise QmpError(f"QMP {command}: QEMU is gone") from None
        deadline = time.monotonic() + ANSWER_S
        while True:
            answer = self._next(deadline)
            if "event" in answer:
                self.events.append(answer)
            elif "error" in answer:
                raise QmpError(f"QMP {command}: {answer['error'].get('desc', answer['error'])}")
            else:
                return answer.get("return")

    def take_events(self) -> list[dict[str, Any]]:
        """Every event so far; does not wait. Raises QmpError when QEMU is gone."""
        while self._readable(0.0):
            self.events.append(self._next(time.monotonic() + ANSWER_S))
        taken, self.events = self.events, []
        return taken

    def close(self) -> None:
        """QEMU does not mind."""
        self._channel.close()

    def _next(self, deadline: float) -> dict[str, Any]:
        while b"\n" not in self._rest:
            if not self._readable(deadline - time.monotonic()):
                raise QmpError(f"QMP: no answer within {ANSWER_S:g} s")
            try:
                data = self._channel.recv(65536)
            except OSError:
                data = b""
            if not data:
                raise QmpError("QMP: QEMU is gone")
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\n")
        found: dict[str, Any] = json.loads(line)
        return found

    def _readable(self, timeout_s: float) -> bool:
        if b"\n" in self._rest:
            return True
        return bool(select.select([self._channel], [], [], max(0.0, timeout_s))[0])
