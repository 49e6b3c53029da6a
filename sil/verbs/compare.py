"""sil compare: one table over several runs or scenarios; a scenario is run first, in process and lockstep."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator
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
NOT_KEPT = "-made"  # so that runs/NAME-001 and the NAME-made-001 of this table are told apart by more than a path


def compare(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN_OR_SCENARIO...",
            help="Run directories or .mcap files; names of scenarios or YAML files, which are run first.",
            autocompletion=completion.runs_and_scenarios,
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
    --set is for the scenarios only. What the columns mean: docs/concepts/verdicts-and-metrics.md. A run that failed
    its requirements is a row like any other.

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
        runs, verdicts, code = _collected(sources, parent, "" if keep else NOT_KEPT)
        if runs:
            _print(runs, verdicts, () if keep else verdicts, as_json, as_csv)
    return code


def _source(name: str, sets: list[str] | None) -> Run | Scenario:
    """A run, or the scenario to make one of. Everything is looked up before anything is run."""
    from sil.scenario_errors import one_of
    from sil.scenarios import list_scenarios

    if not name.strip():
        raise UsageError("compare: expected a run or a scenario, got an empty text")
    path = Path(name)
    if (path.exists() and path.suffix not in _YAML) or path.suffix == ".mcap":
        return opened(path)
    known = [info.name for info in list_scenarios()]
    if not path.exists() and name not in known:
        raise UsageError(f"compare: expected a run directory, a scenario file or {one_of(known, name)}, got {name!r}")
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


def _collected(sources: list[Run | Scenario], parent: Path, suffix: str) -> tuple[list[Run], dict[int, str], int]:
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
            summary = run_scenario(source, _run_dir(parent, source.name + suffix), progress)
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


def _print(runs: list[Run], verdicts: dict[int, str], temporary: Collection[int], as_json: bool, as_csv: bool) -> None:
    from sil.report import compare as report

    found = report.rows(runs, verdicts, temporary)
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
