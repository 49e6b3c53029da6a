"""Histories of a run: the one-line ones beside the numbers, and line charts per axis where the window has room."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from rich.text import Text

from sil.screen import marks
from sil.screen.palette import AXES, DIM, TONES
from sil.screen.seen import Seen

LABEL = 8  # columns of the numbers beside a chart
LEAST_SPAN_DEG = 1e-3  # less is drawn as nothing
GAP = 2

Points = list[tuple[float, float]]


def worth_drawing(seen: Seen) -> bool:
    """A line needs two points."""
    return len(seen.past) >= 2


def past(seen: Seen, axis: int, width: int) -> str:
    """|error| of one axis (|attitude| without a reference) in `width` characters, the highest of which is its peak."""
    first, now = (seen.past[0].t_s, seen.past[-1].t_s) if seen.past else (0.0, 0.0)
    count = max(min(width, len(seen.past)), 1)
    points = [(t, abs(y)) for t, y in _curve(seen, "error" if seen.plan.follows else "attitude", axis)]
    values = marks.binned(points, first, now, count)
    top = max((y for _, y in points if math.isfinite(y)), default=0.0)
    return marks.history([values[place * count // width] for place in range(width)], max(top, LEAST_SPAN_DEG))


def since(seen: Seen) -> str:
    """`so far`, or how far back the histories go."""
    run_s = seen.past[-1].t_s if seen.past else 0.0
    return "so far" if run_s <= seen.plan.window_s else f"of the last {seen.plan.window_s:g} s"


def row(seen: Seen, which: str, width: int, height: int) -> list[Text]:
    """Charts of roll, pitch and yaw side by side: `attitude` with its reference, or the `error`; `height` lines."""
    each = (width - 2 * GAP) // 3
    columns = [_chart(seen, which, axis, each, height) for axis in range(3)]
    rows = []
    for place in range(height):
        line = Text("")
        for axis in range(3):
            line.append_text(columns[axis][place]).append(" " * GAP if axis < 2 else "")
        rows.append(line)
    return rows


def _chart(seen: Seen, which: str, axis: int, width: int, height: int) -> list[Text]:
    """Title, braille lines with the numbers of top and bottom, and the axis of time; all `width` characters long."""
    curve = _curve(seen, which, axis)
    series = [_curve(seen, "reference", axis), curve] if which == "attitude" and seen.plan.follows else [curve]
    low, high = marks.span([y for points in series for _, y in points], LEAST_SPAN_DEG)
    first, now = seen.past[0].t_s, seen.past[-1].t_s
    inner = height - 2
    cells = marks.chart(series, (first, now, low, high), width - LABEL, inner)
    title = Text.assemble((f"{AXES[axis]} {which}, deg", TONES[axis]))
    under = f"   {seen.plan.follows} dim" if len(series) == 2 else ""
    if title.cell_len + len(under) <= width:  # else the colour has to tell
        title.append(under, DIM)
    rows = [title]
    labels = {0: high, inner - 1: low}
    for place, cell_row in enumerate(cells):
        label = f"{labels[place]:.4g}" if place in labels else ""
        rows.append(_cells(Text.assemble((f"{label:>{LABEL - 1}} ", DIM)), cell_row, len(series), axis))
    rows.append(Text(f"{'':{LABEL}}{_seconds(first):<{max(width - LABEL - 12, 0)}}{_seconds(now):>12}", DIM))
    for line in rows:
        line.truncate(width, pad=True)
    return rows


def _cells(line: Text, cells: Sequence[int], count: int, axis: int) -> Text:
    """One line of a chart: the last series in the colour of its axis, those under it dim."""
    for is_last, run in groupby(cells, key=lambda cell: cell >> 8 == count - 1):
        text = "".join([chr(marks.BRAILLE + (cell & 0xFF)) if cell else " " for cell in run])
        line.append(text, TONES[axis] if is_last else DIM)
    return line


def _seconds(t_s: float) -> str:
    return f"{t_s:.4g} s" if t_s < 1000 else f"{t_s:,.0f} s"


def _curve(seen: Seen, which: str, axis: int) -> Points:
    """(s, deg) of `attitude`, `reference` or `error`, where it is known."""
    if which == "attitude":
        return [(one.t_s, one.attitude[axis]) for one in seen.past]
    if which == "reference":
        return [(one.t_s, one.reference[axis]) for one in seen.past if one.reference is not None]
    return [(one.t_s, one.error[axis]) for one in seen.past if one.error is not None]
