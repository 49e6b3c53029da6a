"""What `sil check` finds, a line each: how bad it is, and the problem with its place."""

from __future__ import annotations

from typing import Literal, NamedTuple

from sil.scenario import Scenario
from sil.scenario_errors import Problem, Where

Severity = Literal["error", "warning"]


class Finding(NamedTuple):
    """One line of `sil check`."""

    severity: Severity
    where: str
    key: str
    line: int  # 0: not from a file
    expected: str
    got: str

    def __str__(self) -> str:
        text = str(Problem(self.where, self.key, self.expected, self.got, self.line))
        return f"warning: {text}" if self.severity == "warning" else text


def error(scenario: Scenario, key: str, expected: str, got: str) -> Finding:
    """What stops the scenario, at the place that decided `key`."""
    return finding("error", problem_at(scenario.where(key), key, expected, got))


def warning(scenario: Scenario, key: str, expected: str, got: str) -> Finding:
    """What a person should weigh."""
    return finding("warning", problem_at(scenario.where(key), key, expected, got))


def problem_at(place: Where, key: str, expected: str, got: str) -> Problem:
    """The problem with `key`, which stands at this place."""
    return Problem(str(place), key, expected, got, place.line)


def finding(severity: Severity, problem: Problem) -> Finding:
    """The line of `sil check` of a problem."""
    return Finding(severity, problem.where, problem.key, problem.line, problem.expected, problem.got)
