"""Flights through the firmware's meter, a process for each law, and what came out: the figures of a report.

The processes are `python -m sil.pil.budget`: the emulator is theirs alone.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sil.budget.flight import Flight
from sil.launched import child_environment
from sil.trouble import EXIT_USAGE, LinkFailure, UsageError

COUNTED = ("law_step", "board_step", "answer", "answer_bytewise")


class Instructions(NamedTuple):
    """Of every call, or of every answer."""

    calls: int
    min: int
    mean: float
    max: int


class Cost(NamedTuple):
    """What one law costs. `answer`: from the SAMPLE's first byte in to the last byte of the answer out, the SAMPLE in
    one burst; `answer_bytewise`: each byte with an interrupt of its own, as a UART has it; every twentieth tick."""

    law_step: Instructions
    board_step: Instructions
    answer: Instructions
    answer_bytewise: Instructions
    stack_bytes: int


class Budget(NamedTuple):
    """`laws`: by name. `image_bytes`: code, data, ram, stack_reserved. `build`: of the image, as HELLO says it."""

    build: str
    ticks: int
    image_bytes: dict[str, int]
    laws: dict[str, Cost]

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        laws = {
            name: {part: getattr(cost, part)._asdict() for part in COUNTED} | {"stack_bytes": cost.stack_bytes}
            for name, cost in self.laws.items()
        }
        return {"build": self.build, "ticks": self.ticks, "image_bytes": self.image_bytes, "laws": laws}


def measure(flights: Sequence[Flight], image: Path | None = None) -> Budget:
    """All at the same time. Raises UsageError (no unicorn, no image), LinkFailure (the image answers otherwise)."""
    with tempfile.TemporaryDirectory(prefix="sil-budget-") as folder:
        found = _counted(flights, image, Path(folder))
    laws = {flight.law: _cost(figures) for flight, figures in zip(flights, found, strict=True)}
    ticks = max(len(flight.ticks) for flight in flights)
    return Budget(found[0]["build"], ticks, found[0]["image_bytes"], laws)


def _counted(flights: Iterable[Flight], image: Path | None, folder: Path) -> list[dict[str, Any]]:
    children = []
    try:
        for flight in flights:
            children.append(_Child(flight, image, folder))
        return [child.figures() for child in children]
    finally:
        for child in children:
            child.end()


class _Child:
    """One meter at work; files take its input and output, so that no pipe is waited for."""

    def __init__(self, flight: Flight, image: Path | None, folder: Path) -> None:
        order = folder / f"{flight.law}.json"
        order.write_text(json.dumps(flight.plain()), encoding="utf-8")
        self._out, self._err = folder / f"{flight.law}.out", folder / f"{flight.law}.err"
        options = ["--image", str(image)] if image is not None else []
        with order.open("rb") as stdin, self._out.open("wb") as stdout, self._err.open("wb") as stderr:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "sil.pil.budget", "--parent", str(os.getpid()), *options],
                stdin=stdin,
                stdout=stdout,
                stderr=stderr,
                env=child_environment(),
            )

    def figures(self) -> dict[str, Any]:
        code = self._process.wait()
        if code == 0:
            found: dict[str, Any] = json.loads(self._out.read_text(encoding="utf-8"))
            return found
        lines = [line for line in self._err.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
        line = lines[-1] if lines else f"the meter ended with exit code {code}"
        raise UsageError(line) if code == EXIT_USAGE else LinkFailure(line)

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


def _cost(figures: dict[str, Any]) -> Cost:
    law_step, board_step, answer, bytewise = (_instructions(figures[part]) for part in COUNTED)
    return Cost(law_step, board_step, answer, bytewise, int(figures["stack_bytes"]))


def _instructions(calls: Sequence[int]) -> Instructions:
    if not calls:
        return Instructions(0, 0, 0.0, 0)
    return Instructions(len(calls), min(calls), round(statistics.mean(calls), 1), max(calls))
