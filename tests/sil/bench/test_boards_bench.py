"""Bench `boards`: one that cannot be had is said, and the others have their figures all the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil.bench import boards
from sil.bench.book import Book, Plan
from sil.trouble import UsageError

SPEEDS = {"inproc": 3000.0, "process": 1000.0, "native": 2000.0, "cortex-m": 700.0}


def measured(monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...] = ()) -> Book:
    def speed(board: str, duration_s: int, folder: Path) -> float:
        if board in missing:
            raise UsageError(f"{board}: needs something")
        return SPEEDS[board]

    monkeypatch.setattr(boards, "_speed", speed)
    book = Book("boards")
    boards.Boards().measure(Plan(2, quick=True), book)
    return book


def test_every_board_is_held_against_the_python_board(monkeypatch: pytest.MonkeyPatch) -> None:
    book = measured(monkeypatch)
    assert {line.case: line.ratios for line in book.lines} == {
        "inproc": [3.0, 3.0], "native": [2.0, 2.0], "cortex-m": [0.7, 0.7]
    }  # fmt: skip
    assert [line.met for line in book.lines] == [None, True, True]
    assert book.notes == []


def test_goals_can_be_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SPEEDS, "native", 990.0)
    monkeypatch.setitem(SPEEDS, "cortex-m", 399.0)
    assert [line.met for line in measured(monkeypatch).lines] == [None, False, False]


def test_a_board_that_cannot_be_had_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    book = measured(monkeypatch, missing=("cortex-m",))
    assert [line.case for line in book.lines] == ["inproc", "native"]
    assert book.notes == ["board cortex-m, left out: cortex-m: needs something"]


def test_without_the_board_beside_there_are_no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    assert measured(monkeypatch, missing=("process",)).lines == []


def test_the_runs_are_real(tmp_path: Path) -> None:
    assert boards._speed("inproc", 10, tmp_path / "run") > 0.0
