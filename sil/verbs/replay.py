"""sil replay: recorded packets into a fresh board."""

from __future__ import annotations

from typing import Annotated

import typer

from sil.trouble import EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs.options import JsonOption, RunArgument, SetOption, opened, print_json

REPLAY_BOARDS = ("inproc", "process")


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
    report = replay_run(opened(run_dir), set_ or (), board)
    if as_json:
        first = report.first
        print_json(
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
