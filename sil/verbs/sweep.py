"""sil sweep: one scenario many times, over grids of values, seeds and drawn conditions."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from sil.trouble import EXIT_INTERRUPTED, UsageError
from sil.verbs import completion
from sil.verbs.options import (
    KEYS_PANEL,
    RESULT_PANEL,
    SWEEP_PANEL,
    ClockOption,
    JobsOption,
    JsonOption,
    LinkOption,
    QuietOption,
    ResumeOption,
    SetOption,
    SweptArgument,
    VariantOption,
    print_json,
    resumed,
    scenario_from,
    variant_sets,
)

if TYPE_CHECKING:
    from sil.campaign.results import Results
    from sil.campaign.sweep import SweepWatch
    from sil.scenario import Scenario

VARY_PANEL = "What is varied"
KEEP = ("none", "on-fail", "all")


class Manner(NamedTuple):
    """How a sweep is flown and told."""

    workers: int | None
    keep: str
    as_json: bool
    quiet: bool
    again: Sequence[int] = ()
    retry_failed: bool = False


def sweep(
    scenario: SweptArgument = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=SPEC",
            help="One key and its values; repeatable. Listed: 0.5:0.9:9 (9 points), 1:20 (every whole number), "
            "5,7.5,9 (these). Drawn: uniform(a,b), log(a,b), normal(mean,sigma), choice(a,b,c). "
            "An item of a list: plant.inertia_kgm2.0.",
            rich_help_panel=VARY_PANEL,
            autocompletion=completion.sets,
        ),
    ] = None,
    vary_file: Annotated[
        Path | None,
        typer.Option(
            "--vary-file",
            metavar="FILE",
            help="YAML with vary, set, sample, draws, seed; an option goes before what the file says.",
            rich_help_panel=VARY_PANEL,
        ),
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option(
            "--draws", "-n", metavar="N", help="How often the drawn keys are drawn.", rich_help_panel=VARY_PANEL
        ),
    ] = None,
    sample: Annotated[
        str | None,
        typer.Option(
            "--sample", metavar="KIND", help="random (default) or lhs, a Latin hypercube.", rich_help_panel=VARY_PANEL
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            metavar="N",
            help="Of the draws, default 0. The seed of a run is the key `seed`.",
            rich_help_panel=VARY_PANEL,
        ),
    ] = None,
    set_: SetOption = None,
    variant: VariantOption = None,
    clock: ClockOption = None,
    link: LinkOption = None,
    board: Annotated[
        str | None,
        typer.Option(
            "--board",
            metavar="BOARD",
            help="inproc (default), process, or where a board listens.",
            rich_help_panel=KEYS_PANEL,
            autocompletion=completion.boards,
        ),
    ] = None,
    jobs: JobsOption = None,
    resume: ResumeOption = None,
    retry_failed: Annotated[
        bool,
        typer.Option(
            "--retry-failed",
            help="With --resume: once more the points that failed for link, board, worker or timing.",
            rich_help_panel=SWEEP_PANEL,
        ),
    ] = False,
    again: Annotated[
        list[int] | None,
        typer.Option(
            "--again",
            metavar="POINT",
            help="With --resume: this point once more, to keep its run directory; repeatable.",
            rich_help_panel=SWEEP_PANEL,
        ),
    ] = None,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep",
            metavar="WHICH",
            help="Run directories to keep: none (default), on-fail (exit code not 0) or all.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Directory of the sweep; refused if not empty. Default: sweeps/NAME-NNN.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Run a scenario many times: a grid of values, seeds, conditions drawn at random; one table of results.

    In process and in lockstep unless said otherwise: the same bytes as over any link, thousands of times faster than
    real time.

    Listed keys form a grid. Drawn keys are drawn N times, and every cell of the grid flies the same draws. A draw that
    the scenario refuses is drawn again and counted; a refused point of a grid stays in the results as invalid, with its
    reason. Statistics are over seeds and draws.

    Writes a directory: plan.json before anything runs; results.csv, results.json and summary.json, which are the same
    bytes with any number of workers, and after an interruption and --resume. Ctrl-C keeps every finished point.

    Exit codes: 0 every point passed; 1 a point failed a requirement or was invalid; 2 nothing could be swept; 3 a point
    failed for link, board, worker or timing; 130 interrupted.

    Examples: sil sweep mrac-rs232 --vary law.params.c2_pole=0.5:0.9:9 --vary seed=1:20 |
    sil sweep mrac-rs232 --vary "law.params.c2_pole=uniform(0.5,0.9)" -n 100 |
    sil sweep appc-rs232 --vary-file monte-carlo.yaml -j 2 --keep on-fail |
    sil sweep --resume sweeps/appc-rs232-001
    """
    from sil.campaign.conditions import conditions_from
    from sil.campaign.sweep import checked_workers, new_sweep, old_sweep

    if keep is not None and keep not in KEEP:
        raise UsageError(f"--keep: expected one of {', '.join(KEEP)}, got {keep}")
    if again and (keep is not None or retry_failed):
        raise UsageError(
            "--again: expected neither --keep nor --retry-failed beside it, since it keeps its points' runs"
        )
    manner = Manner(
        checked_workers(jobs), "all" if again else keep or "none", as_json, quiet, tuple(again or ()), retry_failed
    )
    if resume is not None:
        directory = resumed(resume)
        if (
            scenario is not None
            or any((vary, vary_file, draws, sample, set_, variant, clock, link, board, out))
            or seed is not None
        ):
            raise UsageError(
                f"--resume: expected neither scenario nor keys beside it: {resume}/plan.json says them all"
            )
        return interruptible(lambda: _fly(old_sweep(directory, retry_failed), manner))
    if retry_failed or again:
        raise UsageError("--retry-failed, --again: expected --resume DIR beside it, got none")
    if scenario is None:
        raise UsageError("sweep: expected SCENARIO --vary KEY=SPEC, or --resume DIR, got neither")
    conditions = conditions_from(vary_file, vary or (), sample, draws, seed)
    varied = [spec.key for spec in conditions.specs]
    sets = [*conditions.sets, *(set_ or ()), *variant_sets(variant)]
    base = base_of(scenario, sets, varied, clock=clock, link=link, board=board)
    return interruptible(lambda: _fly(new_sweep(base, conditions, out, watch_of(manner.as_json, manner.quiet)), manner))


def interruptible(action: Callable[[], int]) -> int:
    """Planning ends at SIGTERM as at Ctrl-C, and says so; once points are flown, `fly` knows how to end."""
    from sil.stopping import terminated_like_interrupted

    try:
        with terminated_like_interrupted():
            return action()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def base_of(
    name: str, sets: list[str], varied: list[str], clock: str | None, link: str | None, board: str | None
) -> Scenario:
    """The scenario in lockstep, and in process, unless it has no board or somebody said how it is to be reached.

    To vary board or link.url says so too: in process all values would be alike. What the link does to frames is a
    model, and acts in process as anywhere.
    """
    sets = [*sets, "variant=null"] if "variant" in varied else sets  # each point chooses its own
    own = scenario_from(name, sets, clock=clock, link=link, board=board)
    how = any(key in ("board", "link", "link.url") for key in varied)
    said = {text.partition("=")[0] for text in sets}
    before = [] if clock is not None or said & {"clock", "clock.mode"} else ["clock.mode=lockstep"]
    if own.board != "none" and link is None and board is None and not how and not said & {"board", "link", "link.url"}:
        before.append("board=inproc")
    return scenario_from(name, [*before, *sets], clock=clock, link=link, board=board)


def watch_of(as_json: bool, quiet: bool) -> SweepWatch:
    """A bar on a terminal, lines elsewhere; nothing with --json or -q."""
    from sil.campaign.progress import Terminal
    from sil.campaign.sweep import SweepWatch

    return SweepWatch() if as_json or quiet else Terminal()


def _fly(opened: Results, manner: Manner) -> int:
    from sil.campaign.sweep import fly
    from sil.campaign.table import headline, show

    if opened.torn:
        print(f"{opened.torn} damaged lines of results.jsonl: their points are flown again", file=sys.stderr)
    before = {number: opened.records.get(number) for number in manner.again}
    summary = fly(opened, manner.workers, manner.keep, watch_of(manner.as_json, manner.quiet), manner.again)
    if manner.as_json:
        print_json(summary)
    elif manner.quiet:
        print(headline(summary))
    else:
        show(summary, opened.plan, [opened.records[number] for number in sorted(opened.records)])
    flown = [number for number, old in before.items() if opened.records.get(number) is not old]
    for number in flown:
        record, old = opened.records[number], before[number]
        if record.run_dir:
            other = old is not None and old.sha256 != record.sha256
            said = ": not the bytes it had before, on this machine something else decides" if other else ""
            print(f"point {number}: {opened.directory / record.run_dir}{said}", file=sys.stderr)
    if summary["interrupted"]:
        _say_how_to_go_on(summary, manner, [number for number in before if number not in flown])
    return int(summary["exit_code"])


def _say_how_to_go_on(summary: dict[str, Any], manner: Manner, left: Sequence[int]) -> None:
    done = f"{summary['finished']} of {summary['points']} points"
    options = [f"--again {number}" for number in left]
    if manner.again:
        done = f"{len(manner.again) - len(left)} of {len(manner.again)} points"
    elif manner.keep != "none":
        options.append(f"--keep {manner.keep}")
    if manner.retry_failed:
        options.append("--retry-failed")
    command = shlex.join(["sil", "sweep", "--resume", str(summary["sweep_dir"])])
    print(f"interrupted after {done}; go on with: {' '.join([command, *options])}", file=sys.stderr)
