"""A torque schedule from CSV: the plant alone, without a board.

Columns t, u1, u2, u3 (others are ignored): from t seconds on, u_i in N m is the motor torque ON wheel i, so the body
gets -u_i. A row takes effect at the first tick not before its time and holds until the next; zero before the first.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sil.scenario_errors import Problem, ScenarioInvalid
from sil.signals import Vector

if TYPE_CHECKING:
    from _csv import Reader

COLUMNS = ("t", "u1", "u2", "u3")

Row = tuple[float, float, float, float]  # t_s, motor torque on the wheels in N m


def read_schedule(file: Path, period_s: float, ticks: int) -> Vector:
    """Torque on the body (ticks, 3) in N m, row k acting on [t_k, t_k+1); raises ScenarioInvalid with file and line."""
    try:
        with file.open(newline="", encoding="utf-8") as text:
            rows = np.array([(0.0, 0.0, 0.0, 0.0), *_rows(file, csv.reader(text))])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioInvalid([Problem(str(file), "schedule", "a readable CSV file", str(error))]) from None
    starts = np.concatenate([[-1.0], np.ceil(rows[1:, 0] / period_s - 1e-9)])  # tick at which a row takes over
    torque_B: Vector = -rows[np.searchsorted(starts, np.arange(ticks), side="right") - 1, 1:]
    return torque_B


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
