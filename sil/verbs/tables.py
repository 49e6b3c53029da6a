"""sil tables: the tables of a study beside what its scenarios give here."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, UsageError
from sil.verbs.options import RESULT_PANEL, JobsOption, JsonOption, QuietOption, print_json
from sil.verbs.sweep import base_of, interruptible, watch_of

if TYPE_CHECKING:
    from sil.campaign.tables import Row

STUDIES = ("000",)


def tables(
    study: Annotated[str, typer.Argument(metavar="STUDY", help="Which study: 000, fuzzy control under sensor delay.")],
    table: Annotated[
        list[str] | None,
        typer.Option("--table", metavar="NAME", help="5.4, 5.7 or 5.9; repeatable. Default: all three."),
    ] = None,
    comparison: Annotated[
        bool, typer.Option("--comparison", help="The study's comparison of tuned laws, and their largest delays.")
    ] = False,
    jobs: JobsOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Where the sweeps go; refused if not empty. Default: sweeps/NAME-NNN each.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="The rows as CSV.", rich_help_panel=RESULT_PANEL)
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Fly the tables of a published study: printed, ours, their ratio, whether it is reproduced, and the reason.

    Each table is a sweep over the variants of a built-in scenario (delay-picosat, delay-nanosat, delay-large;
    delay-comparison with --comparison) and the delay, in process and in lockstep. All of 000 is 32 runs of 150,000 to
    300,000 ticks: half an hour on one CPU, half of that on two. Its comparison takes two minutes.

    A row is reproduced if each axis is within 25 % (5 % and 0.02 s in the comparison), lost as printed if both turn
    beyond 30 deg. Writes the directories of the sweeps, and the rows.

    Exit codes: 0 the table is whole, whatever it says; 2 usage; 3 a run failed for link, board or worker;
    130 interrupted, `sil sweep --resume DIR` goes on.

    Examples: sil tables 000 --table 5.7 | sil tables 000 --comparison | sil tables 000 -j 2 --csv tables.csv
    """
    from sil.campaign.study_000 import TABLES

    if study not in STUDIES:
        raise UsageError(f"STUDY: expected one of {', '.join(STUDIES)}, got {study!r}")
    for name in table or ():
        if name not in TABLES:
            raise UsageError(f"--table: expected one of {', '.join(TABLES)}, got {name!r}")
    if comparison and table:
        raise UsageError("--comparison: expected no --table beside it, got both")
    wanted = ["comparison", "largest"] if comparison else [name for name in TABLES if not table or name in table]
    return interruptible(lambda: _told(wanted, jobs, out, csv_file, as_json, quiet))


def _told(
    wanted: Sequence[str], jobs: int | None, out: Path | None, csv_file: Path | None, as_json: bool, quiet: bool
) -> int:
    all_rows: dict[str, list[Row]] = {}
    code = EXIT_OK
    for name in wanted:
        place = None if out is None else out / name
        rows, summary = _flown(name, jobs, place, as_json or quiet)
        all_rows[name] = rows
        if not as_json:
            _show(name, rows)
        if summary["interrupted"]:
            print(f"interrupted; go on with: sil sweep --resume {summary['sweep_dir']}", file=sys.stderr)
            code = EXIT_INTERRUPTED
            break
        if summary["exit_code"] == EXIT_LINK:
            code = EXIT_LINK
    if csv_file is not None:
        _write_csv(csv_file, all_rows)
    if as_json:
        print_json(
            {"tables": {name: [_plain(row) for row in rows] for name, rows in all_rows.items()}, "exit_code": code}
        )
    return code


def _flown(name: str, jobs: int | None, out: Path | None, silent: bool) -> tuple[list[Row], dict[str, Any]]:
    from sil.campaign import study_000, tables
    from sil.campaign.sweep import checked_workers, fly, new_sweep

    if name == "comparison":
        (conditions, flies), file = tables.comparison_conditions(), study_000.COMPARISON
    elif name == "largest":
        (conditions, flies), file = tables.largest_conditions(), study_000.COMPARISON
    else:
        (conditions, flies), file = tables.table_conditions(name), study_000.TABLES[name].scenario
        if not silent:
            print(f"table {name}, {study_000.TABLES[name].about}: {study_000.SEVERAL_MINUTES}", file=sys.stderr)
    base = base_of(file, ["require=[]"], [tables.VARIANT], None, None, None)
    watch = watch_of(silent, silent)
    opened = new_sweep(base, conditions, out, watch, flies, f"tables-{name}")
    summary = fly(opened, checked_workers(jobs), "none", watch)
    if name == "comparison":
        return tables.comparison_rows(opened.plan, opened.records), summary
    if name == "largest":
        return tables.largest_rows(opened.plan, opened.records), summary
    return tables.table_rows(name, opened.plan, opened.records), summary


HEADS = {
    "comparison": ("rms of all axes, deg; effort, N m s", "manoeuvre"),
    "largest": ("largest delay with a residual below 2 deg, s", ""),
}


def _show(name: str, rows: Sequence[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    title, first = HEADS.get(name, (f"table {name}: RMS attitude error, deg (x y z)", ""))
    shown = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for header in (first, "law", "delay s", "printed", "ours", "ratio", "verdict", "why"):
        shown.add_column(header)
    for row in rows:
        figures = (_figures(values) for values in (row.published, row.ours, row.ratio))
        shown.add_row(_manoeuvre(name, row), row.law, f"{row.delay_s:g}", *figures, row.verdict, row.why)
    Console(highlight=False, emoji=False).print(shown)


def _manoeuvre(name: str, row: Row) -> str:
    """What the comparison flies; a table of the study has one manoeuvre."""
    return "" if name == row.table else row.table


def _figures(values: Sequence[float | None]) -> str:
    return " ".join("-" if value is None or math.isnan(value) else f"{value:.3g}" for value in values)


def _plain(row: Row) -> dict[str, Any]:
    numbers = [None if math.isnan(value) else value for value in row.ours]
    return {**row._asdict(), "ours": numbers}


def _write_csv(file: Path, all_rows: dict[str, list[Row]]) -> None:
    from sil.report.whole_file import beside

    with beside(file) as new, new.open("w", encoding="utf-8", newline="") as handle:
        writer = csv.writer(handle, lineterminator="\n")
        writer.writerow(("table", "manoeuvre", "law", "delay_s", "published", "ours", "ratio", "verdict", "why"))
        for name, rows in all_rows.items():
            for row in rows:
                figures = (_figures(values) for values in (row.published, row.ours, row.ratio))
                writer.writerow((name, _manoeuvre(name, row), row.law, row.delay_s, *figures, row.verdict, row.why))
