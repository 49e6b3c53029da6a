"""How pictures look: colours on light and dark paper, lines that lose no peak, frames, legends, units.

The colours are Okabe and Ito's, which colour-blind readers can tell apart; on dark paper lighter ones of the same hues.
Lengths are in inches, text in points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sil.runs import Array

AXIS_NAMES = ("roll", "pitch", "yaw")
WIDTH_in, DPI = 12.0, 100
DASHED, DOTTED = (0, (5, 3)), ":"
_POINTS_MAX = 6000  # per line: more than a page can show
_MILLI_BELOW = 0.2  # of the unit: 0.15 N m is drawn as 150 mN m
_MICRO_MAX = 20_000.0  # µs


class Look(NamedTuple):
    """Paper, text and lines. `axes` are the colours of roll, pitch, yaw, `over` those of a line drawn over them."""

    paper: str
    ink: str
    faint: str
    grid: str
    axes: tuple[str, str, str]
    over: tuple[str, str, str]
    runs: tuple[str, ...]
    span_s: tuple[float, float] = (-math.inf, math.inf)  # the part of the time that is drawn

    def window(self, first_s: float, last_s: float) -> tuple[float, float]:
        """Limits of a time axis for data from first_s to last_s."""
        return max(first_s, self.span_s[0]), min(last_s, self.span_s[1])


LIGHT = Look(
    paper="white",
    ink="#222222",
    faint="#7A7A7A",
    grid="#DDDDDD",
    axes=("#D55E00", "#009E73", "#0072B2"),
    over=("#6E2F00", "#004D38", "#002F4D"),
    runs=("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222"),
)
DARK = Look(
    paper="#16191D",
    ink="#E6E6E6",
    faint="#9C9C9C",
    grid="#343A41",
    axes=("#F07C2E", "#2FC79A", "#56B4E9"),
    over=("#FFD9BF", "#C4F2E3", "#D3ECFB"),
    runs=("#56B4E9", "#F07C2E", "#2FC79A", "#E595C2", "#F0E442", "#8C9EFF", "#E6E6E6"),
)


def empty(height: float, look: Look) -> Figure:
    """A page without anything on it."""
    figure = Figure(figsize=(WIDTH_in, height), dpi=DPI, facecolor=look.paper)
    FigureCanvasAgg(figure)
    return figure


def headed(figure: Figure, heading: str, facts: str, left: float, look: Look) -> None:
    """Heading and a line of facts at the top."""
    height = figure.get_figheight()
    figure.text(left, 1 - 0.36 / height, heading, fontsize=15, fontweight="bold", color=look.ink, va="center")
    figure.text(left, 1 - 0.64 / height, facts, fontsize=10, color=look.faint, va="center")


def finish(ax: Axes, label: str, unit: str, title: str, look: Look, zero: bool = False) -> None:
    """Label with its unit, title, grid and spines."""
    ax.set_ylabel(f"{label} in {unit}" if unit not in ("", "1") else label, fontsize=11, color=look.ink)
    if title:
        ax.set_title(title, loc="left", fontsize=11, color=look.ink, fontweight="bold")
    ax.set_facecolor(look.paper)
    ax.grid(True, color=look.grid, lw=0.7)
    ax.set_axisbelow(True)
    if zero:
        ax.axhline(0.0, color=look.faint, lw=0.7, zorder=1)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(look.faint)
    ax.tick_params(colors=look.ink, labelsize=10)
    ax.yaxis.get_offset_text().set_color(look.ink)
    if ax.get_yscale() == "linear":
        ax.ticklabel_format(axis="y", useOffset=False, scilimits=(-4, 5))


def mark_zero(ax: Axes, values: Array, look: Look) -> None:
    """Say so where there is nothing but zeros, instead of drawing a line between ticks that mean nothing."""
    if np.isfinite(values).any() and not np.any(values[np.isfinite(values)]):
        ax.set_ylim(-1.0, 1.0)
        ax.set_yticks([0.0])
        ax.text(0.5, 0.62, "zero throughout", transform=ax.transAxes, ha="center", fontsize=10, color=look.faint)


def legend(ax: Axes, handles: Sequence[Line2D], look: Look) -> None:
    """Beside the panel, at its top."""
    key = ax.legend(
        handles=list(handles), frameon=False, fontsize=10, loc="upper left", borderaxespad=0.0, labelcolor=look.ink
    )
    key.set_bbox_to_anchor((1.012, 1.0), transform=ax.transAxes)


def line(ax: Axes, t: Array, values: Array, step: bool = False, **style: Any) -> None:
    """One line within the limits of the time axis, which stand already, so that the other axis fits what is seen.

    Beyond _POINTS_MAX points the smallest and largest of each bin are drawn, so that no peak is lost.
    """
    first, last = np.searchsorted(t, ax.get_xlim())
    seen = slice(max(int(first) - 1, 0), int(last) + 1)
    t, values = t[seen], values[seen]
    if len(t) > _POINTS_MAX:
        t, values = _thinned(t, values)
    ax.plot(t, values, drawstyle="steps-post" if step else "default", solid_joinstyle="round", **style)


def unbroken(angle_deg: Array) -> Array:
    """The same with a gap where it jumps from one end of the turn to the other, so that no line is drawn across."""
    jumps = np.flatnonzero(np.abs(np.diff(angle_deg)) > 180.0) + 1
    if not jumps.size:
        return angle_deg
    result = angle_deg.copy()
    result[jumps] = np.nan
    return result


def scaled(values: Array, unit: str) -> tuple[float, str]:
    """(1000, "mN m") where everything is below 0.2 of the unit, (0.001, "ms") for many µs; other units as they are."""
    peak = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if unit.startswith("N m") and peak < _MILLI_BELOW:
        return 1000.0, f"m{unit}"
    return (0.001, "ms") if unit == "µs" and peak > _MICRO_MAX else (1.0, unit)


def _thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """The tail beyond whole bins is kept point by point."""
    size = -(-len(t) * 2 // _POINTS_MAX)
    whole = len(t) // size * size
    blocks = np.where(np.isfinite(values[:whole]), values[:whole], 0.0).reshape(-1, size)
    start = np.arange(len(blocks)) * size
    picks = np.sort(np.column_stack([start + blocks.argmin(axis=1), start + blocks.argmax(axis=1)]), axis=1).ravel()
    picks = np.append(picks, np.arange(whole, len(t)))
    return t[picks], values[picks]
