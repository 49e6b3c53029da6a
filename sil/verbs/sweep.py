"""sil sweep: one scenario many times, over grids of values, seeds and drawn conditions."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil.trouble import UsageError
from sil.verbs.options import ClockOption, JsonOption, LinkOption, SetOption, print_json, scenario_from

if TYPE_CHECKING:
    from sil.campaign.results import Results
    from sil.campaign.sweep import SweepWatch
    from sil.scenario import Scenario

KEEP = ("none", "on-fail", "all")


def sweep(
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="Built-in name (see `sil scenarios`) or YAML file.")
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=SPEC",
            help="a:b:n (n points), a:b (every whole number), a,b,c (these values); drawn: uniform(a,b), log(a,b), "
            "normal(m,s), choice(a,b,c). Items of a list: plant.inertia_kgm2.0. Repeatable.",
        ),
    ] = None,
    vary_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="YAML with vary, set, sample, draws, seed; options go before it."),
    ] = None,
    draws: Annotated[
        int | None, typer.Option("--draws", "-n", metavar="N", help="How often the drawn keys are drawn.")
    ] = None,
    sample: Annotated[str | None, typer.Option(help="random (default) or lhs (Latin hypercube).")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of the draws; default 0. The scenario's own is the key `seed`.")
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", metavar="N", help="Worker processes. Default: one a CPU; 1 for a paced clock."),
    ] = None,
    keep: Annotated[str, typer.Option(help="Run directories to keep: none, on-fail, all.")] = "none",
    set_: SetOption = None,
    clock: ClockOption = None,
    link: LinkOption = None,
    board: Annotated[str | None, typer.Option("--board", help="inproc (default), process or none.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Directory of the sweep; refused if not empty. Default: sweeps/NAME-NNN."),
    ] = None,
    resume: Annotated[
        Path | None, typer.Option("--resume", metavar="DIR", help="Go on with a sweep; with -j, --keep, --json only.")
    ] = None,
    retry_failed: Annotated[
        bool,
        typer.Option("--retry-failed", help="With --resume: fly points again that failed for link, board, worker."),
    ] = False,
    again: Annotated[
        list[int] | None,
        typer.Option("--again", metavar="N", help="With --resume: fly this point once more, keep its run. Repeatable."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Run a scenario many times: a grid of values, seeds, or conditions drawn at random; one table of results.

    In process and in lockstep unless said otherwise: the same bytes as over any link, at thousands of times real time.

    Listed keys form a grid. Drawn keys are drawn N times, and every cell of the grid flies the same draws. A draw that
    the scenario refuses is drawn again; a refused point of a grid stays in the results as invalid, with its reason.

    The directory has plan.json (written before anything runs), results.csv, results.json and summary.json: the same
    bytes with any number of workers, and after an interruption and --resume. Ctrl-C keeps every finished point.

    Exit code: 130 interrupted; 2 nothing could be swept; 3 a point failed for link, board, worker or timing; 1 a point
    did not meet its requirements or was invalid; 0 all passed.

    Examples: sil sweep mrac-rs232 --vary law.params.c2_pole=0.5:0.9:9 --vary seed=1:20 |
    sil sweep appc-rs232 --vary 'sensors.attitude.noise_deg=log(0.001,0.1)' -n 100 --sample lhs |
    sil sweep appc-rs232 --vary-file monte-carlo.yaml -j 2 --keep on-fail
    """
    from sil.campaign.conditions import conditions_from
    from sil.campaign.sweep import checked_workers, new_sweep, old_sweep

    workers = checked_workers(jobs)
    if keep not in KEEP:
        raise UsageError(f"--keep: expected one of {', '.join(KEEP)}, got {keep}")
    if resume is not None:
        if scenario is not None or any((vary, vary_file, draws, sample, seed, set_, clock, link, board, out)):
            raise UsageError(f"--resume: expected -j, --keep, --json beside it, since {resume}/plan.json says the rest")
        return _fly(old_sweep(resume, retry_failed), workers, "all" if again else keep, as_json, again or ())
    if retry_failed or again:
        raise UsageError("--retry-failed, --again: expected --resume DIR beside it, got none")
    if scenario is None:
        raise UsageError("sweep: expected SCENARIO --vary KEY=SPEC, or --resume DIR, got neither")
    conditions = conditions_from(vary_file, vary or (), sample, draws, seed)
    base = _base(scenario, [*conditions.sets, *(set_ or ())], clock=clock, link=link, board=board)
    return _fly(new_sweep(base, conditions, out, _watch(as_json)), workers, keep, as_json)


def _base(name: str, sets: list[str], clock: str | None, link: str | None, board: str | None) -> Scenario:
    """The scenario in lockstep, and in process, unless it has no board or somebody said how it is to be reached."""
    own = scenario_from(name, sets, clock=clock, link=link, board=board)
    said = {text.partition("=")[0] for text in sets}
    before = [] if clock is not None or said & {"clock", "clock.mode"} else ["clock.mode=lockstep"]
    if own.board != "none" and link is None and board is None and not said & {"board", "link", "link.url"}:
        before.append("board=inproc")
    return scenario_from(name, [*before, *sets], clock=clock, link=link, board=board)


def _watch(as_json: bool) -> SweepWatch:
    from sil.campaign.progress import Terminal
    from sil.campaign.sweep import SweepWatch

    return SweepWatch() if as_json else Terminal()


def _fly(opened: Results, workers: int | None, keep: str, as_json: bool, again: Sequence[int] = ()) -> int:
    from sil.campaign.sweep import fly
    from sil.campaign.table import show

    if opened.torn:
        print(f"{opened.torn} damaged lines of results.jsonl: their points are flown again", file=sys.stderr)
    summary = fly(opened, workers, keep, _watch(as_json), again)
    if as_json:
        print_json(summary)
    else:
        show(summary, opened.plan, [opened.records[number] for number in sorted(opened.records)])
    for number in again:
        if (record := opened.records.get(number)) is not None and record.run_dir:
            print(f"point {number}: {opened.directory / record.run_dir}", file=sys.stderr)
    _say_how_to_go_on(summary)
    return int(summary["exit_code"])


def _say_how_to_go_on(summary: dict[str, Any]) -> None:
    if summary["interrupted"]:
        done = f"{summary['finished']} of {summary['points']} points"
        print(f"interrupted after {done}; go on with: sil sweep --resume {summary['sweep_dir']}", file=sys.stderr)
