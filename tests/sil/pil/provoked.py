"""A machine with the firmware of provoked.c, which misbehaves on command."""

from __future__ import annotations

from typing import NamedTuple

from sil.pil.machine import Machine


class Provoked(NamedTuple):
    """A machine with that firmware, out of reset, and what it told."""

    machine: Machine
    told: list[str]

    def says(self, command: str) -> str:
        return self.machine.exchange(command.encode()).decode()
