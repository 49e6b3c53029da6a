"""How benches look: progress on stderr while they run, tables on stdout, ratios first, and goals met or missed."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from sil.bench.book import Book, Line, spread
from sil.bench.series import Watch

PLAIN_EVERY_S = 10.0


class Progress(Watch):
    """What is running and how much time is left: a bar on a terminal, a line now and then elsewhere.

    Drawn only between two measurements: a thread that redraws would be measured, too.
    """

    def __init__(self) -> None:
        self._expected: dict[str, float] = {}
        self._done_s = 0.0
        self._present = ""
        self._began = self._said = 0.0
        self._bar: Any = None

    def starts(self, expected: dict[str, float]) -> None:
        self._expected = expected
        if sys.stderr.isatty():
            self._bar = self._new_bar()
        else:
            print(f"bench: {', '.join(expected)}; {_duration(sum(expected.values()))}", file=sys.stderr, flush=True)

    def bench(self, name: str) -> None:
        self._present, self._began, self._said = name, time.monotonic(), 0.0
        self.doing(name)

    def doing(self, line: str) -> None:
        left = f"{_duration(self.left_s)} left"
        if self._bar is not None:
            total = sum(self._expected.values())
            self._bar.update(self._task, completed=total - self.left_s, total=total, description=line, left=left)
            self._bar.refresh()
        elif time.monotonic() - self._said >= PLAIN_EVERY_S:
            self._said = time.monotonic()
            print(f"{line}; {left}", file=sys.stderr, flush=True)

    def done(self, book: Book) -> None:
        self._done_s += self._expected[book.name]
        self._present = ""

    def close(self) -> None:
        """Nothing is left on the screen."""
        if self._bar is not None:
            self._bar.stop()

    @property
    def left_s(self) -> float:
        """By what each bench said it would take; one that takes longer is nearly done for as long as it takes."""
        expected = self._expected.get(self._present, 0.0)
        spent = min(time.monotonic() - self._began, 0.95 * expected) if self._present else 0.0
        return sum(self._expected.values()) - self._done_s - spent

    def _new_bar(self) -> Any:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (BarColumn(bar_width=20), TextColumn("{task.fields[left]}"), TextColumn("{task.description}"))
        bar = Bar(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
        self._task = bar.add_task("", total=sum(self._expected.values()), left="")
        bar.start()
        return bar


def show(books: Sequence[Book], machine: Mapping[str, Any], interrupted: bool) -> None:
    """Everything on stdout, as a person reads it."""
    from rich.console import Console

    console = Console(highlight=False)
    console.print(machine_text(machine), style="dim")
    for book in books:
        show_book(console, book)
    console.print()
    console.print(goals_text(books))
    if interrupted:
        console.print("[yellow]interrupted[/]: what was finished stands above")


def show_book(console: Any, book: Book) -> None:
    """Headline, table, notes of one bench."""
    from rich.markup import escape
    from rich.padding import Padding

    load = f"load {book.load[0]:g} to {book.load[1]:g}"
    console.print(f"\n[bold]{book.name}[/]  {book.about} [dim]({book.wall_s:.0f} s, {load})[/]")
    if any(line.ours for line in book.lines):
        console.print(Padding(table_of(book.lines), (0, 0, 0, 2)))
    if book.skipped:
        console.print(f"  [yellow]skipped[/]: {escape(book.skipped)}")
    for note in book.notes:
        console.print(f"  [dim]note: {escape(note)}[/]")


def table_of(lines: Sequence[Line]) -> Any:
    """A rich table: ratio and its spread first, then both medians."""
    from rich.table import Table

    names = {line.beside_what for line in lines if line.beside_what}
    units = {line.unit for line in lines}
    unit = f", {next(iter(units))}" if len(units) == 1 else ""
    table = Table(box=None, pad_edge=False, header_style="dim", show_edge=False, padding=(0, 2, 0, 0))
    table.add_column("", overflow="fold")
    for header in ("ratio", "low", "high"):
        table.add_column(header, justify="right", no_wrap=True)
    for header in (f"sil{unit}", next(iter(names)) if len(names) == 1 else "beside"):
        table.add_column(header, justify="right", overflow="fold")
    table.add_column("goal", no_wrap=True)
    shown = [line for line in lines if line.ours]
    for head, members in groupby(shown, key=_head):
        group = list(members)
        if heading := head if head and len(group) > 1 else "":
            table.add_row(f"[dim]{heading}[/]")
        for line in group:
            case = f"  {line.case.removeprefix(f'{heading}, ')}" if heading else line.case
            table.add_row(case, *cells(line, with_unit=len(units) > 1, with_name=len(names) > 1))
    return table


def _head(line: Line) -> str:
    """What the lines of a group have in common: `100 Hz FIFO 50` of `100 Hz FIFO 50, p99`."""
    return line.case.rpartition(", ")[0]


def cells(line: Line, with_unit: bool, with_name: bool) -> list[str]:
    """One row of the table behind its name, as rich markup."""
    ratio, ours, beside = spread(line.ratios), spread(line.ours), spread(line.beside)
    unit = f" {line.unit}" if with_unit else ""
    name = f" ({line.beside_what})" if with_name and line.beside_what else ""
    many = ratio is not None and len(line.ratios) > 1
    return [
        f"[bold]{number(ratio.median)}[/]" if ratio else "-",
        number(ratio.low) if ratio and many else "",
        number(ratio.high) if ratio and many else "",
        f"{number(ours.median)}{unit}" if ours else "-",
        f"{number(beside.median)}{name}" if beside else "",
        goal_text(line),
    ]


def goal_text(line: Line) -> str:
    """`met <= 1.5`: without a name it is the ratio's."""
    if line.goal is None or line.met is None:
        return ""
    verdict = "[green]met[/]" if line.met else "[red]missed[/]"
    return f"{verdict} {line.goal.text()}"


def goals_text(books: Sequence[Book]) -> str:
    """How many goals are met, and which are not."""
    judged = [(book.name, line) for book in books for line in book.lines if line.met is not None]
    if not judged:
        return "goals: none of what was measured has one"
    missed = [f"{name}: {line.case}" for name, line in judged if not line.met]
    text = f"goals: {len(judged) - len(missed)} of {len(judged)} met"
    return f"{text}; [red]missed[/]: {'; '.join(missed)}" if missed else text


def machine_text(machine: Mapping[str, Any]) -> str:
    """One line about the machine."""
    packages = ", ".join(f"{name} {version}" for name, version in machine["packages"].items() if version)
    cpus = f"{machine['cpus']} CPU{'s' if machine['cpus'] != 1 else ''}"
    return f"{machine['processor']}, {cpus}, Linux {machine['kernel']}, Python {machine['python']}, {packages}"


def number(value: float) -> str:
    """Three significant digits, thousands as k and M: 0.0152, 1.48, 35.5, 306, 2,906, 260 k, 3.03 M."""
    size = abs(value)
    if size >= 999_500:
        return f"{value / 1e6:.3g} M"
    if size >= 9_995:
        return f"{value / 1e3:.3g} k"
    if size >= 999.5:
        return f"{value:,.0f}"
    return f"{value:.3g}"


def _duration(seconds: float) -> str:
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"
