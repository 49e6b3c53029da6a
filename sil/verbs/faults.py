"""sil faults: the margin map of a scenario, per law, over loss, bursts and delays; a preset of `sil sweep`."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs.options import (
    SWEEP_PANEL,
    JobsOption,
    JsonOption,
    QuietOption,
    ResumeOption,
    SetOption,
    SweptArgument,
    print_json,
    resumed,
)
from sil.verbs.sweep import base_of, interruptible

if TYPE_CHECKING:
    from sil.campaign.margin import Cell
    from sil.campaign.plan import Plan
    from sil.campaign.results import Results
    from sil.campaign.sweep import SweepWatch
    from sil.scenario import Scenario

MAP_PANEL = "What the map is over"
START_TICKS = 20
MOST_TICKS = 100


def faults(
    scenario: SweptArgument = None,
    law: Annotated[
        list[str] | None,
        typer.Option(
            "--law",
            metavar="NAME",
            help="A law to fly; repeatable. Default: the scenario's own, and of appc, mrac and pd those that fly it.",
            rich_help_panel=MAP_PANEL,
        ),
    ] = None,
    loss: Annotated[
        str,
        typer.Option("--loss", metavar="LIST", help="Shares of the frames lost, each way.", rich_help_panel=MAP_PANEL),
    ] = "0.05,0.1,0.2,0.4",
    burst: Annotated[
        str,
        typer.Option(
            "--burst",
            metavar="LIST",
            help="Mean lengths of a burst of losses in ticks; 1: independent losses.",
            rich_help_panel=MAP_PANEL,
        ),
    ] = "1,2,5,10",
    delay: Annotated[
        str,
        typer.Option(
            "--delay", metavar="LIST", help="Delays of the attitude sensor in ticks.", rich_help_panel=MAP_PANEL
        ),
    ] = "1,2",
    transport: Annotated[
        str,
        typer.Option(
            "--transport",
            metavar="LIST",
            help="Transport delays n beside the scenario's own; a law flies those it allows.",
            rich_help_panel=MAP_PANEL,
        ),
    ] = "0,2",
    seeds: Annotated[
        int,
        typer.Option(
            "--seeds",
            metavar="N",
            min=1,
            max=10_000,
            help="Runs a place, each with a seed of its own.",
            rich_help_panel=MAP_PANEL,
        ),
    ] = 5,
    set_: SetOption = None,
    jobs: JobsOption = None,
    resume: ResumeOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory of the map; refused if not empty. Default: sweeps/NAME-faults-NNN.",
            rich_help_panel=SWEEP_PANEL,
        ),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Margin map: pointing error and stability of each law over loss, length of bursts, sensor and transport delay.

    A preset of `sil sweep`, in process and in lockstep: the scenario without its requirements, once for each place and
    seed, and without its first 20 ticks. All laws lose the same frames. Other transport delays are flown with the
    sensor on time only, where the law allows them.

    Writes the directory of a sweep, and in it map.png, map.csv and map.json: the median over the seeds of the worst
    axis' RMS error to the reference, and how many runs were lost, their attitude beyond metrics.diverged_deg.

    Exit codes: 0 the map is whole, whatever it shows; 2 nothing could be flown; 3 a run failed for link, board or
    worker; 130 interrupted, every finished run is kept.

    Examples: sil faults appc-rs232 | sil faults mrac-rs232 --law mrac --loss 0.1,0.3 --burst 1,4 --seeds 20 |
    sil faults --resume sweeps/appc-rs232-faults-001
    """
    from sil.campaign.margin import Wanted, default_laws, preset
    from sil.campaign.sweep import checked_workers, new_sweep, old_sweep

    workers = checked_workers(jobs)
    if resume is not None:
        directory = resumed(resume)
        if scenario is not None or law or set_ or out:
            raise UsageError(f"--resume: expected no scenario or keys beside it: {resume}/plan.json says them all")
        return interruptible(lambda: _fly(_known(old_sweep(directory)), workers, as_json, quiet))
    if scenario is None:
        raise UsageError("faults: expected SCENARIO, or --resume DIR, got neither")
    base = _base(scenario, set_ or [])
    wanted = Wanted(
        tuple(dict.fromkeys(law)) if law else default_laws(base),
        tuple(_numbers("--loss", loss, 0.0, 1.0)),
        tuple(_numbers("--burst", burst, 1.0, math.inf)),
        _ticks("--delay", delay),
        _ticks("--transport", transport),
        seeds,
    )
    conditions, flies = preset(base, wanted)
    watch = _watch(as_json, quiet)
    return interruptible(
        lambda: _fly(new_sweep(base, conditions, out, watch, flies, f"{base.name}-faults"), workers, as_json, quiet)
    )


def _base(name: str, sets: list[str]) -> Scenario:
    """In lockstep and in process, without requirements; what `--set` says goes before that."""
    own = base_of(name, sets, [], None, None, None)
    before = ["require=[]"]
    if not own.metrics.from_tick:
        before.append(f"metrics.from_tick={min(START_TICKS, own.ticks - 1)}")
    return base_of(name, [*before, *sets], [], None, None, None)


def _watch(as_json: bool, quiet: bool) -> SweepWatch:
    """Of a sweep without requirements: what did not pass is lost."""
    from sil.campaign.progress import Terminal
    from sil.campaign.sweep import SweepWatch

    return SweepWatch() if as_json or quiet else Terminal({EXIT_REQUIREMENT: "lost"})


def _known(opened: Results) -> Results:
    from sil.campaign.margin import is_map

    if not is_map(opened.plan):
        opened.close()
        raise UsageError(f"--resume {opened.directory}: expected a map of `sil faults`, got a sweep over other keys")
    return opened


def _fly(opened: Results, workers: int | None, as_json: bool, quiet: bool) -> int:
    from sil.campaign.margin import as_json as json_of
    from sil.campaign.margin_map import PNG, write
    from sil.campaign.sweep import fly

    summary = fly(opened, workers, "none", _watch(as_json, quiet))
    cells = write(opened)
    failed = sum(cell.failed for cell in cells)
    code = EXIT_INTERRUPTED if summary["interrupted"] else EXIT_LINK if failed else EXIT_OK
    done = f"{summary['finished']} of {summary['points']} runs"
    if as_json:
        told = {key: summary[key] for key in ("points", "finished", "interrupted", "wall_s", "sweep_dir")}
        print_json({**json_of(opened.plan, cells), **told, "exit_code": code})
    else:
        if not quiet:
            _show(opened.plan, cells)
        print(f"{opened.directory / PNG if cells else opened.directory}   {done} in {summary['wall_s']:.1f} s")
    if failed:
        print(f"{failed} runs failed for link, board or worker; their reasons: results.csv", file=sys.stderr)
    if summary["interrupted"]:
        print(f"interrupted after {done}; go on with: sil faults --resume {opened.directory}", file=sys.stderr)
    return code


def _show(plan: Plan, cells: Sequence[Cell]) -> None:
    """For each law and delay: the error without loss, of the place in the middle, and of the worst one."""
    from rich.console import Console
    from rich.table import Table

    from sil.campaign.margin_map import rows_of

    table = Table(box=None, pad_edge=False, header_style="bold")
    for header in ("law", "n", "sensor delay"):
        table.add_column(header)
    for header in ("no loss", "median of places", "largest", "places lost"):
        table.add_column(header, justify="right")
    for law in dict.fromkeys(cell.law for cell in cells):
        for row in rows_of(plan, cells):
            those = [cell for cell in cells if (cell.law, cell.transport, cell.delay) == (law, *row)]
            if those:
                table.add_row(law, str(row.transport), f"{row.delay} ticks", *_figures(those))
    Console(highlight=False, emoji=False).print(table)
    print("RMS error to the reference, worst axis, deg; a place is lost where a run is\n")


def _figures(cells: Sequence[Cell]) -> list[str]:
    found = sorted(cell.rms_deg for cell in cells if cell.rms_deg is not None)
    clear = [cell.rms_deg for cell in cells if not cell.loss]
    middle, largest = (found[len(found) // 2], found[-1]) if found else (None, None)
    lost = sum(cell.lost > 0 for cell in cells)
    return [*map(_number, (clear[0] if clear else None, middle, largest)), f"{lost}/{len(cells)}"]


def _number(value: float | None) -> str:
    return "-" if value is None else "lost" if math.isinf(value) else f"{value:.3g}"


def _numbers(option: str, text: str, low: float, high: float) -> list[float]:
    """A list such as 0.1,0.2: beyond `low` or at it where that is 1, below `high`; each once, sorted."""
    expected = f"{option}: expected numbers such as {'0.1,0.2 between 0 and 1' if high == 1 else '1,2,5 from 1'}"
    try:
        numbers = sorted({float(part) for part in text.split(",")})
    except ValueError:
        raise UsageError(f"{expected}, got {text}") from None
    if not all(low <= number < high and number > 0 for number in numbers):
        raise UsageError(f"{expected}, got {text}")
    return numbers


def _ticks(option: str, text: str) -> tuple[int, ...]:
    """A list of whole numbers; an empty text is none."""
    parts = [part.strip() for part in text.split(",")] if text.strip() else []
    if not all(part.isascii() and part.isdecimal() and int(part) <= MOST_TICKS for part in parts):
        raise UsageError(f"{option}: expected whole numbers of ticks up to {MOST_TICKS}, such as 1,2, got {text}")
    return tuple(sorted({int(part) for part in parts}))
