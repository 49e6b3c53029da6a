"""sil ladder: one scenario from the float law up to the firmware, every rung held against the one below."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil.trouble import EXIT_REQUIREMENT
from sil.verbs import completion
from sil.verbs.options import (
    RESULT_PANEL,
    JsonOption,
    ScenarioArgument,
    SetOption,
    VariantOption,
    print_json,
    variant_sets,
)

if TYPE_CHECKING:
    from sil.ladder.climb import Step
    from sil.ladder.rungs import Rung
    from sil.scenario import Scenario

NOT_A_TERMINAL = 200  # columns of a file or a pipe: nothing is folded
THE_LADDER = "the ladder"
RUNGS_PANEL = "Rungs"


def ladder(
    scenario: ScenarioArgument,
    set_: SetOption = None,
    variant: VariantOption = None,
    with_: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="RUNG",
            help="One more rung: qemu, or /dev/X, udp://HOST:PORT of a board that already runs; repeatable.",
            rich_help_panel=RUNGS_PANEL,
            autocompletion=completion.rungs,
        ),
    ] = None,
    rungs: Annotated[
        str | None,
        typer.Option(
            "--rungs",
            metavar="NAME,NAME",
            help="Which rungs: float, fixed, native, cortex-m, qemu. Default: all but qemu.",
            show_default=False,
            rich_help_panel=RUNGS_PANEL,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Where the runs go, a directory each; refused if not empty. Default: runs/NAME-ladder-NNN.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option(
            "--junit",
            metavar="FILE",
            help="JUnit XML for CI: a testcase a rung, and one for each that has to be the one below, bit for bit.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Fly a scenario on every board, from the float law up to the firmware's image; one table says where they differ.

    All rungs fly in lockstep. Those in fixed point have to give the same bytes: every frame, and the sha256 of
    run.mcap. The float law differs by quantisation: how far is shown, and each run's own requirements judge it. Keeps
    every run, as DIR/RUNG, and the table as DIR/ladder.json. What cannot run here is said with its remedy, and is not
    shown to be right; --rungs leaves it out.

    Exit codes: 0 every rung passed and the fixed ones are identical, 1 a requirement failed or fixed rungs differ,
    2 usage or invalid scenario, 3 a rung could not be flown, 130 interrupted.

    Examples: sil ladder mrac-rs232 | sil ladder appc-udp --with qemu | sil ladder pd-root-locus --rungs fixed,native |
    sil ladder appc-rs232 --set duration_s=60 --with 'serial:///dev/ttyUSB0?baud=115200' --json
    """
    from sil.ladder.rungs import chosen, scenarios
    from sil.ladder.table import as_dict
    from sil.report.junit_file import JunitFile
    from sil.runner import new_run_dir

    with JunitFile(junit, scenario, about=THE_LADDER, source=Path(scenario)) as page:
        flights = scenarios(scenario, [*(set_ or ()), *variant_sets(variant)], chosen(rungs, with_ or ()))
        name = flights[0][1].name
        folder, _ = new_run_dir(f"{name}-ladder", out)
        steps, interrupted = _climbed(flights, folder)
        content = as_dict(steps, name, folder, interrupted)
        _keep(content, folder)
        if as_json:
            print_json(content)
        else:
            _print(steps, name, folder, interrupted)
        if junit is not None:
            page.write(_junit(content))
    return int(content["exit_code"])


def _climbed(flights: list[tuple[Rung, Scenario]], folder: Path) -> tuple[list[Step], bool]:
    """(what came of each rung, whether somebody interrupted it between two of them)."""
    from sil.ladder.climb import climb
    from sil.stopping import terminated_like_interrupted
    from sil.verbs.flights import Flights

    steps: list[Step] = []
    progress = Flights(len(flights))
    try:
        with terminated_like_interrupted():
            for step in climb(flights, folder, progress.begin, progress):
                steps.append(step)
    except KeyboardInterrupt:
        return steps, True
    finally:
        progress.close()
    return steps, False


def _keep(content: dict[str, Any], folder: Path) -> None:
    """ladder.json beside the runs; a folder without any goes."""
    if not any(folder.iterdir()) and not content["rungs"]:
        folder.rmdir()
        return
    (folder / "ladder.json").write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _print(steps: list[Step], name: str, folder: Path, interrupted: bool) -> None:
    from rich.console import Console

    from sil.ladder import table

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = NOT_A_TERMINAL
    if steps:
        console.print(table.table(steps, console.width))
    console.print()
    for line in table.legend(steps, console.width):
        console.print(line, style="dim", markup=False)
    console.print()
    for text in (*table.found(steps), table.last_line(steps, name, folder, interrupted)):
        console.print(text, soft_wrap=not console.is_terminal)


def _junit(content: dict[str, Any]) -> str:
    """A testcase a rung, and one for each that has to be the rung below bit for bit."""
    from sil.report.junit import Case, of_cases

    cases = []
    for rung in content["rungs"]:
        case = Case(f"rung {rung['rung']}", facts={"sha256": str(rung["sha256"]), "run_dir": str(rung["run_dir"])})
        if rung["exit_code"]:
            outcome = "failure" if rung["exit_code"] == EXIT_REQUIREMENT else "error"
            not_met = [line["requirement"] for line in rung["require"] if not line["passed"]]
            message = rung["why_not"] or "; ".join(not_met) or rung["verdict"]
            case = case._replace(outcome=outcome, kind=rung["verdict"], message=message)
        cases.append(case)
        if rung["must_be_identical"]:
            same = Case(f"{rung['rung']} is {rung['compared_with']}, bit for bit")
            at = f"differs at tick {rung['first_differing_tick']}"
            cases.append(same if rung["identical"] else same._replace(outcome="failure", kind="difference", message=at))
    return of_cases(content["scenario"], {"ladder_dir": content["ladder_dir"]}, cases)
