"""sil compare: one table over several runs or scenarios; a scenario is run first, in process and lockstep."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, UsageError
from sil.verbs import completion
from sil.verbs.options import RESULT_PANEL, JsonOption, SetOption, opened, print_json, scenario_from

if TYPE_CHECKING:
    from sil.runs import Run
    from sil.scenario import Scenario

_YAML = (".yaml", ".yml")


def _offers(incomplete: str) -> list[tuple[str, str]]:
    return [*completion.scenarios(incomplete), *completion.runs(incomplete)]


def compare(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN_OR_SCENARIO...",
            help="Run directories or .mcap files; names of scenarios or YAML files, which are run first.",
            autocompletion=_offers,
        ),
    ],
    set_: SetOption = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            "--keep", metavar="DIR", help="Keep the runs that are made, in DIR/NAME-NNN.", rich_help_panel=RESULT_PANEL
        ),
    ] = None,
    as_json: JsonOption = False,
    as_csv: Annotated[
        bool,
        typer.Option("--csv", help="A line per run on stdout, for spreadsheets.", rich_help_panel=RESULT_PANEL),
    ] = False,
) -> int:
    """Compare runs or scenarios in one table: error, settling, effort, missed commands, verdict.

    A scenario is run first, in process and lockstep; its log goes to a temporary directory unless --keep says where.
    --set is for the scenarios only. What the columns mean: docs/GUIDE.md, metrics. A run that failed its requirements
    is a row like any other.

    Exit codes: 0 table printed, 2 usage, 3 a scenario could not be run to its end, 130 interrupted; the runs that were
    complete by then are in the table.

    Examples: sil compare runs/mrac-rs232-001 runs/mrac-rs232-002 | sil compare appc-rs232 mrac-rs232 pd-root-locus
    """
    from sil.runs import Run

    if as_json and as_csv:
        raise UsageError("--json, --csv: expected one of them, got both")
    sources = [_source(name, set_) for name in names]
    if set_ and all(isinstance(source, Run) for source in sources):
        raise UsageError("--set: expected a scenario among the names, got only runs, which are what they are")
    with _folder(keep) as parent:
        runs, verdicts, code = _collected(sources, parent)
        if runs:
            _print(runs, verdicts, as_json, as_csv)
    return code


def _source(name: str, sets: list[str] | None) -> Run | Scenario:
    """A run, or the scenario to make one of. Everything is looked up before anything is run."""
    path = Path(name)
    if (path.exists() and path.suffix not in _YAML) or path.suffix == ".mcap":
        return opened(path)
    scenario = scenario_from(name, sets, clock="lockstep", link="inproc")
    if scenario.board == "none":
        return scenario
    return scenario_from(name, sets, clock="lockstep", link="inproc", board="inproc")


@contextmanager
def _folder(keep: Path | None) -> Iterator[Path]:
    if keep is not None:
        yield keep
        return
    with TemporaryDirectory(prefix="sil-compare-") as made:
        yield Path(made)


def _collected(sources: list[Run | Scenario], parent: Path) -> tuple[list[Run], dict[int, str], int]:
    """(runs, verdicts of those made here by index, exit code): ends at the first that is interrupted."""
    from sil.runner import run_scenario
    from sil.runs import Run, open_run
    from sil.verbs.flights import Flights

    runs: list[Run] = []
    verdicts: dict[int, str] = {}
    code = EXIT_OK
    progress = Flights(sum(not isinstance(source, Run) for source in sources))
    try:
        for source in sources:
            if isinstance(source, Run):
                runs.append(source)
                continue
            progress.begin(source.name)
            summary = run_scenario(source, _run_dir(parent, source.name), progress)
            if summary["exit_code"] == EXIT_INTERRUPTED:
                return runs, verdicts, EXIT_INTERRUPTED
            if summary["failure"]:
                print(f"{source.name}: {summary['failure']}", file=sys.stderr)
                code = EXIT_LINK
            if summary["ticks"]:
                verdicts[len(runs)] = summary["verdict"]
                runs.append(open_run(summary["run_dir"]))
    except KeyboardInterrupt:  # before the run had begun
        return runs, verdicts, EXIT_INTERRUPTED
    finally:
        progress.close()
    return runs, verdicts, code


def _run_dir(parent: Path, name: str) -> Path:
    """The next free DIR/NAME-NNN."""
    number = 1
    while (parent / f"{name}-{number:03d}").exists():
        number += 1
    return parent / f"{name}-{number:03d}"


def _print(runs: list[Run], verdicts: dict[int, str], as_json: bool, as_csv: bool) -> None:
    from sil.report import compare as report

    found = report.rows(runs, verdicts)
    if as_json:
        print_json({"runs": [row.as_dict() for row in found]})
    elif as_csv:
        print(report.csv(found), end="")
    else:
        from rich.console import Console

        console = Console(highlight=False)
        console.print(report.table(found, console.width))
        for i, line in enumerate(report.notes(found)):
            console.print("\n" * (i == 0) + line, style="dim", markup=False)
