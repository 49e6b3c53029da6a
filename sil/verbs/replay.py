"""sil replay: recorded packets into a fresh board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil.trouble import EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs.options import KEYS_PANEL, JsonOption, JunitOption, RunArgument, SetOption, opened, print_json

if TYPE_CHECKING:
    from sil.replay import Report
    from sil.runs import Run

REPLAY_BOARDS = ("inproc", "process", "native", "cortex-m", "qemu")


def replay(
    run_dir: RunArgument,
    set_: SetOption = None,
    board: Annotated[
        str,
        typer.Option(
            "--board",
            metavar="BOARD",
            help="The fresh board: inproc, process, or the firmware in native, cortex-m, qemu.",
            rich_help_panel=KEYS_PANEL,
            autocompletion=lambda incomplete: [each for each in REPLAY_BOARDS if each.startswith(incomplete)],
        ),
    ] = "inproc",
    junit: JunitOption = None,
    as_json: JsonOption = False,
) -> int:
    """Feed a run's recorded packets to a fresh board: identical answers, or the first difference, decoded.

    Reads RUN/run.mcap, which holds the scenario too, and writes nothing but --junit. With --set the fresh board flies
    other parameters: the CONFIG words that differ are listed, and the first tick whose answer differs. A law of your
    own is looked for where the run found it.

    Exit codes: 0 identical, 1 an answer differs, 2 no such run, no board in it, or a bad override, 3 the board fails,
    130 interrupted.

    Examples: sil replay runs/mrac-rs232-001 | sil replay runs/mrac-rs232-001 --board cortex-m --junit replay.xml |
    sil replay runs/mrac-rs232-001 --set law.params.c2_pole=0.7
    """
    from sil.replay import replay as replay_run
    from sil.report.junit_file import JunitFile
    from sil.scenario_errors import one_of

    if board not in REPLAY_BOARDS:
        raise UsageError(f"--board: expected {one_of(REPLAY_BOARDS, board)}, got {board!r}")
    with JunitFile(junit, str(run_dir), about="replay is identical", source=run_dir) as page:
        run = opened(run_dir)
        report = replay_run(run, set_ or (), board)
        if junit is not None:
            page.write(_junit(run, report, board))
    if as_json:
        print_json(_as_dict(report))
    else:
        for line in [*_apart(report), *_found(report)]:
            print(line)
    return EXIT_OK if report.identical else EXIT_REQUIREMENT


def _as_dict(report: Report) -> dict[str, Any]:
    from sil.replay import decoded

    first = report.first
    return {
        "identical": report.identical,
        "ticks": report.ticks,
        "sessions": report.sessions,
        "lost": report.lost,
        "law_file": report.law_file,
        "config": [{"word": w, "recorded": a, "now": b} for w, a, b in report.config],
        "first_difference": None
        if first is None
        else {"tick": first.tick, "recorded": decoded(first.recorded), "replayed": decoded(first.replayed)},
    }


def _apart(report: Report) -> list[str]:
    """What was not the recorded one to begin with: the file of the law, words of CONFIG."""
    words = [f"CONFIG differs: {word}: recorded {then}, now {now}" for word, then, now in report.config]
    return [report.law_file, *words] if report.law_file else words


def _found(report: Report) -> list[str]:
    from sil.replay import decoded

    if report.first is None:
        found = f"identical: {report.ticks} ticks, {report.sessions} session{'s' * (report.sessions != 1)}"
        lost = f"; {report.lost} tick{'s' * (report.lost != 1)} without an answer to compare" if report.lost else ""
        return [found + lost]
    return [
        f"differs at tick {report.first.tick}, after {report.ticks} identical ticks",
        f"  recorded: {decoded(report.first.recorded)}",
        f"  replayed: {decoded(report.first.replayed)}",
    ]


def _junit(run: Run, report: Report, board: str) -> str:
    from sil.report.junit import of_replay

    facts = {
        "scenario": str(run.scenario.get("name")),
        "seed": str(run.scenario.get("seed")),
        "run_dir": str(run.directory),
        "log": str(run.path),
        "board": board,
        "ticks": str(report.ticks),
    }
    difference = "" if report.identical else "\n".join([*_apart(report), *_found(report)])
    return of_replay(facts["scenario"], facts, difference)
