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
    run_dir: RunArgument,
    out: Annotated[Path | None, typer.Option("--out", help="PNG or PDF file. Default: RUN/plot.png.")] = None,
) -> int:
    """Draw a run: attitude against reference, error, torque, momentum, identification."""
    from sil.report.plot import plot as draw

    shown = opened(run_dir)
    target = out or shown.directory / "plot.png"
    draw(shown, target)
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
