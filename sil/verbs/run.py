"""sil run, plant, board, recover: run a scenario, or one end of it, and finish the log of a run that was killed."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from sil.trouble import EXIT_OK
from sil.verbs import completion
from sil.verbs.options import (
    KEYS_PANEL,
    ClockOption,
    CpusOption,
    JsonOption,
    JunitOption,
    LinkOption,
    LiveAtOption,
    LiveOption,
    LiveWaitOption,
    OutOption,
    PriorityOption,
    QuietOption,
    ScenarioArgument,
    SetOption,
    VariantOption,
    VerboseOption,
    cpu_sets,
    live_order,
    print_json,
    scenario_from,
    verbosity_of,
)

if TYPE_CHECKING:
    from sil.live_view import LiveOrder
    from sil.scenario import Scenario


class Told(NamedTuple):
    """Where a run goes and how it is told."""

    out: Path | None
    junit: Path | None
    as_json: bool
    verbosity: int
    live: LiveOrder | None


def run(
    scenario: ScenarioArgument,
    clock: ClockOption = None,
    link: LinkOption = None,
    board: Annotated[
        str | None,
        typer.Option(
            "--board",
            metavar="BOARD",
            help="process, inproc, none; the C firmware: native, cortex-m, qemu; /dev/X, udp://HOST:PORT: one "
            "that already runs.",
            rich_help_panel=KEYS_PANEL,
            autocompletion=completion.boards,
        ),
    ] = None,
    set_: SetOption = None,
    variant: VariantOption = None,
    priority: PriorityOption = None,
    cpus: CpusOption = None,
    live: LiveOption = False,
    live_at: LiveAtOption = None,
    live_wait: LiveWaitOption = None,
    out: OutOption = None,
    junit: JunitOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> int:
    """Run a scenario: plant here, controller in its own process, a real link between them, everything logged.

    Reads the scenario: every key has a default, and the options are short for some of them. Writes a run directory:
    run.mcap (the same bytes for the same scenario and seed), timing.mcap (this machine's part), summary.json, board.log
    and the journal. Verdict and figures on stdout, progress on stderr.

    Ctrl-C or SIGTERM ends the run at the next tick and leaves a complete log and summary. With --live (pip install
    'attitude-sil\\[live]') viewers may look on; `sil live --layout` prints a layout for them.

    Exit codes: 0 passed, 1 a requirement failed, 2 usage or invalid scenario, 3 link or board failure or degraded
    timing, 130 interrupted.

    Examples: sil run mrac-rs232 | sil run mrac-rs232 --clock scaled:20 --junit results.xml |
    sil run appc-udp --set sensors.attitude.noise_deg=0.02 --out noisy | sil run mrac-rs232 --board cortex-m |
    sil run pd-root-locus --clock realtime --priority 50 --cpus 0,1 | sil run mrac-rs232 --clock scaled:20 --live
    """

    def load() -> Scenario:
        sets = [*(set_ or ()), *cpu_sets(cpus)]
        return scenario_from(
            scenario, sets, variant=variant, clock=clock, link=link, board=board, priority=_text(priority)
        )

    told = Told(out, junit, as_json, verbosity_of(quiet, verbose), live_order(live, live_at, live_wait))
    return _run(scenario, load, told, wired=False)


def plant(
    scenario: ScenarioArgument,
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            metavar="URL",
            help="pty, udp://HOST:PORT of the board, or /dev/X[?baud=N]. Default: the scenario's.",
            rich_help_panel=KEYS_PANEL,
            autocompletion=completion.links,
        ),
    ] = None,
    clock: ClockOption = None,
    set_: SetOption = None,
    variant: VariantOption = None,
    priority: PriorityOption = None,
    cpus: CpusOption = None,
    live: LiveOption = False,
    live_at: LiveAtOption = None,
    live_wait: LiveWaitOption = None,
    out: OutOption = None,
    junit: JunitOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> int:
    """The laboratory alone: plant, log and verdict; the board is started by hand or is real hardware.

    Reads and writes what `sil run` does. With a pty it names, on stderr, the device that the board has to open. Waits a
    minute for the board; --priority and --cpus reach the laboratory only.

    Exit codes: 0 passed, 1 a requirement failed, 2 usage or invalid scenario, 3 no board, link or board failure or
    degraded timing, 130 interrupted.

    Examples: sil board --link udp://127.0.0.1:5005 | sil plant appc-udp --link udp://127.0.0.1:5005 |
    sil plant mrac-rs232 --link 'serial:///dev/ttyUSB0?baud=115200' --clock realtime
    """

    def load() -> Scenario:
        sets = [*(set_ or ()), *cpu_sets(cpus)]
        return scenario_from(scenario, sets, variant=variant, clock=clock, link=link, priority=_text(priority))

    told = Told(out, junit, as_json, verbosity_of(quiet, verbose), live_order(live, live_at, live_wait))
    return _run(scenario, load, told, wired=True)


def board(
    link: Annotated[
        str,
        typer.Option(
            "--link",
            metavar="URL",
            help="udp://HOST:PORT to listen on (port 0: any, named on stdout), or /dev/X[?baud=N].",
            autocompletion=completion.links,
        ),
    ],
    law: Annotated[
        str | None,
        typer.Option("--law", metavar="FILE.py:CLASS", help="A law of your own. Default: the built-in ones."),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Exit after the first session.")] = False,
) -> int:
    """The controller alone, in this terminal; serves one session after the other until Ctrl-C.

    Reads nothing but the link: law, parameters and manoeuvre come in CONFIG from `sil run --board` or `sil plant`.
    Writes its address on stdout, what goes wrong on stderr. Same as python -m firmware_sim.

    Exit codes: 0 Ctrl-C, SIGTERM, or the end of the first session with --once; 2 usage; 3 the link cannot be opened, or
    failed; 4 the law raised an exception.

    Examples: sil board --link udp://127.0.0.1:5005 | sil board --link serial:///dev/ttyUSB0 --once |
    sil board --link udp://0.0.0.0:5005 --law ./my_law.py:MyLaw
    """
    arguments = [
        "-P",
        "-m",
        "firmware_sim",
        "--link",
        link,
        *(["--law", law] if law else []),
        *(["--once"] if once else []),
    ]
    from sil.launched import child_environment

    os.execve(sys.executable, [sys.executable, *arguments], child_environment())


def recover(
    run_dir: Annotated[
        Path,
        typer.Argument(metavar="RUN", help="Directory of a run that was killed.", autocompletion=completion.runs),
    ],
) -> int:
    """Make the log of a killed run from its journal: rows up to the last complete tick.

    Reads RUN/run.journal, which is written as the run goes on and left as it is. Writes RUN/run.mcap and
    RUN/timing.mcap, the same bytes that the run would have written up to there. What was damaged or left out is said on
    stderr.

    Exit codes: 0 the log is there, 2 no journal, or one without a start, 3 the log cannot be written.

    Examples: sil recover runs/mrac-rs232-004
    """
    from sil.sinks.seal import recover as seal_again

    report = seal_again(run_dir)
    print(f"{report.run_mcap}: {report.ticks} ticks, {report.reason}")
    for line in filter(None, (report.damage, report.left_out)):
        print(line, file=sys.stderr)
    return EXIT_OK


def _text(number: int | None) -> str | None:
    return None if number is None else str(number)


def _run(name: str, load: Callable[[], Scenario], told: Told, wired: bool) -> int:
    """Load, run, tell; `name` is what the user called the scenario."""
    from sil.report.junit_file import JunitFile
    from sil.runner import run_scenario
    from sil.screen import new_watch, show_summary

    with JunitFile(told.junit, name, told.out, source=Path(name)) as page:
        scenario = page.scenario = load()
        out = told.out or (Path(scenario.out) if scenario.out else None)
        page.leave_empty(out)
        watch = new_watch(scenario.name, told.verbosity, told.as_json)
        summary = run_scenario(scenario, out, watch, wired, told.live)
        if summary["failure"]:
            print(summary["failure"], file=sys.stderr)
        if told.as_json:
            print_json(summary)
        else:
            show_summary(summary, told.verbosity)
        page.finished(summary)
    return int(summary["exit_code"])
