"""What the terminal shows: a live view or plain lines on stderr while a run goes on, results on stdout.

Nothing heavy is imported before it is needed: the process that draws (sil.screen.painter) is a package member too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sil.watch import Watch

QUIET, NORMAL, VERBOSE = -1, 0, 1


def new_watch(title: str, verbosity: int = NORMAL, as_json: bool = False) -> Watch:
    """What a run shows of itself on stderr: QUIET nothing, NORMAL a live view (plain lines where stderr is no terminal
    that can show one), VERBOSE also every event and the facts of link and session as lines. as_json: notes only.
    """
    from sil.screen.watch import chosen

    return chosen(title, verbosity, as_json)


def show_summary(summary: Mapping[str, Any], verbosity: int = NORMAL) -> None:
    """The result of a run on stdout, as a person reads it; QUIET: one line, VERBOSE: timing in detail."""
    from sil.screen.summary import show

    show(summary, verbosity)


def requirement_text(line: Mapping[str, Any]) -> str:
    """`rms_error_deg.roll < 0.5   got 0.0706`"""
    got = line.get("reason") or "none" if line["value"] is None else format(line["value"], ".4g")
    return f"{line['requirement']}   got {got}"


def show_table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Plain columns on stdout."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for header in headers:
        table.add_column(header, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table)
