"""The command line: sil run, plant, board, replay, diff, info, plot, export, check, scenarios, recover.

Data goes to stdout, one-line errors to stderr. Exit codes, the first that applies: 130 interrupted; 2 usage or invalid
scenario; 3 link or board failure, or timing degraded; 1 a requirement failed or a replay or diff differed; 0 passed.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil import streams
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, EXIT_REQUIREMENT, EXIT_USAGE, SilError, UsageError

if TYPE_CHECKING:
    from sil.runner import Watch
    from sil.runs import Run
    from sil.scenario import Scenario

app = typer.Typer(
    name="sil",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Attitude-control testbed: a simulated satellite, a real link, a separate controller, one scenario file.\n\n"
    "Start with [bold]sil run mrac-rs232[/], then [bold]sil plot[/] and [bold]sil replay[/] on the run it names.",
    epilog="Exit codes: 0 passed, 1 a requirement failed or something differed, 2 usage or invalid scenario, "
    "3 link or board failure or degraded timing, 130 interrupted.",
)

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Built-in name (see `sil scenarios`) or YAML file.")
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="Run directory, or a run.mcap.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override one key, such as law.params.c2_pole=0.7; repeatable."),
]
ClockOption = Annotated[str | None, typer.Option("--clock", help="lockstep, realtime or scaled:N (N times real time).")]
LinkOption = Annotated[
    str | None,
    typer.Option("--link", metavar="URL", help="pty, udp, inproc, udp://HOST:PORT or serial:///dev/X?baud=N."),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="Run directory; refused if not empty. Default: runs/NAME-NNN.")
]
REPLAY_BOARDS = ("inproc", "process")
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on stdout, for programs.")]


@app.command()
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
    return _run(_scenario(scenario, set_, clock=clock, link=link, board=board), out, as_json, wired=False)


@app.command()
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
    return _run(_scenario(scenario, set_, clock=clock, link=link), out, as_json, wired=True)


@app.command()
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


@app.command()
def replay(
    run_dir: RunArgument,
    set_: SetOption = None,
    board: Annotated[str, typer.Option("--board", help="inproc or process: where the fresh board runs.")] = "inproc",
    as_json: JsonOption = False,
) -> int:
    """Feed a run's recorded packets to a fresh board: identical answers, or the first difference, decoded."""
    from sil.replay import decoded
    from sil.replay import replay as replay_run
    from sil.scenario_errors import one_of

    if board not in REPLAY_BOARDS:
        raise UsageError(f"--board: expected {one_of(REPLAY_BOARDS, board)}, got {board!r}")
    report = replay_run(_open(run_dir), set_ or (), board)
    if as_json:
        first = report.first
        _print_json(
            {
                "identical": report.identical,
                "ticks": report.ticks,
                "law_file": report.law_file,
                "config": [{"word": w, "recorded": a, "now": b} for w, a, b in report.config],
                "first_difference": None
                if first is None
                else {"tick": first.tick, "recorded": decoded(first.recorded), "replayed": decoded(first.replayed)},
            }
        )
        return EXIT_OK if report.identical else EXIT_REQUIREMENT
    if report.law_file:
        print(report.law_file)
    for word, then, now in report.config:
        print(f"CONFIG differs: {word}: recorded {then}, now {now}")
    if report.first is None:
        print(f"identical: {report.ticks} ticks, {report.sessions} session{'s' * (report.sessions != 1)}")
        return EXIT_OK
    print(f"differs at tick {report.first.tick}, after {report.ticks} identical ticks")
    print(f"  recorded: {decoded(report.first.recorded)}")
    print(f"  replayed: {decoded(report.first.replayed)}")
    return EXIT_REQUIREMENT


@app.command()
def diff(a: RunArgument, b: RunArgument, as_json: JsonOption = False) -> int:
    """Compare two runs packet by packet: identical, or what differs first and how far the motion departs."""
    from sil.report import diff as differ

    found = differ.diff(_open(a), _open(b))
    if as_json:
        _print_json(found.as_dict())
    else:
        print(differ.text(found))
    return EXIT_OK if found.identical else EXIT_REQUIREMENT


@app.command()
def info(run_dir: RunArgument, as_json: JsonOption = False) -> int:
    """What a run was: scenario, law, versions, hashes, verdict, events."""
    from sil.report import info as about

    content = about.info(_open(run_dir))
    if as_json:
        _print_json(content)
    else:
        print(about.text(content))
    return EXIT_OK


@app.command()
def plot(
    run_dir: RunArgument,
    out: Annotated[Path | None, typer.Option("--out", help="PNG or PDF file. Default: RUN/plot.png.")] = None,
) -> int:
    """Draw a run: attitude against reference, error, torque, momentum, identification."""
    from sil.report.plot import plot as draw

    opened = _open(run_dir)
    target = out or opened.directory / "plot.png"
    draw(opened, target)
    print(target)
    return EXIT_OK


@app.command()
def export(
    run_dir: RunArgument, out: Annotated[Path, typer.Argument(metavar="OUT.csv", help="CSV file, or - for stdout.")]
) -> int:
    """Write a run as CSV, one row per tick, units in the header."""
    from sil.report.export import export as write

    write(_open(run_dir), out)
    return EXIT_OK


@app.command()
def check(scenario: ScenarioArgument, set_: SetOption = None, as_json: JsonOption = False) -> int:
    """Validate a scenario and its time budget (wire and execution time against the period) without running it."""
    from sil.checks import check as findings_of

    loaded = _scenario(scenario, set_)
    findings = findings_of(loaded)
    errors = [finding for finding in findings if finding.severity == "error"]
    if as_json:
        _print_json({"valid": not errors, "findings": [finding._asdict() for finding in findings]})
    for finding in findings if not as_json else ():
        print(finding, file=sys.stderr)
    if errors:
        return EXIT_USAGE
    if not as_json:
        print(f"{loaded.name}: valid, {loaded.ticks} ticks of {loaded.period_s:g} s")
    return EXIT_OK


@app.command()
def scenarios(as_json: JsonOption = False) -> int:
    """List the built-in scenarios."""
    from sil.scenarios import list_scenarios

    known = list_scenarios()
    if as_json:
        _print_json([entry._asdict() for entry in known])
        return EXIT_OK
    from sil.screen import show_table

    show_table(("scenario", "what it is"), [(entry.name, entry.about) for entry in known])
    return EXIT_OK


@app.command()
def recover(run_dir: Annotated[Path, typer.Argument(metavar="RUN", help="Directory of a run that was killed.")]) -> int:
    """Make the log of a killed run from its journal; rows up to the last complete tick."""
    from sil.sinks.seal import recover as seal_again

    report = seal_again(run_dir)
    print(f"{report.run_mcap}: {report.ticks} ticks, {report.reason}")
    for line in filter(None, (report.damage, report.left_out)):
        print(line, file=sys.stderr)
    return EXIT_OK


def main(argv: list[str] | None = None) -> None:
    """Entry point: maps every expected failure to one line on stderr and its exit code."""
    streams.settle()
    sys.exit(invoke(argv))


def invoke(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit code of DESIGN's table."""
    command = typer.main.get_command(app)
    try:
        code = int(command.main(args=argv, prog_name="sil", standalone_mode=False) or EXIT_OK)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except Exception as error:
        return _explained(error)


def _explained(error: Exception) -> int:
    """One line for what a user can do something about; the traceback for what is our bug."""
    from protocol.links import LinkError
    from sil.runs import RunError
    from sil.scenario_errors import ScenarioInvalid
    from sil.sinks.journal import JournalError
    from sil.sinks.seal import SealError

    if isinstance(error, typer.Exit):
        return error.exit_code
    show = getattr(error, "show", None)  # a usage error of the command-line library, wherever its class lives
    if show is not None:
        show()
        return EXIT_USAGE
    if isinstance(error, SilError):
        code = error.exit_code
    elif isinstance(error, LinkError | SealError):
        code = EXIT_LINK
    elif isinstance(error, ScenarioInvalid | RunError | JournalError | OSError):
        code = EXIT_USAGE
    else:
        raise error
    print(error, file=sys.stderr)
    return code


# -- shared by commands --------------------------------------------------------------------------------------------


def _scenario(name: str, sets: list[str] | None, **options: str | None) -> Scenario:
    from sil.scenario import load_scenario

    overrides = [f"{_KEYS[key]}={value}" for key, value in options.items() if value is not None]
    return load_scenario(name, [*(sets or ()), *overrides])


_KEYS = {"clock": "clock", "link": "link.url", "board": "board"}


def _run(scenario: Scenario, out: Path | None, as_json: bool, wired: bool) -> int:
    from sil.runner import run_scenario
    from sil.screen import Silent, Terminal, show_summary

    watch: Watch = Silent() if as_json else Terminal(scenario.name)
    summary = run_scenario(scenario, out or (Path(scenario.out) if scenario.out else None), watch, wired=wired)
    if summary["failure"]:
        print(summary["failure"], file=sys.stderr)
    if as_json:
        _print_json(summary)
    else:
        show_summary(summary)
    return int(summary["exit_code"])


def _open(path: Path) -> Run:
    from sil.runs import open_run

    return open_run(path)


def _print_json(content: Any) -> None:
    print(json.dumps(content, indent=2, allow_nan=False, default=str))
