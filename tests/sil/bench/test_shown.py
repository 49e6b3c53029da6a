"""The table of benches: ratios first, at 80 and 160 columns; goals met or missed in words; the time left."""

from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from sil.bench import machine
from sil.bench.book import Book, Goal
from sil.bench.shown import Progress, goals_text, machine_text, number, show, show_book


def wakeup_book() -> Book:
    book = Book("wakeup", "wake-ups beside cyclictest", load=(0.5, 0.7))
    for ours in (10.0, 12.0):
        book.line("100 Hz FIFO 50, p50", "us", "cyclictest").add(ours, 20.0)
        book.line("100 Hz FIFO 50, p99", "us", "cyclictest", Goal(1.5)).add(ours * 10, 40.0)
    book.line("alone", "us").add(3.0)
    book.line("never", "us").ours.clear()
    book.note("SCHED_FIFO is not permitted here")
    return book


def shown(book: Book, width: int) -> list[str]:
    console = Console(file=io.StringIO(), width=width, highlight=False)
    show_book(console, book)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


@pytest.mark.parametrize("width", [80, 160])
def test_the_table_fits_and_says_ratio_spread_figures_and_goal(width: int) -> None:
    lines = shown(wakeup_book(), width)
    assert max(map(len, lines)) <= width
    rows = {line.split()[0]: line.split() for line in lines if line.split()}
    assert rows["ratio"] == ["ratio", "low", "high", "sil,", "us", "cyclictest", "goal"]
    assert rows["p50"] == ["p50", "0.55", "0.5", "0.6", "11", "20"]
    assert rows["p99"] == ["p99", "2.75", "2.5", "3", "110", "40", "missed", "<=", "1.5"]
    assert rows["alone"] == ["alone", "-", "3"]
    assert "never" not in rows
    assert rows["note:"][1:] == ["SCHED_FIFO", "is", "not", "permitted", "here"]


def test_a_goal_is_never_squeezed_out_of_a_narrow_table() -> None:
    """Long names, two long headers: the verdict is what a reader looks for."""
    book = Book("loop", "the whole loop")
    goal = Goal(5000.0, of="ours", at_most=False)
    book.line("in process without a log and so on, appc float", "x real time", "Basilisk", goal).add(5613.0, 4055.0)
    assert any("met sil >= 5000" in line for line in shown(book, 80))


def test_a_bench_that_could_not_run_says_why() -> None:
    book = Book("wakeup", "wake-ups", skipped="neither cyclictest nor a C compiler")
    assert any("skipped: neither cyclictest" in line for line in shown(book, 160))


def test_brackets_of_a_note_or_a_reason_are_shown() -> None:
    """They are no markup: without `[bench]` the command would install something else."""
    book = Book("loop", "about", skipped="no 'a[skipped]'", notes=["pip install 'attitude-sil[bench]'"])
    text = "".join(shown(book, 160))
    assert "'attitude-sil[bench]'" in text
    assert "'a[skipped]'" in text


def test_goals_are_counted_and_the_missed_ones_named() -> None:
    met = Book("law")
    met.line("appc, float", "us", "", Goal(5.0, of="ours")).add(1.0)
    text = goals_text([met, wakeup_book()])
    assert text == "goals: 1 of 2 met; [red]missed[/]: wakeup: 100 Hz FIFO 50, p99"
    assert goals_text([Book("plant")]) == "goals: none of what was measured has one"


def test_interrupted_is_said_after_what_was_finished(capsys: pytest.CaptureFixture[str]) -> None:
    show([wakeup_book()], machine.facts(), interrupted=True)
    out = capsys.readouterr().out
    assert out.index("p99") < out.index("interrupted")


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0152, "0.0152"), (1.4849, "1.48"), (35.51, "35.5"), (306.2, "306"), (999.9, "1,000"), (2905.8, "2,906")]
    + [
        (9999.0, "10 k"),
        (260_400.0, "260 k"),
        (999_900.0, "1 M"),
        (3_033_487.0, "3.03 M"),
        (0.0, "0"),
        (1e9, "1e+03 M"),
    ],
)
def test_a_number_has_three_digits(value: float, text: str) -> None:
    assert number(value) == text


@given(st.floats(1e-3, 1e8))
def test_a_number_reads_back_within_half_a_percent(value: float) -> None:
    digits, _, unit = number(value).replace(",", "").partition(" ")
    assert float(digits) * {"": 1, "k": 1e3, "M": 1e6}[unit] == pytest.approx(value, rel=6e-3)


def test_the_machine_is_named() -> None:
    text = machine_text(machine.facts())
    assert "CPU" in text
    assert "Python" in text
    assert "attitude-sil" in text


def test_the_time_left_counts_down_by_bench() -> None:
    """Not on a terminal: lines, and never more than what is left in all."""
    progress = Progress()
    progress.starts({"codec": 10.0, "law": 20.0})
    assert progress.left_s == 30.0
    progress.bench("codec")
    assert 20.0 < progress.left_s <= 30.0
    progress.done(Book("codec"))
    assert progress.left_s == 20.0
