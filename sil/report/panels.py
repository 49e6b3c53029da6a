"""Pictures of one run: an overview on one page, and detail pages with a panel for each axis.

Roll, pitch and yaw keep their colour on every page; the reference is dashed, the set-point dotted. Legends stand beside
the data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sil.report import look as looks
from sil.report.colours import AXIS_NAMES, Look, scaled
from sil.report.facts import facts
from sil.report.look import DASHED, DOTTED, finish, legend, line, unbroken
from sil.report.signals import Signal, controlled, error_deg, logarithmic, near_limits, signals_of
from sil.runs import Array, Run

PANEL_in = 2.5
_HEAD_in, _FOOT_in, _LEFT = 1.15, 0.6, 0.085

Panel = Callable[[Axes, Run, Look], None]
AxisPanel = Callable[[Axes, Run, int, Look], None]


def stack(run: Run, what: str, panels: Sequence[Panel], look: Look) -> Figure:
    """Panels above each other, with one time axis."""
    figure, axes = _page(run, what, len(panels), look)
    for ax, panel in zip(axes, panels, strict=True):
        panel(ax, run, look)
    if axes[0].get_legend() is None and len(axes[0].get_lines()) >= len(AXIS_NAMES):
        legend(axes[0], _axis_key(look), look)
    figure.align_ylabels(axes)
    return figure


def per_axis(run: Run, name: str, look: Look) -> Figure:
    """One panel for each of roll, pitch and yaw of a signal in PER_AXIS, and one legend for the line styles."""
    panel, key = PER_AXIS[name]
    figure, axes = _page(run, _title(run, name), 3, look)
    for i, ax in enumerate(axes):
        panel(ax, run, i, look)
        ax.set_title(AXIS_NAMES[i], loc="left", fontsize=11, color=look.axes[i], fontweight="bold")
    handles = list(key(run, look))
    if handles:
        legend(axes[0], handles, look)
    figure.align_ylabels(axes)
    return figure


def panel_of(signal: Signal) -> Panel:
    """All axes of a signal in one panel."""
    special = _WHOLE.get(signal.name)
    if special is not None:
        return special

    def panel(ax: Axes, run: Run, look: Look) -> None:
        _plain(ax, run, signal, look)

    return panel


# -- panels with all axes ----------------------------------------------------------------------------------------------


def _plain(ax: Axes, run: Run, signal: Signal, look: Look) -> None:
    values = signal.read(run)
    factor, unit = scaled(values, signal.unit)
    columns = values.reshape(len(run), -1) * factor
    colours = look.axes if columns.shape[1] == 3 else (look.ink,)
    for column, colour in zip(columns.T, colours, strict=True):
        shown = np.isfinite(column)
        line(ax, run.t_s[shown], column[shown], signal.step, color=colour, lw=1.4 if len(colours) == 3 else 0.9)
    if logarithmic(signal.name, values):
        ax.set_yscale("log")
    finish(ax, signal.label, unit, signal.title, look, signal.zero)
    looks.mark_zero(ax, values, look)


def _attitude(ax: Axes, run: Run, look: Look) -> None:
    for i in range(3):
        if controlled(run):
            line(ax, run.t_s, run.setpoint_deg[:, i], True, color=look.axes[i], lw=0.9, ls=DOTTED, alpha=0.8)
        line(ax, run.t_s, unbroken(run.attitude_deg[:, i]), color=look.axes[i], lw=1.7)
        line(ax, run.t_s, unbroken(run.reference_deg[:, i]), color=look.over[i], lw=1.0, ls=DASHED)
    finish(ax, "attitude", "deg", _title(run, "attitude"), look)
    legend(ax, [*_axis_key(look), *_attitude_key(run, look)], look)


def _error(ax: Axes, run: Run, look: Look) -> None:
    for i in range(3):
        line(ax, run.t_s, unbroken(error_deg(run)[:, i]), color=look.axes[i], lw=1.2)
    finish(ax, "error", "deg", _title(run, "error"), look, zero=True)


def _torque(ax: Axes, run: Run, look: Look) -> None:
    factor, unit = scaled(run.applied_Nm, "N m")
    for i in range(3):
        line(ax, run.t_s, run.command_Nm[:, i] * factor, True, color=look.axes[i], lw=0.8, alpha=0.35)
        line(ax, run.t_s, run.applied_Nm[:, i] * factor, True, color=look.axes[i], lw=1.2)
    _limits(ax, near_limits(run, (0, 1, 2)), factor, look)
    finish(ax, "torque", unit, _title(run, "torque"), look, zero=True)
    _focus(ax, run.applied_Nm * factor)
    legend(ax, _torque_key(run, look), look)


def _momentum(ax: Axes, run: Run, look: Look) -> None:
    factor, unit = scaled(run.momentum_Nms, "N m s")
    for i in range(3):
        line(ax, run.t_s, run.momentum_Nms[:, i] * factor, color=look.axes[i], lw=1.5)
    _limits(ax, near_limits(run, (0, 1, 2), "momentum_max_Nms", "momentum_Nms"), factor, look)
    finish(ax, "momentum", unit, _title(run, "momentum"), look, zero=True)


_WHOLE: Mapping[str, Panel] = MappingProxyType(
    {"attitude": _attitude, "error": _error, "torque": _torque, "momentum": _momentum}
)


# -- panels of one axis ------------------------------------------------------------------------------------------------


def _attitude_of_axis(ax: Axes, run: Run, i: int, look: Look) -> None:
    if controlled(run):
        line(ax, run.t_s, run.setpoint_deg[:, i], True, color=look.faint, lw=1.1, ls=DOTTED)
    line(ax, run.t_s, unbroken(run.attitude_deg[:, i]), color=look.axes[i], lw=2.0)
    line(ax, run.t_s, unbroken(run.reference_deg[:, i]), color=look.ink, lw=1.0, ls=DASHED)
    finish(ax, "attitude", "deg", "", look)


def _error_of_axis(ax: Axes, run: Run, i: int, look: Look) -> None:
    error = error_deg(run)[:, i]
    line(ax, run.t_s, unbroken(error), color=look.axes[i], lw=1.2)
    finish(ax, "error", "deg", "", look, zero=True)
    finite = error[np.isfinite(error)]
    rms = float(np.sqrt(np.mean(np.square(finite)))) if finite.size else float("nan")
    peak = float(np.abs(finite).max()) if finite.size else float("nan")
    ax.set_title(f"whole run: rms {rms:.3g} deg, peak {peak:.3g} deg", loc="right", fontsize=10, color=look.faint)


def _torque_of_axis(ax: Axes, run: Run, i: int, look: Look) -> None:
    factor, unit = scaled(run.applied_Nm, "N m")
    line(ax, run.t_s, run.command_Nm[:, i] * factor, True, color=look.faint, lw=1.0)
    line(ax, run.t_s, run.applied_Nm[:, i] * factor, True, color=look.axes[i], lw=1.3)
    _limits(ax, near_limits(run, (i,)), factor, look)
    finish(ax, "torque", unit, "", look, zero=True)
    _focus(ax, run.applied_Nm[:, i] * factor)


# -- the page ----------------------------------------------------------------------------------------------------------


def _page(run: Run, what: str, panels: int, look: Look) -> tuple[Figure, list[Axes]]:
    """An empty page with its heading and `panels` panels that share the time axis."""
    height = _HEAD_in + _FOOT_in + PANEL_in * panels
    figure = looks.empty(height, look)
    axes = np.atleast_1d(figure.subplots(panels, 1, sharex=True))
    top, bottom = 1 - _HEAD_in / height, _FOOT_in / height
    figure.subplots_adjust(left=_LEFT, right=0.855, top=top, bottom=bottom, hspace=0.25)
    looks.headed(figure, f"{run.name} — {what}" if what else run.name, facts([run]), _LEFT, look)
    axes[-1].set_xlabel("time in s", fontsize=11, color=look.ink)
    axes[-1].set_xlim(look.window(float(run.t_s[0]), float(run.t_s[-1]) + run.period_s))
    for ax in axes:
        ax.autoscale(enable=False, axis="x")
    return figure, list(axes)


def _title(run: Run, name: str) -> str:
    if name == "attitude" and np.isfinite(run.reference_deg).any():
        return "Attitude against reference"
    return signals_of(run)[name].title


def _axis_key(look: Look) -> list[Line2D]:
    return [
        Line2D([], [], color=colour, lw=2.2, label=name) for name, colour in zip(AXIS_NAMES, look.axes, strict=True)
    ]


def _attitude_key(run: Run, look: Look, with_attitude: bool = False) -> list[Line2D]:
    key = [Line2D([], [], color=look.faint, lw=2.2, label="attitude")] if with_attitude else []
    if np.isfinite(run.reference_deg).any():
        key.append(Line2D([], [], color=look.ink, lw=1.0, ls=DASHED, label="reference"))
    if controlled(run):
        key.append(Line2D([], [], color=look.faint, lw=1.1, ls=DOTTED, label="set-point"))
    return key


def _torque_key(run: Run, look: Look) -> list[Line2D]:
    key = [Line2D([], [], color=look.ink, lw=1.6, label="applied")]
    if np.isfinite(run.command_Nm).any():
        key.append(Line2D([], [], color=look.faint, lw=0.9, alpha=0.7, label="commanded"))
    if len(near_limits(run, (0, 1, 2))):
        key.append(Line2D([], [], color=look.ink, lw=0.9, ls="-.", label="wheel limit"))
    return key


PER_AXIS: Mapping[str, tuple[AxisPanel, Callable[[Run, Look], Iterable[Line2D]]]] = MappingProxyType(
    {
        "attitude": (_attitude_of_axis, lambda run, look: _attitude_key(run, look, with_attitude=True)),
        "error": (_error_of_axis, lambda run, look: ()),
        "torque": (_torque_of_axis, _torque_key),
    }
)


def _limits(ax: Axes, limits: Array, factor: float, look: Look) -> None:
    """The actuators' limits, as lines on both sides of zero."""
    for value in limits:
        for sign in (-1, 1):
            ax.axhline(sign * value * factor, color=look.ink, lw=0.9, ls="-.")


def _focus(ax: Axes, applied: Array) -> None:
    """Keep the applied torque readable where a command far beyond the limit would squeeze it to a line."""
    peak = float(np.nanmax(np.abs(applied))) if np.isfinite(applied).any() else 0.0
    low, high = ax.get_ylim()
    if peak > 0 and max(-low, high) > 3 * peak:
        ax.set_ylim(-1.6 * peak, 1.6 * peak)
