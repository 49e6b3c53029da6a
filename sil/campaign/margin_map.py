"""A margin map as files: map.png, map.csv and map.json beside the tables of its sweep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from sil.campaign.margin import INDEPENDENT, Cell, as_json, cells_of, csv_text
from sil.campaign.plan import Plan
from sil.campaign.results import Results
from sil.report.heat_map import Page, Panel, Place, heat_maps
from sil.report.look import DPI
from sil.report.whole_file import beside

PNG, CSV, JSON = "map.png", "map.csv", "map.json"


class Row(NamedTuple):
    """One row of panels: a transport delay and a sensor delay, in ticks."""

    transport: int
    delay: int


def write(results: Results) -> list[Cell]:
    """The three files of what is finished; returns the cells."""
    cells = cells_of(results.plan, results.records)
    for name, text in (
        (CSV, csv_text(cells)),
        (JSON, json.dumps(as_json(results.plan, cells), indent=2, allow_nan=False) + "\n"),
    ):
        with beside(results.directory / name) as new:
            new.write_text(text, encoding="utf-8", newline="")
    if cells:
        draw(results.plan, cells, results.directory / PNG)
    return cells


def draw(plan: Plan, cells: Sequence[Cell], out: Path) -> None:
    """The page of heat maps."""
    page, panels = page_of(plan, cells)
    figure = heat_maps(page, panels)
    with beside(out) as new:
        figure.savefig(new, format="png", dpi=DPI, facecolor=figure.get_facecolor())


def rows_of(plan: Plan, cells: Sequence[Cell]) -> list[Row]:
    """The scenario's own transport delay first, with its sensor delays."""
    own = plan.scenario["transport_delay_ticks"]
    found = {Row(cell.transport, cell.delay) for cell in cells}
    return sorted(found, key=lambda row: (row.transport != own, row.transport, row.delay))


def page_of(plan: Plan, cells: Sequence[Cell]) -> tuple[Page, list[Panel]]:
    """What is drawn."""
    laws = list(dict.fromkeys(cell.law for cell in cells))
    rows = rows_of(plan, cells)
    losses = sorted({cell.loss for cell in cells})
    bursts = sorted({cell.burst for cell in cells} - {0.0}) or [INDEPENDENT]
    scenario = plan.scenario
    period_s, limit = scenario["period_s"], scenario["metrics"]["diverged_deg"]
    seeds = max((cell.runs + cell.failed for cell in cells), default=0)
    runs = sum(cell.runs for cell in cells)
    beyond = f"attitude beyond {limit:g}°" if limit is not None else "not a number"
    manoeuvre = f"{scenario['guidance']['profile']}, {scenario['duration_s']:g} s, T_s {period_s:g} s"
    page = Page(
        heading=f"Margin map of {plan.name}",
        facts=f"manoeuvre {manoeuvre}; frames lost on the way up and on the way down alike; median of {seeds} "
        f"{'seeds' if seeds != 1 else 'seed'} a place, {runs} runs",
        columns=tuple(laws),
        rows=tuple(_row_name(row, scenario["transport_delay_ticks"], period_s) for row in rows),
        x_ticks=tuple(f"{100 * loss:g} %" if loss else "none" for loss in losses),
        y_ticks=tuple("indep." if burst == INDEPENDENT else f"{burst:g}" for burst in bursts),
        x_label="frames lost, each way",
        y_label="mean burst, ticks",
        scale_label="RMS pointing error to the reference, worst axis, deg",
        legend=(
            "the scenario as it is, without loss",
            f"some runs lost: {beyond}",
            "half of the runs or more lost",
        ),
    )
    panels = []
    for y, row in enumerate(rows):
        for x, law in enumerate(laws):
            those = [cell for cell in cells if (cell.law, cell.transport, cell.delay) == (law, *row)]
            places = tuple(_place(cell, losses, bursts) for cell in those)
            panels.append(Panel(y, x, places, f"{law} does not fly with n = {row.transport}"))
    return page, panels


def _row_name(row: Row, own: int, period_s: float) -> str:
    """`sensor 1 tick (0.5 s) late, transport delay n = 1`"""
    ticks = f"{row.delay} tick{'s' if row.delay != 1 else ''} ({row.delay * period_s:g} s)"
    sensor = f"sensor {ticks} late" if row.delay else "sensor on time"
    return f"{sensor}, transport delay n = {row.transport}{' (the scenario)' if row == (own, 0) else ''}"


def _place(cell: Cell, losses: Sequence[float], bursts: Sequence[float]) -> Place:
    """Without loss there are no bursts: one place for all of them."""
    y, height = (bursts.index(cell.burst), 1) if cell.loss else (0, len(bursts))
    return Place(losses.index(cell.loss), y, height, cell.rms_deg, cell.lost, cell.runs, cell.nominal)
