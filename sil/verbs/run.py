"""sil run, plant, board, recover: run a scenario, or one end of it, and finish the log of a run that was killed."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_OK
from sil.verbs.options import (
    ClockOption,
    JsonOption,
    LinkOption,
    OutOption,
    ScenarioArgument,
    SetOption,
    print_json,
    scenario_from,
)

if TYPE_CHECKING:
    from sil.runner import Watch
    from sil.scenario import Scenario


def run(
    scenario: ScenarioArgument,
    clock: ClockOption = None,
    link: LinkOption = None,
    board: Annotated[
        str | None, typer.Option("--board", help="process (default), inproc, none, or serial://PATH, udp://HOST:PORT.")
    ] = None,
    set_: SetOption = None,
    out: OutOption = None,
    as_json: JsonOption = False,
) -> int:
    """Run a scenario: plant here, controller in its own process, a real link between them, everything logged.

    Ctrl-C or SIGTERM ends the run at the next tick and leaves a complete log and summary.

    Examples: sil run mrac-rs232 --clock scaled:20 | sil run appc-udp --set sensors.attitude.noise_deg=0.02
    """
    return _run(scenario_from(scenario, set_, clock=clock, link=link, board=board), out, as_json, wired=False)


def plant(
    scenario: ScenarioArgument,
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            metavar="URL",
            help="pty, udp://HOST:PORT of the board, or serial://PATH. Default: the scenario's.",
        ),
    ] = None,
    clock: ClockOption = None,
    set_: SetOption = None,
    out: OutOption = None,
    as_json: JsonOption = False,
) -> int:
    """The laboratory alone: plant, log and verdict; the board is started by hand or is real hardware.

    Two terminals: `sil board --link udp://127.0.0.1:5005` and `sil plant appc-udp --link udp://127.0.0.1:5005`.
    With a pty it names the device that the board has to open. Waits a minute for the board.
    """
    return _run(scenario_from(scenario, set_, clock=clock, link=link), out, as_json, wired=True)


def board(
    link: Annotated[
        str, typer.Option("--link", metavar="URL", help="udp://HOST:PORT to listen on, or serial://PATH[?baud=N].")
    ],
    law: Annotated[str | None, typer.Option("--law", metavar="FILE.py:CLASS", help="A law of your own.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Exit after the first session.")] = False,
) -> int:
    """The controller alone, in this terminal; serves sessions until Ctrl-C. Same as python -m firmware_sim."""
    arguments = [
        "-P",
        "-m",
        "firmware_sim",
        "--link",
        link,
        *(["--law", law] if law else []),
        *(["--once"] if once else []),
    ]
    from sil.boards.process import child_environment

    os.execve(sys.executable, [sys.executable, *arguments], child_environment())


def recover(run_dir: Annotated[Path, typer.Argument(metavar="RUN", help="Directory of a run that was killed.")]) -> int:
    """Make the log of a killed run from its journal; rows up to the last complete tick."""
    from sil.sinks.seal import recover as seal_again

    report = seal_again(run_dir)
    print(f"{report.run_mcap}: {report.ticks} ticks, {report.reason}")
    for line in filter(None, (report.damage, report.left_out)):
        print(line, file=sys.stderr)
    return EXIT_OK


def _run(scenario: Scenario, out: Path | None, as_json: bool, wired: bool) -> int:
    from sil.runner import run_scenario
    from sil.screen import Silent, Terminal, show_summary

    watch: Watch = Silent() if as_json else Terminal(scenario.name)
    summary = run_scenario(scenario, out or (Path(scenario.out) if scenario.out else None), watch, wired=wired)
    if summary["failure"]:
        print(summary["failure"], file=sys.stderr)
    if as_json:
        print_json(summary)
    else:
        show_summary(summary)
    return int(summary["exit_code"])
