"""sil bench: what the testbed costs on this machine, beside something comparable in the same minutes."""

from __future__ import annotations

from typing import Annotated

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_OK
from sil.verbs.options import JsonOption, print_json


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAMES",
            help="codec, recorder, law, plant, loop, boards, lockstep, wakeup, fast, live. Default: all.",
        ),
    ] = None,
    repeats: Annotated[
        int | None,
        typer.Option("--repeats", metavar="N", min=1, max=1000, help="Interleaved repeats; default 5, quick 2."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Short ones, in about four minutes: to see that all of it works here.")
    ] = False,
    as_json: JsonOption = False,
) -> int:
    """Measure this machine: ratios to something run beside us in the same minutes, medians and spreads.

    lockstep: against a bare ping-pong on a pty. boards: the firmware, native and emulated, against the Python board.
    wakeup, fast: against cyclictest (Debian package rt-tests), else a small C loop. live: a run that viewers look at
    against one that nobody does. plant, loop: against Basilisk (pip install 'attitude-sil\\[bench]'). codec, recorder,
    law: against the least that anybody would have to do.

    All of it takes about half an hour; Ctrl-C prints what is finished. Close other programs first: the machine's load
    is in the table.

    Exit codes: 0 measured, whatever the goals say, 2 no such bench, 130 interrupted.

    Examples: sil bench --quick | sil bench lockstep plant | sil bench wakeup --repeats 5 --json
    """
    from sil.bench import machine
    from sil.bench.book import Plan
    from sil.bench.series import run_series
    from sil.bench.shown import Progress, show

    plan = Plan(repeats or (2 if quick else 5), quick)
    progress, facts = Progress(), machine.facts()
    try:
        books, interrupted = run_series(names or (), plan, progress)
    finally:
        progress.close()
    if as_json:
        head = {"machine": facts, "repeats": plan.repeats, "quick": quick, "interrupted": interrupted}
        print_json({**head, "benches": {book.name: book.plain() for book in books}})
    else:
        show(books, facts, interrupted)
    return EXIT_INTERRUPTED if interrupted else EXIT_OK
