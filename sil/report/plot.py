"""Pictures of a run: an overview on one page, and detail pages for attitude, error, torque, momentum, identification.

Roll, pitch and yaw keep their colour on every page (Okabe-Ito, safe for colour-blind readers); the reference is dashed,
the set-point dotted. Legends stand beside the data. A page is 12 inches wide: 1200 pixels as PNG.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sil.runs import Array, Run
from sil.trouble import UsageError

AXIS_NAMES = ("roll", "pitch", "yaw")
COLOURS = ("#D55E00", "#009E73", "#0072B2")
DARK = ("#6E2F00", "#004D38", "#002F4D")  # the same, for the reference over the attitude
INK, FAINT, GRID = "#222222", "#7A7A7A", "#DDDDDD"
WIDTH_in, PANEL_in, DPI = 12.0, 2.5, 100
FORMATS = (".png", ".pdf")
_POINTS_MAX = 6000  # per line: more than a page can show


class PlotError(UsageError):
    """The picture cannot be made: one line."""


class Page(NamedTuple):
    """One picture; `name` is what its file is called."""

    name: str
    figure: Figure


def plot(run: Run, out: Path) -> list[Path]:
    """Write pictures. `out` *.pdf: all pages in one file; *.png: the overview; a directory: every page as a PNG.

    Returns the files written. Raises PlotError for other suffixes, an empty run, or a place that cannot be written.
    """
    if not len(run):
        raise PlotError(f"{run.path}: the run has no ticks to plot")
    try:
        if out.suffix == ".pdf":
            return [_write_pdf(out, pages(run))]
        if out.suffix == ".png":
            return [_write_png(out, overview(run))]
        if out.suffix:
            raise PlotError(f"{out}: expected one of {', '.join(FORMATS)} or a directory, got {out.suffix}")
        out.mkdir(parents=True, exist_ok=True)
        return [_write_png(out / f"{page.name}.png", page.figure) for page in pages(run)]
    except OSError as error:
        raise PlotError(f"{out}: {error.strerror or error}") from error


def pages(run: Run) -> list[Page]:
    """All pages of a run; those without data (no board: no error, no identification) are left out."""
    made = [
        Page("overview", overview(run)),
        Page("attitude", per_axis(run, _attitude_title(run), _attitude_of_axis, _attitude_key(run, True))),
        Page("error", per_axis(run, _error_title(run), _error_of_axis, ())),
        Page("torque", per_axis(run, "Torque on the body", _torque_of_axis, _torque_key(run))),
        Page("momentum", stack(run, "Wheel momentum", [_momentum])),
    ]
    if not _controlled(run):
        made = [page for page in made if page.name != "error"]
    identified = _identification_panels(run)
    if identified:
        made.append(Page("identification", stack(run, "Identification", identified)))
    return made


def overview(run: Run) -> Figure:
    """Everything on one page, the three axes in one panel each."""
    panels: list[Panel] = [_attitude, _error, _torque, _momentum]
    if not _controlled(run):
        panels.remove(_error)
    return stack(run, "", [*panels, *_identification_panels(run)[:1]])


Panel = Callable[[Axes, Run], None]
AxisPanel = Callable[[Axes, Run, int], None]


def stack(run: Run, what: str, panels: Sequence[Panel]) -> Figure:
    """Panels above each other, with one time axis."""
    figure, axes = _page(run, what, len(panels))
    for ax, panel in zip(axes, panels, strict=True):
        panel(ax, run)
    if axes[0].get_legend() is None:
        _legend(axes[0], _axis_key())
    figure.align_ylabels(axes)
    return figure


def per_axis(run: Run, what: str, panel: AxisPanel, key: Iterable[Line2D]) -> Figure:
    """One panel for each of roll, pitch and yaw, and one legend for the line styles."""
    figure, axes = _page(run, what, 3)
    for i, ax in enumerate(axes):
        panel(ax, run, i)
        ax.set_title(AXIS_NAMES[i], loc="left", fontsize=11, color=COLOURS[i], fontweight="bold")
    handles = list(key)
    if handles:
        _legend(axes[0], handles)
    figure.align_ylabels(axes)
    return figure


# -- panels with all axes ----------------------------------------------------------------------------------------------


def _attitude(ax: Axes, run: Run) -> None:
    for i in range(3):
        if _controlled(run):
            _line(ax, run.t_s, run.setpoint_deg[:, i], color=COLOURS[i], lw=0.9, ls=":", alpha=0.8, step=True)
        _line(ax, run.t_s, _unbroken(run.attitude_deg[:, i]), color=COLOURS[i], lw=1.7)
        _line(ax, run.t_s, _unbroken(run.reference_deg[:, i]), color=DARK[i], lw=1.0, ls=(0, (5, 3)))
    _finish(ax, "attitude", "deg", _attitude_title(run))
    _legend(ax, [*_axis_key(), *_attitude_key(run)])


def _error(ax: Axes, run: Run) -> None:
    for i in range(3):
        _line(ax, run.t_s, _unbroken(_error_deg(run)[:, i]), color=COLOURS[i], lw=1.2)
    _finish(ax, "error", "deg", _error_title(run), zero=True)


def _torque(ax: Axes, run: Run) -> None:
    factor, unit = _scaled(run.applied_Nm, "N m")
    for i in range(3):
        _line(ax, run.t_s, run.command_Nm[:, i] * factor, color=COLOURS[i], lw=0.8, alpha=0.35, step=True)
        _line(ax, run.t_s, run.applied_Nm[:, i] * factor, color=COLOURS[i], lw=1.2, step=True)
    _limits(ax, _near_limits(run, (0, 1, 2)), factor)
    _finish(ax, "torque", unit, "Torque on the body", zero=True)
    _focus(ax, run.applied_Nm * factor)
    _legend(ax, _torque_key(run))


def _momentum(ax: Axes, run: Run) -> None:
    factor, unit = _scaled(run.momentum_Nms, "N m s")
    for i in range(3):
        _line(ax, run.t_s, run.momentum_Nms[:, i] * factor, color=COLOURS[i], lw=1.5)
    _limits(ax, _near_limits(run, (0, 1, 2), "momentum_max_Nms", "momentum_Nms"), factor)
    _finish(ax, "momentum", unit, "Wheel momentum", zero=True)


# -- panels of one axis ------------------------------------------------------------------------------------------------


def _attitude_of_axis(ax: Axes, run: Run, i: int) -> None:
    if _controlled(run):
        _line(ax, run.t_s, run.setpoint_deg[:, i], color=FAINT, lw=1.1, ls=":", step=True)
    _line(ax, run.t_s, _unbroken(run.attitude_deg[:, i]), color=COLOURS[i], lw=2.0)
    _line(ax, run.t_s, _unbroken(run.reference_deg[:, i]), color=INK, lw=1.0, ls=(0, (5, 3)))
    _finish(ax, "attitude", "deg", "")


def _error_of_axis(ax: Axes, run: Run, i: int) -> None:
    error = _error_deg(run)
    _line(ax, run.t_s, _unbroken(error[:, i]), color=COLOURS[i], lw=1.2)
    _finish(ax, "error", "deg", "", zero=True)
    rms = float(np.sqrt(np.nanmean(np.square(error[:, i])))) if np.isfinite(error[:, i]).any() else float("nan")
    peak = float(np.nanmax(np.abs(error[:, i]))) if np.isfinite(error[:, i]).any() else float("nan")
    ax.set_title(f"whole run: rms {rms:.3g} deg, peak {peak:.3g} deg", loc="right", fontsize=10, color=FAINT)


def _torque_of_axis(ax: Axes, run: Run, i: int) -> None:
    factor, unit = _scaled(run.applied_Nm, "N m")
    _line(ax, run.t_s, run.command_Nm[:, i] * factor, color=FAINT, lw=1.0, step=True)
    _line(ax, run.t_s, run.applied_Nm[:, i] * factor, color=COLOURS[i], lw=1.3, step=True)
    _limits(ax, _near_limits(run, (i,)), factor)
    _finish(ax, "torque", unit, "", zero=True)
    _focus(ax, run.applied_Nm[:, i] * factor)


# -- what a run has ----------------------------------------------------------------------------------------------------


def _controlled(run: Run) -> bool:
    """A board answered, or at least was asked."""
    return bool(run.config_words) or len(run.commands) > 0


def _error_deg(run: Run) -> Array:
    """attitude - reference, or - set-point where the board has no reference model."""
    return run.error_deg if np.isfinite(run.error_deg).any() else run.setpoint_error_deg


def _error_title(run: Run) -> str:
    return "Tracking error: attitude − " + ("reference" if np.isfinite(run.error_deg).any() else "set-point")


def _attitude_title(run: Run) -> str:
    return "Attitude against reference" if np.isfinite(run.reference_deg).any() else "Attitude"


def _unbroken(angle_deg: Array) -> Array:
    """The same with a gap where it jumps from one end of the turn to the other, so that no line is drawn across."""
    jumps = np.flatnonzero(np.abs(np.diff(angle_deg)) > 180.0) + 1
    if not jumps.size:
        return angle_deg
    result = angle_deg.copy()
    result[jumps] = np.nan
    return result


# -- identification ----------------------------------------------------------------------------------------------------


def _identification_panels(run: Run) -> list[Panel]:
    """What this law's TELEMETRY tells of its identification: the gain g, or theta and the trace of its covariance."""
    known = [
        ("g", "gain g", "1", "Identified gain g (inertia = believed inertia / g)"),
        ("b0", "b0", "rad/(N m)", "Identified b0"),
        ("b1", "b1", "rad/(N m)", "Identified b1"),
        ("a1", "a1", "1", "Identified a1"),
        ("a2", "a2", "1", "Identified a2"),
        ("d", "d", "rad", "Identified d"),
        ("trace", "trace F", "1", "Trace of the covariance F"),
        ("P", "variance P", "1", "Variance of g"),
    ]
    present = [entry for entry in known if f"{entry[0]}_x" in run.telemetry]
    return [_triple(*entry) for entry in present]


def _triple(name: str, label: str, unit: str, title: str) -> Panel:
    def panel(ax: Axes, run: Run) -> None:
        values = run.reported(name)
        for i in range(3):
            seen = np.isfinite(values[:, i])
            _line(ax, run.t_s[seen], values[seen, i], color=COLOURS[i], lw=1.5)
        _finish(ax, label, "" if unit == "1" else unit, title)
        if name in ("trace", "P") and np.nanmin(values) > 0 and np.nanmax(values) > 30 * np.nanmin(values):
            ax.set_yscale("log")

    return panel


# -- the page ----------------------------------------------------------------------------------------------------------


def _page(run: Run, what: str, panels: int) -> tuple[Figure, list[Axes]]:
    """An empty page with its heading and `panels` panels that share the time axis."""
    head, foot = 1.15, 0.6
    height = head + foot + PANEL_in * panels
    figure = Figure(figsize=(WIDTH_in, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(panels, 1, sharex=True))
    figure.subplots_adjust(left=0.085, right=0.855, top=1 - head / height, bottom=foot / height, hspace=0.25)
    figure.text(0.085, 1 - 0.36 / height, _heading(run, what), fontsize=15, fontweight="bold", color=INK, va="center")
    figure.text(0.085, 1 - 0.64 / height, _facts(run), fontsize=10, color=FAINT, va="center")
    axes[-1].set_xlabel("time in s", fontsize=11, color=INK)
    first, last = float(run.t_s[0]), float(run.t_s[-1]) + run.period_s
    axes[-1].set_xlim(first, last)
    for ax in axes:
        ax.autoscale(enable=False, axis="x")
    return figure, list(axes)


def _heading(run: Run, what: str) -> str:
    return f"{run.name} — {what}" if what else run.name


def _facts(run: Run) -> str:
    law: Any = run.scenario.get("law") or run.meta.get("law") or {}
    parts = []
    if not _controlled(run):
        law = {"name": "none: torque from a schedule"}
    if isinstance(law, dict) and law.get("name"):
        form = law.get("form")
        parts.append(f"law {law['name']}" + (f" ({form})" if form else ""))
    parts.append(f"sampling {run.period_s:g} s")
    delay = run.scenario.get("transport_delay_ticks")
    if delay is not None and _controlled(run):
        parts.append(f"transport delay {delay} tick" + ("" if delay == 1 else "s"))
    parts.append(f"{len(run)} ticks, {run.end.get('reason', '')}")
    return "   ·   ".join(parts)


def _finish(ax: Axes, label: str, unit: str, title: str, zero: bool = False) -> None:
    ax.set_ylabel(f"{label} in {unit}" if unit else label, fontsize=11, color=INK)
    if title:
        ax.set_title(title, loc="left", fontsize=11, color=INK, fontweight="bold")
    ax.grid(True, color=GRID, lw=0.7)
    ax.set_axisbelow(True)
    if zero:
        ax.axhline(0.0, color=FAINT, lw=0.7, zorder=1)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(FAINT)
    ax.tick_params(colors=INK, labelsize=10)
    ax.ticklabel_format(axis="y", useOffset=False, scilimits=(-4, 5))


def _legend(ax: Axes, handles: Sequence[Line2D]) -> None:
    key = ax.legend(handles=list(handles), frameon=False, fontsize=10, loc="upper left", borderaxespad=0.0)
    key.set_bbox_to_anchor((1.012, 1.0), transform=ax.transAxes)


def _axis_key() -> list[Line2D]:
    return [Line2D([], [], color=colour, lw=2.2, label=name) for name, colour in zip(AXIS_NAMES, COLOURS, strict=True)]


def _attitude_key(run: Run, with_attitude: bool = False) -> list[Line2D]:
    key = [Line2D([], [], color=FAINT, lw=2.2, label="attitude")] if with_attitude else []
    if np.isfinite(run.reference_deg).any():
        key.append(Line2D([], [], color=INK, lw=1.0, ls=(0, (5, 3)), label="reference"))
    if _controlled(run):
        key.append(Line2D([], [], color=FAINT, lw=1.1, ls=":", label="set-point"))
    return key


def _torque_key(run: Run) -> list[Line2D]:
    key = [Line2D([], [], color=INK, lw=1.6, label="applied")]
    if np.isfinite(run.command_Nm).any():
        key.append(Line2D([], [], color=FAINT, lw=0.9, alpha=0.7, label="commanded"))
    if len(_near_limits(run, (0, 1, 2))):
        key.append(Line2D([], [], color=INK, lw=0.9, ls="-.", label="wheel limit"))
    return key


def _limits(ax: Axes, limits: Array, factor: float) -> None:
    """The wheels' limits, as lines on both sides of zero."""
    for value in limits:
        for sign in (-1, 1):
            ax.axhline(sign * value * factor, color=INK, lw=0.9, ls="-.")


def _near_limits(run: Run, axes: Sequence[int], key: str = "torque_max_Nm", name: str = "applied_Nm") -> Array:
    """Limits actuators.wheels.`key` of these axes, where the values `name` come near them."""
    limits = ((run.scenario.get("actuators") or {}).get("wheels") or {}).get(key)
    values = run[name]
    if limits is None or not np.isfinite(values).any():
        return np.empty(0)
    chosen = np.unique(np.broadcast_to(np.asarray(limits, float), 3)[list(axes)])
    return np.asarray(chosen[chosen < 2.0 * np.nanmax(np.abs(values))])


def _focus(ax: Axes, applied: Array) -> None:
    """Keep the applied torque readable where a command far beyond the limit would squeeze it to a line."""
    peak = float(np.nanmax(np.abs(applied))) if np.isfinite(applied).any() else 0.0
    low, high = ax.get_ylim()
    if peak > 0 and max(-low, high) > 3 * peak:
        ax.set_ylim(-1.6 * peak, 1.6 * peak)


def _scaled(values: Array, unit: str) -> tuple[float, str]:
    """(1000, "mN m") where everything is below 0.2 of the unit."""
    peak = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    return (1000.0, f"m{unit}") if peak < 0.2 else (1.0, unit)


def _line(ax: Axes, t: Array, values: Array, step: bool = False, **style: Any) -> None:
    """One line; beyond _POINTS_MAX points the smallest and largest of each bin, so that no peak is lost."""
    if len(t) > _POINTS_MAX:
        t, values = _thinned(t, values)
    ax.plot(t, values, drawstyle="steps-post" if step else "default", solid_joinstyle="round", **style)


def _thinned(t: Array, values: Array) -> tuple[Array, Array]:
    size = -(-len(t) * 2 // _POINTS_MAX)
    whole = len(t) // size * size
    blocks = np.where(np.isfinite(values[:whole]), values[:whole], 0.0).reshape(-1, size)
    start = np.arange(len(blocks)) * size
    picks = np.sort(np.column_stack([start + blocks.argmin(axis=1), start + blocks.argmax(axis=1)]), axis=1).ravel()
    return t[picks], values[picks]


def _write_pdf(out: Path, made: Sequence[Page]) -> Path:
    with PdfPages(out, metadata={"CreationDate": None}) as document:
        for page in made:
            document.savefig(page.figure)
    return out


def _write_png(out: Path, figure: Figure) -> Path:
    figure.savefig(out, dpi=DPI)
    return out
