"""Bench `law`: time of one law step on the board, Python wrapper included, beside an empty compiled call.

Measured by `python -m firmware_sim.law_bench` in a process of its own, since the laboratory does not import the board.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from sil.bench.book import Book, Goal, Plan
from sil.bench.children import run_child
from sil.launched import child_environment

BESIDE = "empty compiled call"
GOALS_US = {("appc", "float"): 5.0, ("mrac", "float"): 5.0, ("appc", "fixed"): 20.0, ("mrac", "fixed"): 20.0}


class LawStep:
    """The bench `law`."""

    about = "one law step on the board, beside an empty call of compiled code with the same arguments"

    def expected_s(self, plan: Plan) -> float:
        return plan.repeats * (3.0 if plan.quick else 4.0)

    def measure(self, plan: Plan, book: Book) -> None:
        rounds = 40 if plan.quick else 200
        for _ in plan.rounds("law"):
            for row in law_times(rounds):
                name, form = row["law"], row["form"]
                limit = GOALS_US.get((name, form))
                goal = Goal(limit, of="ours") if limit else None
                book.line(f"{name}, {form}", "us/step", BESIDE, goal).add(row["step_us"], row["empty_us"])


def law_times(rounds: int) -> list[dict[str, Any]]:
    """One row per law and form. Raises ChildFailed."""
    command = [sys.executable, "-P", "-m", "firmware_sim.law_bench", "--json", "--rounds", str(rounds)]
    found: list[dict[str, Any]] = json.loads(run_child(command, 120.0, environment=child_environment()).out)
    return found
