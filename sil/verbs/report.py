"""sil info, plot, export, diff: what a run was, and how two differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sil.trouble import EXIT_OK, EXIT_REQUIREMENT
from sil.verbs.options import JsonOption, RunArgument, opened, print_json


def info(run_dir: RunArgument, as_json: JsonOption = False) -> int:
    """What a run was: scenario, law, versions, hashes, verdict, events."""
    from sil.report import info as about

    content = about.info(opened(run_dir))
    if as_json:
        print_json(content)
    else:
        print(about.text(content))
    return EXIT_OK


def plot(
    run_dirs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run directories or .mcap files; several are overlaid.")
    ],
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            metavar="A,B",
            help="attitude, error, torque, momentum, rate, identification, lateness, answer, or any TELEMETRY triple "
            "of the law, such as g or trace; repeatable. Default: the usual four, and one of the identification.",
        ),
    ] = None,
    residuals: Annotated[
        bool, typer.Option("--residuals", help="Several runs: also the difference of each to the first.")
    ] = False,
    dark: Annotated[bool, typer.Option("--dark", help="For dark pages and slides.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="PNG (overview), PDF (all pages) or a directory (every page as a PNG). Default: RUN/plot.png; "
            "of several runs plot-A-B.png here.",
        ),
    ] = None,
) -> int:
    """Draw a run, or several over each other: attitude against reference, error, torque, momentum, identification.

    Examples: sil plot runs/mrac-rs232-001 | sil plot A B --signals error,torque --residuals --out a-b.png
    """
    from sil.report.plot import default_out
    from sil.report.plot import plot as draw

    runs = [opened(path) for path in run_dirs]
    names = [name.strip() for each in signals or () for name in each.split(",") if name.strip()]
    target = out or default_out(runs)
    draw(runs, target, names, residuals, dark)
    print(target)
    return EXIT_OK


def export(
    run_dir: RunArgument, out: Annotated[Path, typer.Argument(metavar="OUT.csv", help="CSV file, or - for stdout.")]
) -> int:
    """Write a run as CSV, one row per tick, units in the header."""
    from sil.report.export import export as write

    write(opened(run_dir), out)
    return EXIT_OK


def diff(a: RunArgument, b: RunArgument, as_json: JsonOption = False) -> int:
    """Compare two runs packet by packet: identical, or what differs first and how far the motion departs."""
    from sil.report import diff as differ

    found = differ.diff(opened(a), opened(b))
    if as_json:
        print_json(found.as_dict())
    else:
        print(differ.text(found))
    return EXIT_OK if found.identical else EXIT_REQUIREMENT
