"""The result of a sweep as a person reads it, in 80 columns: one row a cell of the grid, or one row a metric."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sil.campaign.plan import SEED_KEY, Plan
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
    ("settling_s.max", "settled after", "s", 1.0),
    ("diverged_at_s", "diverged at", "s", 1.0),
    ("missed", "commands missed", "", 1.0),
)


def show(summary: Mapping[str, Any], plan: Plan, records: Sequence[Record], console: Console | None = None) -> None:
    """Verdicts, the table that fits the sweep, and why points did not pass."""
    console = console or Console(highlight=False, emoji=False)
    _headline(console, summary, plan)
    if records:
        _tables(console, summary, plan, records)
    console.print(f"sweep: {escape(str(summary['sweep_dir']))}", soft_wrap=True)
    console.print("[dim]results.csv, results.json: every point; summary.json: every metric[/]", soft_wrap=True)


def _tables(console: Console, summary: Mapping[str, Any], plan: Plan, records: Sequence[Record]) -> None:
    """By point, by cell or by metric, whichever says most in few rows; then the reasons."""
    if not summary["measured"]:
        console.print("[dim]no statistics: no run came to its end[/]\n")
        _reasons(console, records)
        return
    single = len(records) <= MOST_ROWS and all(sum(cell["verdicts"].values()) == 1 for cell in summary["cells"])
    if summary["cells"] and single:
        console.print(_points(plan, records))
        caption = "worst axis: rms and peak error to reference in deg, peak torque in mN m"
    elif summary["cells"]:
        console.print(_cells(plan, summary["cells"]))
        more = len(summary["cells"]) - MOST_ROWS
        caption = "worst axis, deg: rms error to reference over the runs of a row, largest peak"
        caption += f"; {more} more rows in summary.json" if more > 0 else ""
    else:
        console.print(_metrics(summary["metrics"], plan.scenario["board"] != "none"))
        caption = "worst axis of each run"
    console.print(f"[dim]{caption}{_left_out(summary)}[/]\n")
    _reasons(console, records)
    if seed_is_idle(plan, records):
        console.print("[yellow]note[/]  the seed changes nothing here: no noise in this scenario", soft_wrap=True)


def _left_out(summary: Mapping[str, Any]) -> str:
    """What the statistics are over, where that is not every run to its full length."""
    text = f"; over {summary['measured']} points" if summary["excluded"] else ""
    text += f", without {summary['excluded']} that did not end as planned" if summary["excluded"] else ""
    never = summary["metrics"].get("settling_s.max", {}).get("never")
    text += f"; {summary['diverged']} diverged" if summary["diverged"] else ""
    return text + (f"; {never} never settled" if never else "")


def seed_is_idle(plan: Plan, records: Sequence[Record]) -> bool:
    """The seed was varied, and no figure of any run depends on it: somebody expected noise that is not there."""
    if SEED_KEY not in plan.keys:
        return False
    groups: dict[str, list[Record]] = {}
    for record in records:
        others = {key: value for key, value in plan.points[record.point - 1].values.items() if key != SEED_KEY}
        groups.setdefault(json.dumps(others), []).append(record)
    several = [those for those in groups.values() if len(those) > 1 and those[0].metrics]
    return bool(several) and all(record.metrics == those[0].metrics for those in several for record in those)


def headline(summary: Mapping[str, Any]) -> str:
    """One line without markup: verdicts, and where the results are."""
    return f"{_verdicts(summary)}   {summary['name']}: {summary['sweep_dir']}"


def _headline(console: Console, summary: Mapping[str, Any], plan: Plan) -> None:
    workers = f"{summary['workers']} worker{'s' if summary['workers'] > 1 else ''}"
    points = f"{summary['finished']} of {summary['points']} points in {summary['wall_s']:.1f} s"
    console.print(f"{_verdicts(summary, '[bold {colour}]', '[/]')}   {escape(plan.name)}: {points}, {workers}")
    sample = summary["sample"]
    if sample:
        drawn = sum(not axis.values for axis in plan.axes)
        kind = "Latin hypercube" if sample["kind"] == "lhs" else "random"
        again = f", {sample['redrawn']} drawn again" if sample["redrawn"] else ""
        keys = f"{drawn} key{'s' if drawn > 1 else ''}"
        console.print(f"[dim]{keys} drawn {sample['draws']} times ({kind}, seed {sample['seed']}{again})[/]")
    console.print()


def _verdicts(summary: Mapping[str, Any], before: str = "", after: str = "") -> str:
    """`passed 198   failed 2`, best first; an interruption before all of them."""
    ordered = sorted(summary["verdicts"].items(), key=lambda item: (item[0] != "passed", item[0]))
    texts = [(verdict, f"{verdict} {count}") for verdict, count in ordered]
    if summary["interrupted"]:
        texts.insert(0, ("interrupted", "interrupted"))
    return "   ".join(before.format(colour=COLOURS.get(verdict, "red")) + text + after for verdict, text in texts)


def _metrics(metrics: Mapping[str, Any], errors: bool) -> Table:
    """Statistics of the worst axis over all points. errors: somebody follows a reference."""
    table = _table("", ">median", ">p95", ">max", "", ">max at point")
    for key, label, unit, scale in METRICS:
        figures = metrics.get(key)
        if figures is None or not figures["count"] or ("error" in key and not errors):
            continue
        if key == "missed" and not figures["max"]:
            continue
        never = math.inf if figures["never"] else None
        found = [never if figures[name] is None else figures[name] for name in ("median", "p95", "max")]
        numbers = _numbers(found, scale)
        table.add_row(label, *numbers, unit, str(figures["max_at_point"]))
    return table


def _cells(plan: Plan, cells: Sequence[Mapping[str, Any]]) -> Table:
    """A row for each cell: how many passed, and the error of the worst axis over its seeds and draws."""
    table = _table(*_short(plan.cell_keys), ">passed", ">rms median", ">p95", ">max", ">peak")
    shown_cells = cells[:MOST_ROWS]
    wanted = [("rms_error_deg.max", name) for name in ("median", "p95", "max")] + [("peak_error_deg.max", "max")]
    columns = [_numbers([cell["metrics"].get(key, {}).get(name) for cell in shown_cells]) for key, name in wanted]
    for cell, *numbers in zip(shown_cells, *columns, strict=True):
        passed, all_ = cell["verdicts"].get("passed", 0), sum(cell["verdicts"].values())
        values = [escape(_value(value)) for value in cell["values"].values()]
        colour = "green" if passed == all_ else "red"
        table.add_row(*values, f"[{colour}]{passed}/{all_}[/]", *numbers)
    return table


def _points(plan: Plan, records: Sequence[Record]) -> Table:
    """A row for each point of a small grid."""
    table = _table(">point", *_short(plan.cell_keys), "verdict", ">rms", ">peak", ">torque")
    wanted = (("rms_error_deg.max", 1.0), ("peak_error_deg.max", 1.0), ("peak_torque_Nm.max", 1e3))
    columns = [_numbers([record.metrics.get(key) for record in records], scale) for key, scale in wanted]
    for record, *numbers in zip(records, *columns, strict=True):
        values = [escape(_value(plan.points[record.point - 1].values[key])) for key in plan.cell_keys]
        verdict = f"[{COLOURS.get(record.verdict, 'red')}]{record.verdict}[/]"
        table.add_row(str(record.point), *values, verdict, *numbers)
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
    table = Table(box=None, pad_edge=False, header_style="bold")
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


def _numbers(values: Sequence[float | None], scale: float = 1.0) -> list[str]:
    """With the same number of decimals, so that they can be compared: four digits of the largest."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    largest = max((abs(value) * scale for value in finite), default=0.0)
    decimals = min(9, max(0, 3 - math.floor(math.log10(largest)))) if 0 < largest < math.inf else 0
    return ["-" if v is None else "never" if v == math.inf else f"{v * scale:.{decimals}f}" for v in values]
