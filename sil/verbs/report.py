"""sil info, report, plot, export, diff: what a run was, and how two differ."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from sil.trouble import EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs import completion
from sil.verbs.options import RESULT_PANEL, JsonOption, RunArgument, opened, print_json

DRAWN_PANEL = "What is drawn"
COMPARED_PANEL = "How they are compared"


RunsArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="RUN...",
        help="Run directories or .mcap files; several are overlaid.",
        autocompletion=completion.runs,
    ),
]


def info(run_dir: RunArgument, as_json: JsonOption = False) -> int:
    """What a run was: scenario, law, versions, hashes, verdict, metrics, frames, events.

    Everything from the log, but the verdict, which stands in summary.json beside it, and the machine's facts, in
    timing.mcap. A metric that does not exist is a dash.

    Exit codes: 0 shown, 2 not a run.

    Examples: sil info runs/mrac-rs232-001 | sil info runs/mrac-rs232-001 --json
    """
    from sil.report import info as about

    content = about.info(opened(run_dir))
    if as_json:
        print_json(content)
    else:
        print(about.text(content))
    return EXIT_OK


def report(
    run_dirs: RunsArgument,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="HTML file. Default: RUN/report.html; of several runs report-A-B.html here.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    open_: Annotated[
        bool, typer.Option("--open", help="Show it in the browser.", rich_help_panel=RESULT_PANEL)
    ] = False,
) -> int:
    """Everything about a run on one page: verdict, plots, the satellite in 3-D, link, deadlines, arithmetic, events.

    One HTML file that needs no network and no further file, so it can be mailed, archived and printed; light and dark,
    on a screen and on a phone. A slider moves the satellite and the cursor of all plots. Several runs are drawn over
    each other, each axis in a plot of its own, with a table of what their scenarios differ in. Long runs are drawn in
    bins that keep their smallest and largest values.

    Exit codes: 0 written, 2 usage, or not a run.

    Examples: sil report runs/mrac-rs232-001 | sil report runs/mrac-rs232-001 runs/appc-rs232-001 --out both.html
    """
    from sil.report.page import ALSO, default_out
    from sil.report.page import report as write
    from sil.runs import open_run
    from sil.verbs.stages import Stages

    with Stages("report") as stages:
        runs = []
        for path in run_dirs:
            stages.begin(f"reading {path}")
            runs.append(open_run(path, ALSO))
        target = write(runs, out or default_out(runs), stages.begin)
    print(target)
    if open_:
        typer.launch(target.resolve().as_uri())
    return EXIT_OK


def plot(
    run_dirs: RunsArgument,
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            metavar="A,B",
            help="attitude, error, torque, momentum, rate, identification, lateness, answer, or any TELEMETRY triple "
            "of the law, such as g or trace; repeatable. Default: the usual four, and one of the identification.",
            rich_help_panel=DRAWN_PANEL,
        ),
    ] = None,
    residuals: Annotated[
        bool,
        typer.Option(
            "--residuals",
            help="Several runs: also the difference of each to the first.",
            rich_help_panel=DRAWN_PANEL,
        ),
    ] = False,
    time: Annotated[
        str | None,
        typer.Option(
            "--time",
            metavar="FROM:TO",
            help="The part to draw, s; 100: is from 100 s on.",
            rich_help_panel=DRAWN_PANEL,
        ),
    ] = None,
    dark: Annotated[
        bool, typer.Option("--dark", help="For dark pages and slides.", rich_help_panel=RESULT_PANEL)
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="PNG (overview), PDF (all pages) or a directory (every page as a PNG). Default: RUN/plot.png; "
            "of several runs plot-A-B.png here.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
) -> int:
    """Draw a run, or several over each other: attitude against reference, error, torque, momentum, identification.

    Several runs share the panels, roll, pitch and yaw in one each; the legend names them by what differs: scenario,
    law, seed, a key of the scenario, or the directory. With --residuals each further run minus the first follows below,
    at the instants both have: the common ticks, or where periods differ the times on both grids; nothing is
    interpolated. A run that diverged is cut off by the panels of the others.

    Exit codes: 0 written, 2 usage, not a run, or no such signal.

    Examples: sil plot runs/mrac-rs232-001 | sil plot A B --signals error,torque --residuals --out a-b.png
    """
    from sil.report.plot import default_out
    from sil.report.plot import plot as draw

    runs = [opened(path) for path in run_dirs]
    names = [name.strip() for each in signals or () for name in each.split(",") if name.strip()]
    target = out or default_out(runs)
    draw(runs, target, names, residuals, dark, _span_s(time))
    print(target)
    return EXIT_OK


def _span_s(text: str | None) -> tuple[float, float]:
    """FROM:TO in s; either may be missing."""
    begin, colon, end = (text or ":").partition(":")
    try:
        span = float(begin or "-inf"), float(end or "inf")
    except ValueError:
        span = math.nan, math.nan
    if not colon or not span[0] < span[1]:
        raise UsageError(f"--time: expected FROM:TO in s, such as 100:200 or 100:, got {text!r}")
    return span


def export(
    run_dir: RunArgument, out: Annotated[Path, typer.Argument(metavar="OUT.csv", help="CSV file, or - for stdout.")]
) -> int:
    """Write a run as CSV, one row per tick, units in the header.

    Truth at the tick, not the reading; every float with all its digits, so that it reads back to the same number.

    Exit codes: 0 written, 2 not a run, or the file cannot be written.

    Examples: sil export runs/mrac-rs232-001 run.csv | sil export runs/mrac-rs232-001 - > run.csv
    """
    from sil.report.export import export as write

    write(opened(run_dir), out)
    return EXIT_OK


def diff(
    a: Annotated[
        Path, typer.Argument(metavar="A", help="Run directory, or a run.mcap.", autocompletion=completion.runs)
    ],
    b: Annotated[
        Path, typer.Argument(metavar="B", help="The run that is held against it.", autocompletion=completion.runs)
    ],
    close: Annotated[
        bool,
        typer.Option(
            "--close",
            help="Within tolerances, for logs from another machine, instead of bit for bit.",
            rich_help_panel=COMPARED_PANEL,
        ),
    ] = False,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            "--tolerance",
            metavar="SIGNAL=VALUE",
            help="Another tolerance, such as attitude_deg=1e-9; the unit is the signal's, for telemetry a fraction of "
            "each word's peak. Means --close; repeatable.",
            rich_help_panel=COMPARED_PANEL,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Compare two runs: identical, or what differs first and how far the motion departs.

    Bit for bit, frame by frame, unless tolerances are asked for. With --close it says how far each signal departs at
    most, and from which tick on it is beyond its tolerance; CONFIG, frames with their ticks and fates, flags, counters
    and events have to be equal then too. The tolerances by default let pass what a reading rounded the other way on
    another machine leads to: 1e-3 deg, 1e-4 N m.

    Exit codes: 0 identical, or within tolerances; 1 they differ; 2 usage, or not a run.

    Examples: sil diff A B | sil diff mine theirs --close | sil diff A B --tolerance attitude_deg=1e-9
    """
    from sil.report import diff as differ
    from sil.report import tolerance as tolerances

    if close or tolerance:
        near = tolerances.close(opened(a), opened(b), tolerances.tolerances(tolerance or ()))
        print_json(near.as_dict()) if as_json else print(tolerances.text(near))
        return EXIT_OK if near.within else EXIT_REQUIREMENT
    found = differ.diff(opened(a), opened(b))
    print_json(found.as_dict()) if as_json else print(differ.text(found))
    return EXIT_OK if found.identical else EXIT_REQUIREMENT
