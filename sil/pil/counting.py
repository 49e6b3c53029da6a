"""Instructions that the firmware executes: all of them, and those of chosen functions, call by call.

Counted by straight pieces of code, whose lengths are decoded. An instruction that an IT block skips takes its cycle,
too, and a hook on every instruction would miss it. Instructions are not cycles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sil.pil.machine import Machine


class Counter:
    """Counts on `machine` from now on. `total`: instructions so far, the piece under way counted whole.

    `calls` of a function: instructions of each call of it, callees included, in order; watch() asks for them.
    """

    def __init__(self, machine: Machine) -> None:
        self.total = 0
        self._machine = machine
        self._lengths: dict[tuple[int, int], int] = {}
        self._watched: dict[int, tuple[str, list[int]]] = {}
        self._returns: dict[int, tuple[list[int], int]] = {}  # where to, and what was counted before the call
        machine.engine.on_block(self._counter())

    def watch(self, function: str) -> list[int]:
        """The list that will hold the instructions of each call. Raises KeyError when the image has no such symbol."""
        calls: list[int] = []
        self._watched[self._machine.image.symbols[function][0]] = (function, calls)
        return calls

    def _counter(self) -> Callable[[Any, int, int, Any], None]:
        lengths, watched, returns = self._lengths, self._watched, self._returns
        machine = self._machine
        stops_before = frozenset(machine.permits)

        def count(_handle: Any, address: int, size: int, _data: Any) -> None:
            if address in stops_before and machine.interrupt_waits:
                return  # it is left before it is executed, and counted when it is come back to
            if address in returns:
                calls, before = returns.pop(address)
                calls.append(self.total - before)
            if address in watched:
                returns[machine.link_register() & ~1] = (watched[address][1], self.total)
            key = (address, size)
            length = lengths.get(key)
            if length is None:
                length = lengths[key] = instructions(machine.engine.read(address, size))
            self.total += length

        return count


def instructions(code: bytes) -> int:
    """How many Thumb instructions: one of 32 bits begins with 0b11101, 0b11110 or 0b11111."""
    at = count = 0
    while at < len(code):
        at += 4 if code[at + 1] >> 3 >= 0b11101 else 2
        count += 1
    return count
