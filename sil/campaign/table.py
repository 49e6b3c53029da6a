"""The result of a sweep as a person reads it, in 80 columns: one row a cell of the grid, or one row a metric."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sil.campaign.plan import Plan
from sil.campaign.records import Record
from sil.scenario_errors import shown

MOST_ROWS = 40
MOST_REASONS = 5
MOST_NUMBERS = 6  # of points beside a reason
GOT = re.compile(r", got [^;]*")
COLOURS = {"passed": "green", "interrupted": "yellow", "degraded": "yellow"}
METRICS = (  # key, label, unit, scale
    ("rms_error_deg.max", "rms error to reference", "deg", 1.0),
    ("peak_error_deg.max", "peak error to reference", "deg", 1.0),
    ("rms_setpoint_error_deg.max", "rms error to set-point", "deg", 1.0),
    ("rms_torque_Nm.max", "rms torque", "mN m", 1e3),
    ("peak_torque_Nm.max", "peak torque", "mN m", 1e3),
    ("peak_momentum_Nms.max", "peak wheel momentum", "N m s", 1.0),
    ("diverged_at_s", "diverged at", "s", 1.0),
    ("missed", "commands missed", "", 1.0),
)


def show(summary: Mapping[str, Any], plan: Plan, records: Sequence[Record], console: Console | None = None) -> None:
    """Verdicts, the table that fits the sweep, and why points did not pass."""
    console = console or Console(highlight=False)
    _headline(console, summary, plan)
    single = len(records) <= MOST_ROWS and all(sum(cell["verdicts"].values()) == 1 for cell in summary["cells"])
    if summary["cells"] and single:
        console.print(_points(plan, records))
    elif summary["cells"]:
        console.print(_cells(plan, summary["cells"]))
    else:
        console.print(_metrics(summary["metrics"]))
    _reasons(console, records)
    console.print(f"sweep: {summary['sweep_dir']}", soft_wrap=True)
    console.print("[dim]results.csv, results.json: every point; summary.json: every metric[/]", soft_wrap=True)


def _headline(console: Console, summary: Mapping[str, Any], plan: Plan) -> None:
    counts = "   ".join(
        f"[bold {COLOURS.get(verdict, 'red')}]{verdict} {count}[/]" for verdict, count in summary["verdicts"].items()
    )
    console.print(f"{counts}   {escape(plan.name)}: {summary['finished']} of {summary['points']} points", end="")
    workers = f"{summary['workers']} worker{'s' if summary['workers'] > 1 else ''}"
    console.print(f" in {summary['wall_s']:.1f} s, {workers}")
    sample = summary["sample"]
    if sample:
        drawn = sum(not axis.values for axis in plan.axes)
        kind = "Latin hypercube" if sample["kind"] == "lhs" else "random"
        again = f", {sample['redrawn']} drawn again" if sample["redrawn"] else ""
        keys = f"{drawn} key{'s' if drawn > 1 else ''}"
        console.print(f"[dim]{keys} drawn {sample['draws']} times ({kind}, seed {sample['seed']}{again})[/]")
    console.print()


def _metrics(metrics: Mapping[str, Any]) -> Table:
    """Statistics of the worst axis over all points."""
    table = _table("worst axis of each run", *(">median", ">p95", ">max"), "", ">max at point")
    for key, label, unit, scale in METRICS:
        figures = metrics.get(key)
        if figures is None or not figures["count"] or (key == "missed" and not figures["max"]):
            continue
        numbers = [_number(figures[name], scale) for name in ("median", "p95", "max")]
        table.add_row(label, *numbers, unit, str(figures["max_at_point"]))
    return table


def _cells(plan: Plan, cells: Sequence[Mapping[str, Any]]) -> Table:
    """A row for each cell: how many passed, and the error of the worst axis over its seeds and draws."""
    table = _table(*_short(plan.cell_keys), ">passed", ">rms median", ">p95", ">max", ">peak")
    for cell in cells[:MOST_ROWS]:
        verdicts, metrics = cell["verdicts"], cell["metrics"]
        rms, peak = metrics.get("rms_error_deg.max"), metrics.get("peak_error_deg.max")
        row = [_number(rms[name] if rms else None) for name in ("median", "p95", "max")]
        passed, all_ = verdicts.get("passed", 0), sum(verdicts.values())
        colour = "green" if passed == all_ else "red"
        values = [escape(_value(value)) for value in cell["values"].values()]
        table.add_row(*values, f"[{colour}]{passed}/{all_}[/]", *row, _number(peak["max"] if peak else None))
    table.caption = "error to reference in deg, worst axis: rms over the runs of a row, and the largest peak"
    if len(cells) > MOST_ROWS:
        table.caption += f"; {len(cells) - MOST_ROWS} more cells in summary.json"
    return table


def _points(plan: Plan, records: Sequence[Record]) -> Table:
    """A row for each point of a small grid."""
    table = _table(">point", *_short(plan.cell_keys), "verdict", ">rms", ">peak", ">torque")
    for record in records:
        values = plan.points[record.point - 1].values
        metrics = record.metrics
        table.add_row(
            str(record.point),
            *(escape(_value(values[key])) for key in plan.cell_keys),
            f"[{COLOURS.get(record.verdict, 'red')}]{record.verdict}[/]",
            _number(metrics.get("rms_error_deg.max")),
            _number(metrics.get("peak_error_deg.max")),
            _number(metrics.get("peak_torque_Nm.max"), 1e3),
        )
    table.caption = "worst axis: rms and peak error to reference in deg, peak torque in mN m"
    return table


def _reasons(console: Console, records: Sequence[Record]) -> None:
    """Points that did not pass, together where the reason is the same but for the number."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        if record.reason:
            groups.setdefault((record.verdict, GOT.sub("", record.reason)), []).append(record)
    for (verdict, text), those in list(groups.items())[:MOST_REASONS]:
        numbers = [str(record.point) for record in those[:MOST_NUMBERS]] + ["..."] * (len(those) > MOST_NUMBERS)
        which = f"{len(those)} points" if len(those) > 1 else "point"
        reason = text if len(those) > 1 else those[0].reason
        start = f"[{COLOURS.get(verdict, 'red')}]{verdict}[/]  {which} {', '.join(numbers)}: "
        console.print(start + escape(reason), soft_wrap=True)
    if len(groups) > MOST_REASONS:
        console.print(f"[dim]and {len(groups) - MOST_REASONS} more reasons, in results.csv[/]")


def _table(*headers: str) -> Table:
    """Columns; a header that starts with > is of numbers."""
    table = Table(box=None, pad_edge=False, header_style="bold", caption_justify="left", caption_style="dim")
    for header in headers:
        right = header.startswith(">")
        table.add_column(header.removeprefix(">"), justify="right" if right else "left", overflow="fold")
    return table


def _short(keys: Sequence[str]) -> list[str]:
    """The last part of each key, with as much before it as tells them apart."""
    parts = [key.split(".") for key in keys]
    result = []
    for own in parts:
        length = 2 if own[-1].isdigit() else 1
        while length < len(own) and sum(other[-length:] == own[-length:] for other in parts) > 1:
            length += 1
        result.append(escape(".".join(own[-length:])))
    return result


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else value if isinstance(value, str) else shown(value)


def _number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{value * scale:.4g}"
