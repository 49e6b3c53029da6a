"""A design on the terminal: what it is, a column of margins for each loop, the discrete form, warnings."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.table import Table
from rich.text import Text

from sil.design.fuzzy import Inference
from sil.design.linear import Array
from sil.design.margins import Margins
from sil.design.printed import PRINTED
from sil.design.sheet import Sheet, written
from sil.screen.palette import BAD, DIM, GOOD, WARN

NOT_A_TERMINAL = 160  # columns of a file or a pipe: nothing is folded
ROWS: tuple[tuple[str, Callable[[Margins], float | None], str], ...] = (
    ("crossover", lambda found: found.crossover_radps, "rad/s"),
    ("phase margin", lambda found: found.phase_deg, "deg"),
    ("gain may grow to", lambda found: found.gain_up, "times"),
    ("gain may fall to", lambda found: found.gain_down, "times"),
    ("delay margin", lambda found: found.delay_s, "s"),
    ("modulus margin", lambda found: found.modulus, ""),
)


def show(sheet: Sheet) -> None:
    console = _console()
    console.print(Text(sheet.title, "bold"))
    inertia = sheet.inertia if len(set(sheet.inertia)) > 1 else sheet.inertia[:1]
    console.print(f"torque = J x C(s) (ref - y), J = {', '.join(f'{J:g}' for J in inertia)} kg m^2, plant 1/(J s^2)")
    console.print(f"C(s) = {written(sheet.C)}", markup=False, soft_wrap=True)
    for name, value in sheet.facts.items():
        console.print(f"{name} = {value:.4g}")
    console.print()
    console.print(_margins(sheet.margins))
    if sheet.discrete is not None and sheet.sampling is not None:
        console.print()
        console.print(_discrete(sheet), markup=False)
    for warning in sheet.warnings:
        console.print(f"warning: {warning}", style=WARN, markup=False)


def show_printed() -> None:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("name", "where", "J", "remark"):
        table.add_column(column, justify="right" if column == "J" else "left")
    for name, each in PRINTED.items():
        remark = f"{each.remark}; {each.warning}" if each.warning else each.remark
        table.add_row(name, each.source, f"{each.inertia:g}", remark)
    _console().print(table)


def show_fuzzy(inference: Inference, table: Array) -> None:
    """The one-input table as rows of eight; of a plane, its corner values only."""
    console = _console()
    ranges = ", ".join(f"+-{end:g}" for end in inference.ranges)
    console.print(
        f"Mamdani, min and {inference.aggregation}, exact centroid; inputs {ranges} rad, output +-{inference.reach:g}"
    )
    if table.ndim == 1:
        console.print(f"-f(e) / L at e = 0 to {inference.ranges[0]:g} rad, {len(table)} entries")
        for start in range(0, len(table), 8):
            console.print("  " + " ".join(f"{value:.6f}" for value in table[start : start + 8]))
        return
    console.print(f"f / L, {table.shape[0]} x {table.shape[1]}: error down, angle across, both from -range to range")
    for row in _thinned(table):
        console.print("  " + " ".join(f"{value:9.6f}" for value in row))


def _thinned(table: Array) -> Array:
    step = max((len(table) - 1) // 8, 1)
    return table[::step, ::step]


def _console() -> Console:
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = NOT_A_TERMINAL
    return console


def _margins(loops: dict[str, Margins]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("")
    for name in loops:
        table.add_column(name, justify="right")
    table.add_column("")
    table.add_row("loop", *map(_verdict, loops.values()), "")
    for name, value, unit in ROWS:
        table.add_row(name, *(_cell(found, value(found)) for found in loops.values()), Text(unit, DIM))
    return table


def _verdict(found: Margins) -> Text:
    if not found.stable:
        return Text("UNSTABLE", BAD)
    return Text("drifts", WARN) if found.drifts else Text("stable", GOOD)


def _cell(found: Margins, value: float | None) -> Text:
    if value is None:
        return Text("any" if found.stable else "-", DIM)
    return Text(f"{value:.4g}")


def _discrete(sheet: Sheet) -> str:
    assert sheet.discrete is not None and sheet.sampling is not None
    if not sheet.discrete.order:
        return f"every {sheet.sampling.period_s:g} s: law pd with the sensed rate, no states"
    needed = sheet.bits
    assert needed is not None
    fraction = "more than 30" if needed.fraction_bits is None else needed.fraction_bits
    return (
        f"discrete: {sheet.sampling.method}, order {sheet.discrete.order}, largest coefficient {needed.largest:.3g}; "
        f"{fraction} fraction bits keep the response within {needed.change:.1%}"
    )
