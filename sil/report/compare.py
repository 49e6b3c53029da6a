"""Several runs in one table: error, effort, settling, misses, verdict. `rows` gives data, `table` a rich table, `csv`.

Three lines to a run, one for each axis, so that the table stays the same for two runs and for fifty; on a wide terminal
it has more columns.
"""

from __future__ import annotations

import csv as csv_module
import io
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rich import box
from rich.table import Table
from rich.text import Text

from sil.metrics import as_json, measure
from sil.report.colours import AXIS_NAMES
from sil.report.facts import labels, law_of
from sil.report.signals import controlled
from sil.runs import Run

WIDE = 120  # characters from which on all columns fit
_FOLLOWING = ("rms_error_deg", "rms_setpoint_error_deg", "peak_error_deg", "settling_s")  # needs somebody who follows
_COLOURS = {"passed": "green", "interrupted": "yellow", "degraded": "yellow", "failed": "red"}


class Column(NamedTuple):
    """A metric of three axes in the table; smaller is better in all of them."""

    metric: str
    heading: str
    unit: str
    factor: float
    wide: bool  # only on a wide terminal


COLUMNS = (
    Column("rms_error_deg", "rms\nerror", "deg", 1.0, False),
    Column("peak_error_deg", "peak\nerror", "deg", 1.0, False),
    Column("rms_setpoint_error_deg", "rms to\nset-point", "deg", 1.0, True),
    Column("settling_s", "\nsettling", "s", 1.0, False),
    Column("effort_Nms", "\neffort", "N m s", 1.0, False),
    Column("rms_torque_Nm", "rms\ntorque", "mN m", 1e3, True),
    Column("peak_torque_Nm", "peak\ntorque", "mN m", 1e3, True),
    Column("peak_momentum_Nms", "peak\nmomentum", "mN m s", 1e3, True),
)


class Row(NamedTuple):
    """One run. metrics: those of sil.metrics.measure; None where this run has no such thing."""

    label: str
    run: str | None  # its log; None: made for this table only, and gone by now
    scenario: str
    law: str
    seed: Any
    verdict: str | None  # None: there is no summary.json that says
    reason: str
    ticks: int
    duration_s: float
    metrics: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values. What did not settle is null in settling_s, and false in `settled` (null: no step)."""
        settled = [None if s is None else math.isfinite(s) for s in self.metrics["settling_s"] or [None] * 3]
        return {**self._asdict(), "metrics": {**as_json(self.metrics), "settled": settled}}


def rows(runs: Sequence[Run], verdicts: Mapping[int, str] | None = None, temporary: Collection[int] = ()) -> list[Row]:
    """One for each run; `verdicts` by index are those of runs that were just made, `temporary` of those not kept."""
    given = verdicts or {}
    return [
        _row(run, label, given.get(i) or run.summary.get("verdict"), i in temporary)
        for i, (run, label) in enumerate(zip(runs, labels(runs), strict=True))
    ]


def table(found: Sequence[Row], width: int) -> Table:
    """For reading: the smallest value of an axis among the runs that did not diverge is bold."""
    wide = width >= WIDE
    columns = [column for column in COLUMNS if wide or not column.wide]
    made = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1 if wide else 0, 0, 0), header_style="bold")
    made.add_column("\n\nrun", overflow="fold", min_width=12)
    made.add_column("\n\naxis", no_wrap=True)
    for column in columns:
        made.add_column(f"{column.heading}\n{column.unit}", justify="right", no_wrap=True)
    made.add_column("\n\nmissed", justify="right", no_wrap=True)
    made.add_column("\n\nverdict", no_wrap=True)
    best = {column.metric: [_best(found, column.metric, axis) for axis in range(3)] for column in columns}
    for i, row in enumerate(found):
        cells = [_cells(row, column, best[column.metric]) for column in columns]
        missed = Text(_missed(row))
        made.add_row(Text(row.label), Text("\n".join(AXIS_NAMES)), *cells, missed, _verdict(row))
        if i < len(found) - 1:
            made.add_row()
    return made


def notes(found: Sequence[Row]) -> Iterator[str]:
    """What the table does not say by itself."""
    if len({row.duration_s for row in found}) > 1:
        yield f"not over the same time: {', '.join(f'{row.label} {row.duration_s:g} s' for row in found)}"
    if len({row.metrics["from_tick"] for row in found}) > 1:
        starts = ", ".join(f"{row.label} {row.metrics['from_tick']}" for row in found)
        yield f"not from the same tick on: {starts}"
    if any(_best(found, column.metric, axis) is not None for column in COLUMNS for axis in range(3)):
        yield "bold: the smallest among the runs that followed a set-point and did not diverge"
    if any(math.inf in (row.metrics["settling_s"] or ()) for row in found):
        yield "never: it did not stay within 2 % of the step (at least 0.1 deg) before the next one"


def csv(found: Sequence[Row]) -> str:
    """A line per run, units in the header; empty: there is none, inf: never settled."""
    out = io.StringIO()
    writer = csv_module.writer(out, lineterminator="\n")
    metrics = list(found[0].metrics)
    triples = [name for name in metrics if any(isinstance(row.metrics[name], list) for row in found)]
    wide = [[f"{name}.{axis}" for axis in AXIS_NAMES] if name in triples else [name] for name in metrics]
    facts = ("label", "run", "scenario", "law", "seed", "verdict", "reason", "ticks", "duration_s")
    writer.writerow([*facts, *(name for names in wide for name in names)])
    for row in found:
        values = [(name, row.metrics[name]) for name in metrics]
        numbers = [(value or [None] * 3) if name in triples else [value] for name, value in values]
        writer.writerow([*(getattr(row, fact) for fact in facts), *(number for each in numbers for number in each)])
    return out.getvalue()


def _row(run: Run, label: str, verdict: str | None, temporary: bool) -> Row:
    metrics = measure(run)
    if not controlled(run):
        metrics |= dict.fromkeys(_FOLLOWING)
    return Row(
        label,
        None if temporary else str(run.path),
        run.name,
        law_of(run),
        run.meta.get("seed"),
        verdict,
        str(run.end.get("reason", "")),
        len(run),
        len(run) * run.period_s,
        metrics,
    )


# -- cells -------------------------------------------------------------------------------------------------------------


def _best(found: Sequence[Row], metric: str, axis: int) -> float | None:
    """The smallest of an axis, where two or more were measured over the same time and are not all the same."""
    followed = [row for row in found if row.metrics["rms_error_deg"] is not None]
    calm = [row for row in followed if row.metrics["diverged_at_s"] is None]
    if len({(row.duration_s, row.metrics["from_tick"]) for row in calm}) > 1:
        return None
    triples = [row.metrics[metric] for row in calm]
    numbers = [t[axis] for t in triples if t and t[axis] is not None and math.isfinite(t[axis])]
    return min(numbers) if len(set(numbers)) > 1 else None


def _cells(row: Row, column: Column, best: Sequence[float | None]) -> Text:
    values = row.metrics[column.metric] or [None] * 3
    lines = []
    for value, smallest in zip(values, best, strict=True):
        followed = row.metrics["diverged_at_s"] is None and row.metrics["rms_error_deg"] is not None
        wins = followed and value is not None and value == smallest
        lines.append(Text(_number(value, column.factor), style="bold" if wins else ""))
    return Text("\n").join(lines)


def _number(value: float | None, factor: float) -> str:
    if value is None:
        return "-"
    if math.isinf(value):
        return "never"
    scaled = value * factor
    return "NaN" if math.isnan(value) else f"{scaled:.0f}" if 1e4 <= scaled < 1e6 else f"{scaled:.4g}"


def _missed(row: Row) -> str:
    late = row.metrics["late"]
    return f"{row.metrics['missed']}\n{late} late" if late else str(row.metrics["missed"])


def _verdict(row: Row) -> Text:
    said = Text(row.verdict or "not judged", style=_COLOURS.get(row.verdict or "", "dim"))
    at_s = row.metrics["diverged_at_s"]
    return said if at_s is None else said.append(f"\ndiverged\nat {at_s:g} s", style="red")
