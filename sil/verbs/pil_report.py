"""sil pil-report: what the firmware costs, law by law."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sil.budget import SCENARIOS
from sil.trouble import EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs.options import JsonOption, print_json

if TYPE_CHECKING:
    from sil.budget.judge import Excess
    from sil.budget.measure import Budget
    from sil.budget.table import Core

LAWS = tuple(SCENARIOS)
NOT_A_TERMINAL = 200  # columns of a file or a pipe: nothing is folded


def pil_report(
    laws: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LAWS",
            help=f"{', '.join(LAWS)}. Default: all of them.",
            autocompletion=lambda incomplete: [law for law in LAWS if law.startswith(incomplete)],
        ),
    ] = None,
    board_clock: Annotated[
        float, typer.Option("--board-clock", metavar="MHZ", min=0.001, help="Clock of the part, in MHz.")
    ] = 168.0,
    cpi: Annotated[
        float, typer.Option("--cpi", metavar="X", min=0.01, help="Cycles per instruction that are assumed.")
    ] = 1.5,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against", metavar="FILE", help="A baseline: what --json printed once; growth beyond 2 % fails."
        ),
    ] = None,
    image: Annotated[
        Path | None, typer.Option("--image", metavar="FILE", help="An image of your own. Default: the one that ships.")
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Count what the firmware executes: instructions per law step and per answer, stack, code and memory.

    Flies manoeuvre A with noise on the Python board, feeds the same frames to the image on the emulated Cortex-M, which
    has to give the same answers, and counts. Instructions are exact and repeatable, but no cycles: the milliseconds are
    an assumption (--board-clock, --cpi). Limits: 5,000 instructions per step of pd, 20,000 of appc, 40,000 of mrac,
    10,000 of state_space (measured with order 8); 2 KiB of stack; 32 KiB of code. Writes nothing.

    Exit codes: 0 within limits and baseline, 1 beyond one of them, 2 usage, no unicorn or no image, 3 the image does
    not answer as the Python board, 130 interrupted.

    Examples: sil pil-report | sil pil-report mrac --board-clock 72 --cpi 2 | sil pil-report --json > before.json |
    sil pil-report --against before.json --image firmware/build/zig/mps2-an386.elf
    """
    from sil.budget.flight import fly_manoeuvre_a
    from sil.budget.judge import beyond_limits, grown, read_baseline
    from sil.budget.measure import measure
    from sil.budget.table import Core
    from sil.scenario_errors import one_of

    for law in laws or ():
        if law not in LAWS:
            raise UsageError(f"LAWS: expected {one_of(LAWS, law)}, got {law!r}")
    chosen = [law for law in LAWS if law in (laws or LAWS)]
    baseline = read_baseline(against) if against is not None else None
    with _busy(f"counting the instructions of {', '.join(chosen)}"):
        budget = measure([fly_manoeuvre_a(law) for law in chosen], image)
    found = [*beyond_limits(budget), *grown(budget, baseline or {})]
    core = Core(board_clock, cpi)
    if as_json:
        print_json({**budget.plain(), "assumed": core._asdict(), "beyond": [each._asdict() for each in found]})
    else:
        _print(budget, core, baseline, found)
    return EXIT_REQUIREMENT if found else EXIT_OK


def _busy(what: str) -> AbstractContextManager[object]:
    """Something moves on a terminal meanwhile, and nothing of it stays."""
    from rich.console import Console

    return Console(stderr=True).status(what) if sys.stderr.isatty() else nullcontext()


def _print(budget: Budget, core: Core, baseline: dict[str, float] | None, found: list[Excess]) -> None:
    from rich.console import Console

    from sil.budget.table import below, table
    from sil.screen.palette import BAD

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = NOT_A_TERMINAL
    console.print(table(budget, core, baseline))
    console.print()
    for line in below(budget, core):
        console.print(line, markup=False)
    for excess in found:
        console.print(str(excess), style=BAD, markup=False)
