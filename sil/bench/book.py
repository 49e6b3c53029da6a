"""What a bench writes down: lines of repeats, ours and what ran beside it, with medians, spreads, ratios and goals.

ratio = ours / beside, one per repeat: both figures of a repeat were measured right after each other, so most of what
the machine does to one it does to the other. A line whose repeats were not all made (Ctrl-C) is as good as those made.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

Subject = Literal["ratio", "ours", "excess"]


class Spread(NamedTuple):
    """Median, smallest and largest of some repeats."""

    median: float
    low: float
    high: float


def spread(values: Sequence[float]) -> Spread | None:
    """None of nothing."""
    return Spread(statistics.median(values), min(values), max(values)) if values else None


@dataclass(frozen=True)
class Goal:
    """What a line should reach. `of`: the ratio, our own figure, or what we have more than what ran beside us.

    judged: `median` of the repeats, or `each` of them.
    """

    limit: float
    of: Subject = "ratio"
    at_most: bool = True
    judged: Literal["median", "each"] = "median"

    def met(self, line: Line) -> bool | None:
        """None while there is nothing to judge."""
        values = {"ratio": line.ratios, "ours": line.ours, "excess": line.excesses}[self.of]
        if not values:
            return None
        judged = [statistics.median(values)] if self.judged == "median" else values
        return all(value <= self.limit if self.at_most else value >= self.limit for value in judged)

    def text(self) -> str:
        """`<= 1.5` of the ratio, `sil <= 5` of our own figure, `sil <= +1`: at most one more than beside."""
        sign = "<=" if self.at_most else ">="
        if self.of == "ratio":
            return f"{sign} {self.limit:g}"
        return f"sil {sign} {self.limit:g}" if self.of == "ours" else f"sil {sign} {self.limit:+g}"


@dataclass
class Line:
    """One comparison. Figures are in `unit`; `beside_what` is "" where nothing could be run beside ours."""

    case: str
    unit: str
    beside_what: str = ""
    goal: Goal | None = None
    more_is_better: bool = False
    ours: list[float] = field(default_factory=list)
    beside: list[float] = field(default_factory=list)

    def add(self, ours: float, beside: float | None = None) -> None:
        """One repeat. A line either always or never has something beside it."""
        self.ours.append(ours)
        if beside is not None:
            self.beside.append(beside)

    @property
    def ratios(self) -> list[float]:
        """ours / beside per repeat; repeats beside which nothing was counted (0) have none."""
        return [mine / other for mine, other in zip(self.ours, self.beside, strict=False) if other]

    @property
    def excesses(self) -> list[float]:
        """ours - beside per repeat."""
        return [mine - other for mine, other in zip(self.ours, self.beside, strict=False)]

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None without a goal or without figures."""
        return self.goal.met(self) if self.goal else None

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "case": self.case,
            "unit": self.unit,
            "more_is_better": self.more_is_better,
            "ratio": _plain(self.ratios),
            "ours": _plain(self.ours),
            "beside": _plain(self.beside),
            "beside_what": self.beside_what,
            "goal": self.goal.text() if self.goal else None,
            "met": self.met,
        }


def _plain(values: Sequence[float]) -> dict[str, Any] | None:
    found = spread(values)
    return None if found is None else {**found._asdict(), "values": list(values)}


@dataclass
class Plan:
    """How much to measure, and whom to tell what is going on. `doing` gets one line each time something starts."""

    repeats: int = 5
    quick: bool = False
    doing: Callable[[str], None] = lambda line: None

    def rounds(self, what: str) -> Iterator[int]:
        """The repeats, each announced."""
        for repeat in range(self.repeats):
            self.doing(f"{what}, repeat {repeat + 1} of {self.repeats}")
            yield repeat


@dataclass
class Book:
    """Everything one bench found. `skipped` says why nothing (or not all) could be measured."""

    name: str
    about: str = ""
    lines: list[Line] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    scratch: dict[Any, list[float]] = field(default_factory=dict)  # of the bench itself; shown nowhere
    skipped: str = ""
    finished: bool = False
    wall_s: float = 0.0
    load: tuple[float, float] = (0.0, 0.0)  # 1 min load average of the machine before and after

    def line(self, case: str, unit: str, beside_what: str = "", goal: Goal | None = None, more: bool = False) -> Line:
        """The line of this case; made when it is first asked for. more: more is better."""
        for line in self.lines:
            if line.case == case and line.unit == unit:
                return line
        self.lines.append(Line(case, unit, beside_what, goal, more))
        return self.lines[-1]

    def note(self, text: str) -> None:
        """Something a reader of the figures should know; said once."""
        if text not in self.notes:
            self.notes.append(text)

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "about": self.about,
            "finished": self.finished,
            "skipped": self.skipped or None,
            "wall_s": round(self.wall_s, 3),
            "load_before_after": list(self.load),
            "lines": [line.plain() for line in self.lines],
            "notes": self.notes,
            "details": self.details,
        }
