"""The checks of a board for a person, for programs, and for CI."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sil.board_test import FAIL, PASS, SKIPPED, Checked
from sil.doctor.show import Page

NAME_COLUMN = 17
COLOURS = {PASS: "bold green", FAIL: "bold red"}


class Sheet:
    """Writes checks on stdout as they are made, a heading before each group."""

    def __init__(self) -> None:
        self._page = Page(NAME_COLUMN)
        self._group = ""

    def show(self, tested: Checked) -> None:
        """One check."""
        if tested.group != self._group:
            self._group = tested.group
            self._page.heading(tested.group)
        self._page.show(tested.finding)

    def last_line(self, tested: Sequence[Checked], target: str, took_s: float) -> None:
        """The verdict and how many of each."""
        verdict = PASS if passed(tested) else FAIL
        said = f"  {target}: {counted(tested)}, {took_s:.0f} s"
        self._page.heading(verdict, COLOURS[verdict], said)


def passed(tested: Sequence[Checked]) -> bool:
    """Nothing failed, and something was checked beyond the link."""
    return all(each.finding.status != FAIL for each in tested) and any(each.group != "link" for each in tested)


def counted(tested: Sequence[Checked]) -> str:
    """`44 passed, 1 failed, 2 skipped`"""
    words = {PASS: "passed", FAIL: "failed", SKIPPED: "skipped"}
    counts = {status: sum(each.finding.status == status for each in tested) for status in words}
    return ", ".join(f"{counts[status]} {word}" for status, word in words.items() if counts[status] or status == PASS)


def as_dict(tested: Sequence[Checked], target: str, took_s: float) -> dict[str, Any]:
    """Plain JSON values."""
    return {
        "board": target,
        "passed": passed(tested),
        "counts": {status: sum(each.finding.status == status for each in tested) for status in (PASS, FAIL, SKIPPED)},
        "seconds": round(took_s, 1),
        "checks": [{"group": each.group, **each.finding.as_dict()} for each in tested],
    }


def as_junit(tested: Sequence[Checked], target: str) -> str:
    """A testcase a check."""
    from sil.report.junit import Case, of_cases

    outcomes = {PASS: "passed", FAIL: "failure", SKIPPED: "skipped"}
    cases = [
        Case(f"{group}: {finding.check}", outcomes[finding.status], "board", finding.found) for group, finding in tested
    ]
    return of_cases("board-test", {"board": target}, cases)
