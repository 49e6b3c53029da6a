"""sil board-test: does the board on this link do what the specification says, and how fast."""

from __future__ import annotations

import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK
from sil.verbs import completion
from sil.verbs.options import RESULT_PANEL, JsonOption, print_json

if TYPE_CHECKING:
    from sil.board_test import Checked, Order
    from sil.board_test.show import Sheet

CHECKS_PANEL = "Which checks, and how long"
THE_TEST = "the board test"


def board_test(
    board: Annotated[
        str,
        typer.Argument(
            metavar="BOARD",
            help="serial:///dev/X[?baud=N], /dev/X or udp://HOST:PORT of a board that runs; or process, native, "
            "cortex-m, qemu: one that is started for it.",
            autocompletion=completion.testable_boards,
        ),
    ],
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="GROUP",
            help="handshake, states, config, receiver, ticks, numbers, latency, timer, baud, reset, end; "
            "or one check, such as 'ticks: stale'; repeatable.",
            rich_help_panel=CHECKS_PANEL,
            autocompletion=completion.check_groups,
        ),
    ] = None,
    skip: Annotated[
        list[str] | None,
        typer.Option(
            "--skip",
            metavar="GROUP",
            help="Leave out a group, or a check; repeatable.",
            rich_help_panel=CHECKS_PANEL,
            autocompletion=completion.check_groups,
        ),
    ] = None,
    flight: Annotated[
        list[str] | None,
        typer.Option(
            "--flight",
            metavar="SCENARIO",
            help="Fly this one for the numbers; repeatable. Default: pd-root-locus, mrac-rs232, appc-rs232.",
            show_default=False,
            rich_help_panel=CHECKS_PANEL,
            autocompletion=completion.scenarios,
        ),
    ] = None,
    ticks: Annotated[
        int,
        typer.Option("--ticks", metavar="N", min=1, max=100_000, help="Of each flight.", rich_help_panel=CHECKS_PANEL),
    ] = 200,
    exchanges: Annotated[
        int,
        typer.Option(
            "--exchanges", metavar="N", min=1, max=1_000_000, help="For the latency.", rich_help_panel=CHECKS_PANEL
        ),
    ] = 300,
    drift_s: Annotated[
        float,
        typer.Option(
            "--drift-s",
            metavar="S",
            min=1.0,
            max=86_400.0,
            help="How long to watch the board's timer; the uncertainty falls with S^1.5.",
            rich_help_panel=CHECKS_PANEL,
        ),
    ] = 10.0,
    reset: Annotated[
        bool | None,
        typer.Option(
            "--reset/--no-reset",
            help="Ask for the board's reset button, which has to be pressed. Default: ask, where somebody is there.",
            show_default=False,
            rich_help_panel=CHECKS_PANEL,
        ),
    ] = None,
    link: Annotated[
        str,
        typer.Option(
            "--link",
            metavar="LINK",
            help="pty or udp, of a board that is started.",
            rich_help_panel=CHECKS_PANEL,
            autocompletion=completion.own_links,
        ),
    ] = "pty",
    junit: Annotated[
        Path | None,
        typer.Option(
            "--junit", metavar="FILE", help="JUnit XML for CI: a testcase a check.", rich_help_panel=RESULT_PANEL
        ),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Acceptance test of a board: what protocol/SPEC.md asks of it, its numbers bit for bit, how fast it answers.

    Every event in every state, CONFIG and READY, refused packets and garbage, the timing contract, flights of pd, mrac
    and appc against the Python board, which runs beside it as the reference; a histogram of the answers; the board's
    own timer and the drift of its clock; baud rates; reset. A board may leave laws and a timer out: skipped.

    Ends the session of a board that is in one, and leaves it without any. Does not touch a port that another process
    has open. At 115200 baud it takes about two minutes.

    Exit codes: 0 every check passed or was skipped, 2 usage, or what a board of ours needs is not installed, 3 a check
    failed or there is no board, 130 interrupted.

    Examples: sil board-test /dev/ttyUSB0 --reset | sil board-test udp://192.168.7.2:5005 --skip timer |
    sil board-test 'serial:///dev/ttyACM0?baud=460800' --junit board.xml |
    sil board-test cortex-m --only numbers --ticks 1200
    """
    from sil.board_test import Order
    from sil.board_test.examinee import FLIGHTS
    from sil.board_test.show import Sheet, as_dict, as_junit, passed
    from sil.report.junit_file import JunitFile

    somebody = sys.stdin.isatty() and sys.stderr.isatty() and not as_json
    order = Order(
        board,
        link,
        tuple(only or ()),
        tuple(skip or ()),
        tuple(flight or FLIGHTS),
        ticks,
        exchanges,
        reset=reset is True,
        reset_offered=reset is None and somebody,
        drift_s=drift_s,
    )
    began_s = time.monotonic()
    try:
        with JunitFile(junit, "board-test", about=THE_TEST) as page:
            sheet = None if as_json else Sheet()
            tested, interrupted = _tested(order, sheet)
            took_s = time.monotonic() - began_s
            if as_json:
                print_json(as_dict(tested, board, took_s))
            if interrupted:
                raise KeyboardInterrupt
            if sheet is not None:
                sheet.last_line(tested, board, took_s)
            page.write(as_junit(tested, board))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_OK if passed(tested) else EXIT_LINK


def _tested(order: Order, sheet: Sheet | None) -> tuple[list[Checked], bool]:
    """(every check that was made, whether somebody interrupted); shown as they come."""
    from sil.board_test import examine
    from sil.doctor.show import Progress
    from sil.stopping import terminated_like_interrupted

    progress = Progress(quiet_s=0.5)

    def ask(text: str) -> None:
        progress.clear()
        print(text, file=sys.stderr, flush=True)

    tested: list[Checked] = []
    try:
        with terminated_like_interrupted(), closing(examine(order, progress.tell, ask)) as coming:
            for each in coming:
                progress.clear()
                tested.append(each)
                if sheet is not None:
                    sheet.show(each)
    except KeyboardInterrupt:
        return tested, True
    finally:
        progress.clear()
    return tested, False
