"""Small pictures made of characters: bars about zero, filled bars, one-line histories, line charts in braille dots.

Pure functions of numbers: strings out, no colour, no terminal. What is not a number leaves its place empty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

LEVELS = " ▁▂▃▄▅▆▇█"
FULL, LEFT_HALF, RIGHT_HALF, ZERO = "━", "╸", "╺", "┿"
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # braille bit of (row, column) within a cell
BRAILLE = 0x2800
LARGEST = 1e12  # what is beyond it, of either sign, is not drawn
RESOLVED = 1e-9  # of the largest number of a span: closer labels could not be told apart

Points = Sequence[tuple[float, float]]


def filled(share: float, width: int) -> tuple[str, str]:
    """(bar, rest) of together `width` characters; share 0..1, more is full. The bar ends on half a character."""
    if width <= 0:
        return "", ""
    halves = math.ceil(min(share, 1.0) * 2 * width) if share > 0 else 0
    bar = FULL * (halves // 2) + (LEFT_HALF if halves % 2 else "")
    return bar, FULL * (width - len(bar))


def about_zero(share: float, width: int) -> tuple[str, str, str]:
    """(rest, bar, rest) of together 2 * (width // 2) + 1 characters with zero in the middle; share -1..1, clipped."""
    side = max(width // 2, 0)
    if not math.isfinite(share):
        share = math.copysign(1.0, share) if math.isinf(share) else 0.0
    halves = round(min(abs(share), 1.0) * 2 * side)
    whole, half = divmod(halves, 2)
    empty = FULL * (side - whole - half)
    if share < 0:
        return empty, RIGHT_HALF * half + FULL * whole + ZERO, FULL * side
    if halves == 0:
        return FULL * side, ZERO, FULL * side
    return FULL * side, ZERO + FULL * whole + LEFT_HALF * half, empty


def binned(points: Points, low: float, high: float, count: int) -> list[float | None]:
    """The largest value of `points` (x, y) in each of `count` equal parts of low..high; None where none falls.

    A part without points takes the value before it, so that a history with few points has no holes.
    """
    bins: list[float | None] = [None] * count
    scale = count / (high - low) if high > low else 0.0
    for x, y in points:
        if math.isfinite(y) and low <= x <= high:
            place = min(int((x - low) * scale), count - 1)
            held = bins[place]
            bins[place] = y if held is None else max(held, y)
    for place in range(1, count):
        if bins[place] is None:
            bins[place] = bins[place - 1]
    return bins


def history(values: Sequence[float | None], top: float) -> str:
    """One character per value, 0..top in eight steps; None is a blank, and what is above zero always shows."""
    text = ""
    for value in values:
        if value is None:
            text += LEVELS[0]
        else:
            share = value / top if top > 0 else 0.0
            text += LEVELS[min(max(math.ceil(share * 8), 1), 8)]
    return text


def chart(series: Sequence[Points], box: tuple[float, float, float, float], width: int, height: int) -> list[list[int]]:
    """Braille cells of line charts: rows from the top, each `width` numbers: index of the series * 256 + dots.

    series: points (x, y) in order of x; later ones are drawn over earlier ones, and a cell belongs to the last one in
    it. box: (x low, x high, y low, y high); what lies outside is cut off. 0 is an empty cell.
    """
    cells = [[0] * width for _ in range(height)]
    x_low, x_high, y_low, y_high = box
    if not (x_high > x_low and y_high > y_low and width > 0 and height > 0):
        return cells
    columns, rows = 2 * width - 1, 4 * height - 1
    for index, points in enumerate(series):
        before: tuple[int, int] | None = None
        for column, values in groupby(points, key=lambda point: _place(point[0], x_low, x_high, columns)):
            heights = [_place(y, y_high, y_low, rows) for _, y in values if math.isfinite(y)]
            if not heights or not 0 <= column <= columns:
                before = None
                continue
            _line(cells, index, before or (column, heights[0]), (column, heights[0]))
            _line(cells, index, (column, min(heights)), (column, max(heights)))
            before = (column, heights[-1])
    return cells


def _place(value: float, low: float, high: float, count: int) -> int:
    """Dot 0..count of a value in low..high; far outside is as good as outside."""
    share = (value - low) / (high - low)
    return round((-1.0 if share < -1.0 else 2.0 if share > 2.0 else share) * count)


def _line(cells: list[list[int]], index: int, start: tuple[int, int], end: tuple[int, int]) -> None:
    """Dots on a straight line, both ends included."""
    (x0, y0), (x1, y1) = start, end
    steps = max(abs(x1 - x0), abs(y1 - y0), 1)
    for step in range(steps + 1):
        x, y = x0 + round((x1 - x0) * step / steps), y0 + round((y1 - y0) * step / steps)
        if 0 <= y < 4 * len(cells) and 0 <= x < 2 * len(cells[0]):
            row, column = y // 4, x // 2
            old = cells[row][column]
            cells[row][column] = index * 256 + ((old & 0xFF) | DOTS[y % 4][x % 2])


def span(values: Sequence[float], least: float) -> tuple[float, float]:
    """(low, high) round numbers around the values up to LARGEST, at least `least` apart, and so far that floats can."""
    drawn = [value for value in values if abs(value) <= LARGEST]
    low, high = (min(drawn), max(drawn)) if drawn else (0.0, 0.0)
    least = max(least, RESOLVED * max(abs(low), abs(high)))
    if high - low < least:
        middle = (low + high) / 2
        low, high = middle - least / 2, middle + least / 2
    step = 10.0 ** math.floor(math.log10(high - low))
    step = next(step * part for part in (0.1, 0.2, 0.5, 1.0) if (high - low) / (step * part) <= 20)
    return math.floor(low / step) * step, math.ceil(high / step) * step
