"""Runs benches one after the other; Ctrl-C, SIGTERM or a closed terminal ends the series, what is finished stays."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

from sil.bench import BENCHES, machine
from sil.bench.book import Book, Plan
from sil.plugins import load
from sil.stopping import terminated_like_interrupted
from sil.trouble import SilError, UsageError


class Bench(Protocol):
    """One benchmark."""

    about: str  # what is compared with what, in a line

    def expected_s(self, plan: Plan) -> float:
        """About how long measure() takes."""

    def measure(self, plan: Plan, book: Book) -> None:
        """Measure into the book, repeat by repeat. Raises Unavailable where something needed is not there."""


class Unavailable(SilError):
    """The bench cannot be run here; one line that says why and what would help."""


class Watch:
    """What is told while a series goes on; this one tells nobody. Times in s."""

    def starts(self, expected: dict[str, float]) -> None:
        """Which benches will run, and how long each may take."""

    def bench(self, name: str) -> None:
        """This one starts."""

    def doing(self, line: str) -> None:
        """What exactly is running."""

    def done(self, book: Book) -> None:
        """A bench is over."""


def chosen(names: Sequence[str]) -> list[str]:
    """The benches of these names, all without any; in the order of the registry. Raises UsageError."""
    for name in names:
        if name not in BENCHES:
            raise UsageError(f"NAMES: expected benches, got {name!r}; known: {', '.join(BENCHES)}")
    return [name for name in BENCHES if not names or name in names]


def run_series(names: Sequence[str], plan: Plan, watch: Watch | None = None) -> tuple[list[Book], bool]:
    """(a Book per bench that was begun, whether the series was interrupted)."""
    watch = watch or Watch()
    benches = {name: _bench(name) for name in chosen(names)}
    watch.starts({name: bench.expected_s(plan) for name, bench in benches.items()})
    books: list[Book] = []
    plan.doing = watch.doing
    try:
        with terminated_like_interrupted():
            for name, bench in benches.items():
                books.append(Book(name, bench.about))
                watch.bench(name)
                _measure(bench, plan, books[-1])
                watch.done(books[-1])
    except KeyboardInterrupt:
        return books, True
    return books, False


def _bench(name: str) -> Bench:
    bench: Bench = load(BENCHES, "bench", name)()
    return bench


def _measure(bench: Bench, plan: Plan, book: Book) -> None:
    """What one bench cannot do is written in its book; the others go on."""
    before, began = machine.load(), time.monotonic()
    try:
        bench.measure(plan, book)
        book.finished = True
    except SilError as error:
        book.skipped = str(error)
    finally:
        book.wall_s = time.monotonic() - began
        book.load = before, machine.load()
