"""What can be wrong with a scenario, each in one line: where, key, expected, got."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import NamedTuple

from sil.trouble import UsageError

Path = tuple[str | int, ...]  # ("plant", "initial", "attitude_deg", 2)
UNKNOWN_KEY = "unknown key"


class Where(NamedTuple):
    """The place a value came from: a line of a file, or a `--set` (line 0)."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


class Problem(NamedTuple):
    """One thing wrong with one key."""

    where: str  # mrac.yaml:12, or --set a.b, or nothing
    key: str  # plant.inertia_kgm2
    expected: str
    got: str
    line: int = 0  # 0: not from a file

    def __str__(self) -> str:
        place = self.where if self.where == f"--set {self.key}" else f"{self.where}: {self.key}".removeprefix(": ")
        if self.got == UNKNOWN_KEY:
            return f"{place}: {self.got}; {self.expected}"
        return f"{place}: expected {self.expected}, got {self.got}"


class ScenarioInvalid(UsageError, ValueError):
    """A scenario that cannot be used; `problems` has every reason, the text has one line for each."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class UnknownScenario(ScenarioInvalid):
    """A name that is neither a file nor a built-in scenario."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__([Problem("", "scenario", f"a file or {one_of(known, name)}", shown(name))])


def key_of(path: Path) -> str:
    """("require", 0, "below") -> require[0].below"""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{printable(part)}" for part in path)
    return text.removeprefix(".")


def printable(text: str) -> str:
    """The same in one line of at most 60 characters: line breaks and what no terminal shows, escaped."""
    shown_text = text if text.isprintable() else repr(text)[1:-1]
    return shown_text if len(shown_text) <= 60 else shown_text[:57] + "..."


def unknown_key(place: Where, path: Path, known: Iterable[str]) -> Problem:
    """`... unknown key; known: a, b, c; did you mean b?`"""
    names = list(known)
    close = difflib.get_close_matches(str(path[-1]), names, n=1, cutoff=0.6)
    expected = f"known: {', '.join(names)}" + (f"; did you mean {close[0]}?" if close else "")
    return Problem(str(place), key_of(path), expected, UNKNOWN_KEY, place.line)


def one_of(names: Iterable[object], got: object = "") -> str:
    """`one of a, b, c` with a suggestion when `got` looks like one of them."""
    texts = [str(name) for name in names]
    close = difflib.get_close_matches(str(got), texts, n=1, cutoff=0.6)
    return f"one of {', '.join(texts)}" + (f" (did you mean {close[0]}?)" if close else "")


def shown(value: object) -> str:
    """A value from a scenario as its writer would recognise it, in at most 60 characters."""
    text = _yaml_like(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _yaml_like(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_yaml_like(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_yaml_like(item)}" for key, item in value.items()) + "}"
    return repr(value)
