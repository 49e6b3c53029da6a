"""A torque schedule from CSV in place of commands, and nobody in place of a board: the plant alone.

Columns t, u1, u2, u3 (others are ignored): from t seconds on, u_i in N m is the motor torque ON wheel i, so the body
gets -u_i. A row takes effect at the first tick not before its time and holds until the next; zero before the first.
"""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from protocol.frames import FRESH, NO_TICK, ZERO, Sample
from sil.commands import Acting
from sil.scenario_errors import Problem, ScenarioInvalid

if TYPE_CHECKING:
    from _csv import Reader

COLUMNS = ("t", "u1", "u2", "u3")

Row = tuple[float, float, float, float]  # t_s, motor torque on the wheels in N m


class Nobody:
    """The counterpart of a plant without a board: takes everything, answers nothing."""

    def send(self, sample: Sample, t_ns: int) -> None:
        """Nobody reads it."""

    def drain(self, tick: int) -> None:
        """Nothing ever comes."""

    def listen(self, timeout_s: float) -> None:
        """Nothing ever comes."""

    def finish(self, tick: int) -> None:
        """Nothing is open."""


class Schedule:
    """Decides by the rows of a schedule; without rows the torque is zero for ever."""

    def __init__(self, rows: Sequence[Row], period_s: float) -> None:
        self._ticks = [math.ceil(row[0] / period_s - 1e-9) for row in rows]
        self._torques = [(-row[1], -row[2], -row[3]) for row in rows]
        self._acting = Acting((0.0, 0.0, 0.0), ZERO, NO_TICK)
        self.notices: list[tuple[int, int, int]] = []

    @property
    def acting(self) -> Acting:
        """The last decision."""
        return self._acting

    def decide(self, due: int) -> Acting:
        """The torque on the body from tick `due` on."""
        place = bisect_right(self._ticks, due)
        if place:
            self._acting = Acting(self._torques[place - 1], FRESH, NO_TICK)
        return self._acting


def read_schedule(file: Path) -> list[Row]:
    """All rows of a schedule; raises ScenarioInvalid with file and line."""
    try:
        with file.open(newline="", encoding="utf-8") as text:
            return _rows(file, csv.reader(text))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioInvalid([Problem(str(file), "schedule", "a readable CSV file", str(error))]) from None


def _rows(file: Path, reader: Reader) -> list[Row]:
    header = [name.strip() for name in next(reader, [])]
    if missing := [name for name in COLUMNS if name not in header]:
        raise _invalid(file, 1, f"the columns {', '.join(COLUMNS)}", f"none called {missing[0]}")
    places = [header.index(name) for name in COLUMNS]
    rows: list[Row] = []
    for cells in reader:
        if not cells:
            continue
        row = _numbers(file, reader.line_num, cells, places)
        if rows and row[0] <= rows[-1][0]:
            raise _invalid(file, reader.line_num, f"a time after {rows[-1][0]:g} s, the row before", f"{row[0]:g}")
        rows.append(row)
    return rows


def _numbers(file: Path, line: int, cells: list[str], places: list[int]) -> Row:
    try:
        t_s, u1, u2, u3 = (float(cells[place]) for place in places)
    except (ValueError, IndexError):
        t_s = u1 = u2 = u3 = math.nan
    if not math.isfinite(t_s + u1 + u2 + u3):
        raise _invalid(file, line, "finite numbers t, u1, u2, u3", ",".join(cells)[:60])
    return t_s, u1, u2, u3


def _invalid(file: Path, line: int, expected: str, got: str) -> ScenarioInvalid:
    return ScenarioInvalid([Problem(f"{file}:{line}", "schedule", expected, got, line)])
