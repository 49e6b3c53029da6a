"""A page of heat maps with one colour scale: a column a law, a row a delay; each panel loss across, bursts upwards.

Colours are cividis, which reads the same with any colour vision and in grey. Nothing is told by colour alone: every
place has its number, places where runs were lost are hatched, and the nominal one is framed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FuncFormatter

from sil.report.colours import LIGHT, Look
from sil.report.look import WIDTH_in, empty, headed

LEFT_in, RIGHT_in, TOP_in, BOTTOM_in, GAP_X_in, GAP_Y_in = 1.15, 1.35, 1.6, 1.15, 0.25, 0.78
ROW_in, COLUMN_in = 1.75, 2.6
TITLE_in, ROW_TITLE_in = 0.44, 0.12  # above a panel
MARGIN_in = 0.35
FRAME = "#D55E00"
LOST = "#F2F2F2"  # paper of a place where half the runs or more are lost
_DARK_BELOW = 0.55  # of the colour scale: text on it is white
_DECADES = 2.0  # the scale is never narrower


class Place(NamedTuple):
    """One rectangle of a panel. x: column; y, height: rows; value: infinite where it has none, or None: not flown."""

    x: int
    y: int
    height: int
    value: float | None
    lost: int
    runs: int
    nominal: bool


class Panel(NamedTuple):
    """One heat map, at a row and a column of the page; without places `note` says why."""

    row: int
    column: int
    places: tuple[Place, ...]
    note: str = ""


class Page(NamedTuple):
    """Everything on the page in words. columns: over the columns; rows: over the rows."""

    heading: str
    facts: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    x_ticks: tuple[str, ...]
    y_ticks: tuple[str, ...]
    x_label: str
    y_label: str
    scale_label: str
    legend: tuple[str, str, str]  # framed, hatched, not coloured


def heat_maps(page: Page, panels: Sequence[Panel], look: Look = LIGHT) -> Figure:
    """The page."""
    height = TOP_in + BOTTOM_in + len(page.rows) * ROW_in + (len(page.rows) - 1) * GAP_Y_in
    count = len(page.columns)
    width = LEFT_in + RIGHT_in + count * COLUMN_in + (count - 1) * GAP_X_in
    figure = empty(height, look, max(WIDTH_in, width))  # numbers stay readable, however many laws there are
    headed(figure, page.heading, page.facts, MARGIN_in / figure.get_figwidth(), look)
    norm = _norm([place.value for panel in panels for place in panel.places])
    flown = [panel for panel in panels if panel.places]
    for panel in panels:
        ax = _axes(figure, page, panel)
        leftmost = panel.column == min((other.column for other in flown if other.row == panel.row), default=-1)
        lowest = panel.row == max((other.row for other in flown if other.column == panel.column), default=-1)
        _frame(ax, page, panel, look)
        _label(ax, page, panel, leftmost, lowest, look)
        for place in panel.places:
            _draw(ax, place, norm, look)
    _scale(figure, page, norm, look)
    _legend(figure, page, look)
    return figure


def _norm(values: Sequence[float | None]) -> LogNorm:
    """Whole decades around all finite values."""
    finite = [value for value in values if value is not None and 0 < value < math.inf] or [1.0]
    low, high = math.floor(math.log10(min(finite))), math.ceil(math.log10(max(finite)))
    return LogNorm(10.0**low, 10.0 ** max(high, low + _DECADES))


def _axes(figure: Figure, page: Page, panel: Panel) -> Axes:
    width_in, height_in = figure.get_size_inches()
    count = len(page.columns)
    panel_in = (width_in - LEFT_in - RIGHT_in - (count - 1) * GAP_X_in) / count
    left = LEFT_in + panel.column * (panel_in + GAP_X_in)
    bottom = height_in - TOP_in - (panel.row + 1) * ROW_in - panel.row * GAP_Y_in
    return figure.add_axes((left / width_in, bottom / height_in, panel_in / width_in, ROW_in / height_in))


def _frame(ax: Axes, page: Page, panel: Panel, look: Look) -> None:
    """Limits, names of the column and of the row."""
    ax.set(xlim=(0, len(page.x_ticks)), ylim=(0, len(page.y_ticks)), facecolor=look.paper)
    for spine in ax.spines.values():
        spine.set_visible(False)
    over = {"transform": ax.transAxes, "color": look.ink, "va": "baseline", "clip_on": False}
    if panel.row == 0:
        title = page.columns[panel.column]
        ax.text(0, 1 + TITLE_in / ROW_in, title, fontsize=13, fontweight="bold", **over)  # type: ignore[arg-type]
    if panel.column == 0:
        ax.text(0, 1 + ROW_TITLE_in / ROW_in, page.rows[panel.row], fontsize=10, **over)  # type: ignore[arg-type]


def _label(ax: Axes, page: Page, panel: Panel, leftmost: bool, lowest: bool, look: Look) -> None:
    """Ticks, at the outer panels with what they mean; in a panel without places, why it has none."""
    ax.tick_params(length=0, labelsize=9.5, colors=look.ink, pad=3)
    if not panel.places:
        ax.set(xticks=[], yticks=[])
        ax.text(0.5, 0.5, panel.note, transform=ax.transAxes, fontsize=9.5, color=look.faint, ha="center", va="center")
        return
    rows = len(page.y_ticks)
    ax.set_xticks([i + 0.5 for i in range(len(page.x_ticks))], page.x_ticks)
    ax.set_yticks([i + 0.5 for i in range(rows)], page.y_ticks if leftmost else [""] * rows)
    if leftmost:
        ax.set_ylabel(page.y_label, fontsize=9.5, color=look.ink, labelpad=3)
    if lowest:
        ax.set_xlabel(page.x_label, fontsize=9.5, color=look.ink, labelpad=4)


def _draw(ax: Axes, place: Place, norm: LogNorm, look: Look) -> None:
    coloured = place.value is not None and math.isfinite(place.value)
    share = float(norm(max(place.value or norm.vmin or 0.0, norm.vmin or 0.0))) if coloured else 1.0
    fill = colormaps["cividis"](share) if coloured else LOST
    ink = "white" if coloured and share < _DARK_BELOW else "#222222"
    corner, size = (place.x, place.y), (1.0, place.height)
    ax.add_patch(Rectangle(corner, *size, facecolor=fill, edgecolor=look.paper, lw=1.6))
    if place.lost:
        light = (1.0, 1.0, 1.0, 0.55) if ink == "white" else (0.13, 0.13, 0.13, 0.4)
        ax.add_patch(Rectangle(corner, *size, fill=False, hatch="////", edgecolor=light, lw=0.0))
    if place.nominal:
        ax.add_patch(
            Rectangle(
                (place.x + 0.045, place.y + 0.06),
                0.91,
                place.height - 0.12,
                fill=False,
                edgecolor=FRAME,
                lw=2.2,
                zorder=4,
            )
        )
    box = {"facecolor": fill, "edgecolor": "none", "pad": 1.2} if place.lost else None
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": ink, "fontsize": 9, "bbox": box, "zorder": 5}
    ax.text(place.x + 0.5, place.y + place.height / 2, _words(place), **style)


def _words(place: Place) -> str:
    """The number, and how many runs were lost; a place that was not flown has a dash."""
    if place.value is None:
        return "–"
    lost = f"{place.lost}/{place.runs} lost"
    if math.isinf(place.value):
        return lost
    number = _number(place.value)
    return f"{number}\n{lost}" if place.lost else number


def _number(value: float) -> str:
    """Two digits that count, without an exponent down to 0.0001."""
    if value >= 9.95:
        return f"{value:.0f}"
    decimals = 1 - math.floor(math.log10(value)) if value > 0 else 0
    return f"{value:.{decimals}f}" if decimals < 6 else f"{value:.0e}"


def _scale(figure: Figure, page: Page, norm: LogNorm, look: Look) -> None:
    width_in, height_in = figure.get_size_inches()
    body_in = height_in - TOP_in - BOTTOM_in
    tall_in = min(body_in, 5.0)
    ax = figure.add_axes(
        ((width_in - RIGHT_in + 0.3) / width_in, (height_in - TOP_in - tall_in) / height_in, 0.2 / width_in,
         tall_in / height_in)
    )  # fmt: skip
    bar = figure.colorbar(ScalarMappable(norm, colormaps["cividis"]), cax=ax)
    bar.set_label(page.scale_label, fontsize=9.5, color=look.ink, labelpad=6)
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.tick_params(labelsize=9.5, colors=look.ink)
    bar.outline.set_visible(False)  # type: ignore[operator]


def _legend(figure: Figure, page: Page, look: Look) -> None:
    framed, hatched, blank = page.legend
    handles = [
        Patch(facecolor="none", edgecolor=FRAME, lw=2.2, label=framed),
        Patch(facecolor="#B5A66B", edgecolor=(0.13, 0.13, 0.13, 0.6), hatch="////", lw=0.0, label=hatched),
        Patch(facecolor=LOST, edgecolor=(0.13, 0.13, 0.13, 0.4), hatch="////", lw=0.0, label=blank),
    ]
    corner = (MARGIN_in / figure.get_figwidth(), 0.12 / figure.get_figheight())
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=corner, ncol=3, frameon=False, fontsize=9.5,
        labelcolor=look.ink, handlelength=1.8, handleheight=1.2, columnspacing=2.0,
    )  # fmt: skip
