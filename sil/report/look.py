"""How pictures look: lines that lose no peak, frames, legends. Lengths are in inches, text in points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sil.report.colours import Look
from sil.runs import Array

WIDTH_in, DPI = 12.0, 100
DASHED, DOTTED = (0, (5, 3)), ":"
_POINTS_MAX = 6000  # per line: more than a page can show


def empty(height: float, look: Look, width: float = WIDTH_in) -> Figure:
    """A page without anything on it, in inches."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor=look.paper)
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


def _thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """The tail beyond whole bins is kept point by point."""
    size = -(-len(t) * 2 // _POINTS_MAX)
    whole = len(t) // size * size
    blocks = np.where(np.isfinite(values[:whole]), values[:whole], 0.0).reshape(-1, size)
    start = np.arange(len(blocks)) * size
    picks = np.sort(np.column_stack([start + blocks.argmin(axis=1), start + blocks.argmax(axis=1)]), axis=1).ravel()
    picks = np.append(picks, np.arange(whole, len(t)))
    return t[picks], values[picks]
