"""Climbing: one run a rung, each held against the last one below it that flew.

Two rungs in the same arithmetic have to give the same bytes: every deterministic frame, the truth, the sha256 of
run.mcap. A rung in another arithmetic differs from its first COMMAND on; how far is a figure, and whether that is too
far is what the scenario's requirements say of each run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from sil.budget.flight import flight_of
from sil.budget.measure import Instructions, measure
from sil.ladder.rungs import FIXED, Rung
from sil.report.diff import Difference, diff
from sil.runner import run_scenario
from sil.runs import Run, open_run
from sil.scenario import Scenario
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT, SilError
from sil.watch import Watch

COUNTED_TICKS = 1200


class Step(NamedTuple):
    """What came of one rung. summary: of its run, {} where it did not fly; why_not: why, in one line.

    below: name of the rung it is held against, "" where none flew; difference: what `sil diff` finds between the two.
    instructions: of a step of the law, where they can be counted; not_counted: why they were not, in one line.
    """

    rung: Rung
    summary: dict[str, Any]
    why_not: str = ""
    below: str = ""
    same_form: bool = False
    difference: Difference | None = None
    instructions: Instructions | None = None
    not_counted: str = ""

    @property
    def exit_code(self) -> int:
        """Of its run; a rung that could not be flown is not shown to be right."""
        return int(self.summary["exit_code"]) if self.summary else EXIT_LINK

    @property
    def differs(self) -> bool:
        """It should have given the bytes of the rung below, and did not."""
        found = self.difference
        return found is not None and self.same_form and not (found.identical and found.same_file)


def climb(
    flights: Sequence[tuple[Rung, Scenario]], folder: Path, begin: Callable[[str], None], watch: Watch
) -> Iterator[Step]:
    """Fly each rung into folder/RUNG and yield what came of it; ends at one that is interrupted.

    begin(name of the rung) is called before each; `watch` sees all of them.
    """
    last: tuple[Rung, Run] | None = None
    for rung, scenario in flights:
        begin(rung.name)
        step = _fly(rung, scenario, folder, watch)
        if step.summary.get("ticks"):
            run = open_run(step.summary["run_dir"])
            if last is not None:
                same_form = last[0].form == rung.form == FIXED
                step = step._replace(below=last[0].name, same_form=same_form, difference=diff(last[1], run))
            last = rung, run
            if rung.counted and step.exit_code != EXIT_INTERRUPTED:
                watch.note(f"{rung.name}: counting its instructions")
                step = _counted(step, run, scenario)
        yield step
        if step.exit_code == EXIT_INTERRUPTED:
            return


def _fly(rung: Rung, scenario: Scenario, folder: Path, watch: Watch) -> Step:
    place = folder / rung.folder
    try:
        return Step(rung, run_scenario(scenario, place, watch))
    except SilError as error:  # the scenario is sound: it is the board that is not to be had
        return Step(rung, {}, why_not=" ".join(str(error).split()))


def _counted(step: Step, run: Run, scenario: Scenario) -> Step:
    """The first ticks once more, on an emulator that counts, which takes some ten times as long."""
    flight = flight_of(run, scenario)
    try:
        budget = measure([replace(flight, ticks=flight.ticks[:COUNTED_TICKS])])
    except SilError as error:
        return step._replace(not_counted=" ".join(str(error).split()))
    return step._replace(instructions=budget.laws[scenario.law.name].law_step)


def exit_code_of(steps: Sequence[Step]) -> int:
    """The first line of the table of exit codes that applies to any rung."""
    codes = {step.exit_code for step in steps}
    for code in (EXIT_INTERRUPTED, EXIT_LINK):
        if code in codes:
            return code
    differs = any(step.differs for step in steps)
    return EXIT_REQUIREMENT if differs or EXIT_REQUIREMENT in codes else EXIT_OK
