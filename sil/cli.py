"""The command line: its verbs, their groups in the help, and the exit code of every failure.

Data goes to stdout, one-line errors to stderr. Exit codes, the first that applies: 130 interrupted; 2 usage or invalid
scenario; 3 link or board failure, or timing degraded; 1 a requirement failed or a replay or diff differed; 0 passed.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from sil import streams
from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, EXIT_USAGE, SilError
from sil.verbs import (
    bench,
    board_test,
    compare,
    completion,
    design,
    doctor,
    faults,
    ladder,
    live,
    pil_report,
    replay,
    report,
    run,
    scenario,
    sweep,
    tables,
)
from sil.verbs.manual import exit_codes, page_of

app = typer.Typer(
    name="sil",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Attitude-control testbed: a simulated satellite, a real link, a separate controller, one scenario file.\n\n"
    "[not dim]Start with [bold]sil run mrac-rs232[/], then [bold]sil plot[/] and [bold]sil replay[/] on the run it "
    "names. [bold]sil VERB -h[/] says what a verb reads and writes, with examples. TAB completes scenarios, runs and "
    "keys once [bold]sil --install-completion[/] was run.[/]",
    epilog=exit_codes(
        "0 passed, 1 a requirement failed or something differed, 2 usage or invalid scenario, "
        "3 link or board failure or degraded timing, 130 interrupted"
    ),
)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version
        from platform import python_version

        from protocol import frames

        print(
            f"sil {version('attitude-sil')}, layout of the frames {frames.LAYOUT_HASH:08x}, Python {python_version()}"
        )
        raise typer.Exit


@app.callback()
def sil(
    version: Annotated[
        bool, typer.Option("--version", help="Show versions and exit.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Options of `sil` itself."""


VERBS: dict[str, tuple[Callable[..., int], ...]] = {
    "Run": (run.run, run.plant, run.board, replay.replay, run.recover),
    "Look": (report.info, report.report, report.plot, live.live, compare.compare, report.export, report.diff),
    "Study": (ladder.ladder, pil_report.pil_report, sweep.sweep, faults.faults, tables.tables, bench.bench),
    "Prepare": (scenario.scenarios, scenario.check, scenario.schema, doctor.doctor, board_test.board_test),
}
for _panel, _verbs in VERBS.items():
    for _verb in _verbs:
        _page = page_of(_verb)
        app.command(rich_help_panel=_panel, help=_page.help, epilog=_page.epilog)(_verb)

app.add_typer(design.app, rich_help_panel="Prepare")

DISK_FULL = (errno.ENOSPC, errno.EDQUOT)  # no usage error: the same command will do when there is room


def main(argv: list[str] | None = None) -> None:
    """Entry point: maps every expected failure to one line on stderr and its exit code."""
    streams.settle()
    with completion.whole_words():
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
    elif isinstance(error, OSError):
        print(_reason(error), file=sys.stderr)
        return EXIT_LINK if error.errno in DISK_FULL else EXIT_USAGE
    elif isinstance(error, ScenarioInvalid | RunError | JournalError):
        code = EXIT_USAGE
    else:
        raise error
    print(error, file=sys.stderr)
    return code


def _reason(error: OSError) -> str:
    """`FILE: reason`, as far as either is known."""
    files = " to ".join(str(file) for file in (error.filename, error.filename2) if file is not None)
    return ": ".join(filter(None, (files, error.strerror or str(error) or type(error).__name__)))
