"""Pictures of several runs: each signal in panels for roll, pitch and yaw, all runs over each other, and what differs.

A run has the same colour on every page; of more than seven the further ones are dashed, then dotted. Earlier runs are
drawn thicker, so that a run that is covered is still seen. What a run that diverged does is not allowed to squeeze the
others to a line: it is cut off by the panel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sil.metrics import DIVERGED_deg, diverged_at_s
from sil.report import look as looks
from sil.report.colours import AXIS_NAMES, Look, scaled
from sil.report.facts import facts, labels
from sil.report.look import DASHED, DOTTED, WIDTH_in, finish, line, unbroken
from sil.report.signals import Signal, SignalError, controlled, has, logarithmic
from sil.runs import Array, Run, wrapped_deg

ATTITUDE = "attitude"
_STYLES = ("-", DASHED, DOTTED)
_ROW_in, _GRID_ROW_in, _FOOT_in = 2.5, 2.05, 0.6
_LONG_S = 10_000.0
_LEFT, _RIGHT = 0.09, 0.975
_CHARACTER_in, _KEY_in, _KEY_ROW_in = 0.077, 0.62, 0.22  # of a legend's entry at 10 points


class Curve(NamedTuple):
    """One run's line: times, (N, 3) or (N, 1) values; `wild`: the run diverged."""

    t_s: Array
    values: Array
    wild: bool
    style: Mapping[str, Any]


class Ensemble:
    """Runs that are drawn over each other: labels, lines, and who diverged. Raises SignalError for too many."""

    def __init__(self, runs: Sequence[Run], look: Look) -> None:
        most = len(look.runs) * len(_STYLES)
        if len(runs) > most:
            raise SignalError(f"expected at most {most} runs in one picture, got {len(runs)}")
        self.runs, self.look = runs, look
        self.labels = labels(runs)
        self.diverged_s = [diverged_at_s(run, _limit(run)) for run in runs]
        self.styles = [_style(i, len(runs), look) for i in range(len(runs))]

    def curves(self, signal: Signal) -> list[Curve]:
        """One for each run that has the signal."""
        found = []
        for i, run in enumerate(self.runs):
            if has(run, signal):
                found.append(self._curve(i, run.t_s, signal.read(run), signal))
        return found

    def residuals(self, signal: Signal) -> list[Curve]:
        """Each further run minus the first, at the instants that both have."""
        first = self.runs[0]
        found = []
        for i, run in enumerate(self.runs[1:], 1):
            if has(first, signal) and has(run, signal):
                rows_a, rows_b = common(first, run)
                difference = signal.read(run)[rows_b] - signal.read(first)[rows_a]
                values = wrapped_deg(difference) if signal.angle else difference
                found.append(self._curve(i, run.t_s[rows_b], values, signal))
        return found

    def _curve(self, i: int, t_s: Array, values: Array, signal: Signal) -> Curve:
        columns = values.reshape(len(t_s), -1)
        if signal.angle:
            columns = np.column_stack([unbroken(column) for column in columns.T])
        return Curve(t_s, columns, self.diverged_s[i] is not None, self.styles[i])

    def keys(self) -> list[Line2D]:
        """The legend's entries."""
        return [
            Line2D([], [], **{**style, "lw": 2.2}, label=label if at_s is None else f"{label} (diverged at {at_s:g} s)")
            for label, style, at_s in zip(self.labels, self.styles, self.diverged_s, strict=True)
        ]


def common(a: Run, b: Run) -> tuple[Array, Array]:
    """Rows of both at the instants both have: the same ticks when the periods agree. Raises SignalError for fewer than
    two. Nothing is interpolated."""
    _, rows_a, rows_b = np.intersect1d(a.tick * a.period_ns, b.tick * b.period_ns, return_indices=True)
    if len(rows_a) < 2:
        periods = f"periods {a.period_s:g} s and {b.period_s:g} s"
        raise SignalError(f"--residuals: expected instants that both runs have, got {len(rows_a)} ({periods})")
    return rows_a, rows_b


def grid(ensemble: Ensemble, signals: Sequence[Signal], residuals: bool) -> Figure:
    """A row for each signal, a column for each axis; with residuals a row more under each."""
    apart = [signal for signal in signals if residuals and ensemble.residuals(signal)]  # some may be in one run only
    rows = [(signal, kind) for signal in signals for kind in ((False, True) if signal in apart else (False,))]
    page = _Page(ensemble, "", _GRID_ROW_in * len(rows), residuals, any(s.name == ATTITUDE for s in signals))
    cells = page.figure.add_gridspec(len(rows), 3, **page.place, hspace=0.2, wspace=0.26)
    above: list[Axes | None] = [None] * 3
    lowest: dict[bool, list[Axes]] = {}  # of the panels with one axis, and of those with all
    for row, (signal, is_residual) in enumerate(rows):
        curves = ensemble.residuals(signal) if is_residual else ensemble.curves(signal)
        whole = all(curve.values.shape[1] == 1 for curve in curves)
        lowest[whole] = []
        for column in (0,) if whole else range(3):
            ax = page.figure.add_subplot(cells[row, :] if whole else cells[row, column], sharex=above[0])
            above[column] = ax
            lowest[whole].append(ax)
            page.panel(ax, signal, curves, column, is_residual, labelled=column == 0)
            first_of_axes = not whole and all(s.read(ensemble.runs[0]).ndim == 1 for s, _ in rows[:row])
            if first_of_axes:
                ax.set_title(AXIS_NAMES[column], loc="left", fontsize=11, color=ensemble.look.ink, fontweight="bold")
    page.finish({ax for axes in lowest.values() for ax in axes})
    return page.figure


def stacked(ensemble: Ensemble, signal: Signal, is_residual: bool = False) -> Figure:
    """One signal, or its residual, on a page: a panel over the whole width for each axis."""
    curves = ensemble.residuals(signal) if is_residual else ensemble.curves(signal)
    count = max(curve.values.shape[1] for curve in curves)
    title = f"{signal.title}: difference" if is_residual else signal.title
    page = _Page(ensemble, title, _ROW_in * count, is_residual, signal.name == ATTITUDE and not is_residual)
    axes = np.atleast_1d(page.figure.subplots(count, 1, sharex=True, gridspec_kw={**page.place, "hspace": 0.25}))
    for column, ax in enumerate(axes):
        page.panel(ax, signal, curves, column, is_residual, labelled=True)
        if count == 3:
            ax.set_title(AXIS_NAMES[column], loc="left", fontsize=11, color=ensemble.look.ink, fontweight="bold")
    page.finish({axes[-1]})
    return page.figure


class _Page:
    """A page with heading, facts and legend on top; the panels go into `place`."""

    def __init__(self, ensemble: Ensemble, what: str, panels_in: float, residuals: bool, attitude: bool) -> None:
        self.ensemble, self.look = ensemble, ensemble.look
        starts, ends = zip(
            *((float(run.t_s[0]), float(run.t_s[-1]) + run.period_s) for run in ensemble.runs), strict=True
        )
        self.window = ensemble.look.window(min(starts), max(ends))
        keys = [*ensemble.keys(), *(_guides(ensemble) if attitude else ())]
        per_row, key_rows = _legend_rows([str(key.get_label()) for key in keys])
        notes = [facts(ensemble.runs), *([_residual_note(ensemble)] if residuals else [])]
        head = 0.64 + 0.22 * len(notes) + _KEY_ROW_in * key_rows + 0.3
        height = head + panels_in + _FOOT_in
        self.figure = looks.empty(height, self.look)
        self.place = {"left": _LEFT, "right": _RIGHT, "top": 1 - head / height, "bottom": _FOOT_in / height}
        looks.headed(self.figure, _heading(ensemble, what), "\n".join(notes), _LEFT, self.look)
        self.figure.texts[1].set_verticalalignment("top")
        self.figure.texts[1].set_y(1 - 0.56 / height)
        at = (_LEFT - 0.004, 1 - (0.6 + 0.22 * len(notes)) / height)
        self.figure.legend(
            handles=keys, loc="upper left", bbox_to_anchor=at, ncols=per_row, frameon=False, fontsize=10,
            labelcolor=self.look.ink, borderaxespad=0.0, columnspacing=1.6, handlelength=2.4,
        )  # fmt: skip

    def panel(
        self, ax: Axes, signal: Signal, curves: Sequence[Curve], column: int, is_residual: bool, labelled: bool
    ) -> None:
        """One axis of a signal, all runs; the factor of the unit is the row's."""
        everything = np.concatenate([curve.values.ravel() for curve in _calm(curves)])
        factor, unit = scaled(everything, signal.unit)
        ax.set_xlim(self.window)
        if not is_residual:
            self._guide(ax, signal, column)
        for curve in curves:
            values = curve.values[:, min(column, curve.values.shape[1] - 1)] * factor
            line(ax, curve.t_s, values, signal.step, **curve.style)
        if not is_residual and logarithmic(signal.name, everything):
            ax.set_yscale("log")
        label = f"Δ {signal.label}" if is_residual else signal.label
        finish(ax, label if labelled else "", unit if labelled else "", "", self.look, signal.zero or is_residual)
        looks.mark_zero(ax, everything, self.look)
        _hold_range(ax, curves, column, factor)

    def _guide(self, ax: Axes, signal: Signal, column: int) -> None:
        """Set-point and reference under the attitude, where all runs have the same."""
        if signal.name != ATTITUDE:
            return
        run = max(self.ensemble.runs, key=lambda run: len(run) * run.period_ns)
        if _same_everywhere(self.ensemble.runs, "setpoint_deg"):
            line(ax, run.t_s, run.setpoint_deg[:, column], True, color=self.look.faint, lw=1.1, ls=DOTTED)
        if _same_everywhere(self.ensemble.runs, "reference_deg"):
            line(ax, run.t_s, unbroken(run.reference_deg[:, column]), color=self.look.ink, lw=0.9, ls=DASHED, zorder=5)

    def finish(self, lowest: set[Axes]) -> None:
        """Numbers under the lowest panel of each column, the time axis' name at the foot of the page."""
        for ax in self.figure.axes:
            if self.window[1] >= _LONG_S and ax.get_position().width < 0.5:
                ax.locator_params(axis="x", nbins=4)  # wide numbers under a narrow panel
            ax.tick_params(labelbottom=ax in lowest)
            if ax in lowest and ax.get_position().y0 < self.place["bottom"] + 1e-6:
                ax.set_xlabel("time in s", fontsize=11, color=self.look.ink)
        self.figure.align_ylabels([ax for ax in self.figure.axes if ax.get_ylabel()])


# -- what the runs share -----------------------------------------------------------------------------------------------


def _guides(ensemble: Ensemble) -> list[Line2D]:
    """Keys of set-point and reference."""
    look, runs = ensemble.look, ensemble.runs
    keys = []
    if _same_everywhere(runs, "reference_deg"):
        keys.append(Line2D([], [], color=look.ink, lw=0.9, ls=DASHED, label="reference"))
    if _same_everywhere(runs, "setpoint_deg"):
        keys.append(Line2D([], [], color=look.faint, lw=1.1, ls=DOTTED, label="set-point"))
    return keys


def _same_everywhere(runs: Sequence[Run], name: str) -> bool:
    """Whether all runs were asked for the same, as far as they go, within a thousandth of a degree."""
    if not all(controlled(run) and np.isfinite(run[name]).any() for run in runs):
        return False
    first = max(runs, key=lambda run: len(run) * run.period_ns)
    for run in runs:
        _, rows, others = np.intersect1d(first.tick, run.tick, return_indices=True)
        difference = np.abs(wrapped_deg(first[name][rows] - run[name][others]))
        if run.period_ns != first.period_ns or not np.all(difference[np.isfinite(difference)] < 1e-3):
            return False
    return True


def _limit(run: Run) -> float | None:
    limit: float | None = (run.scenario.get("metrics") or {}).get("diverged_deg", DIVERGED_deg)
    return limit


def _style(i: int, count: int, look: Look) -> Mapping[str, Any]:
    """Colour by number, dashes from the eighth on; the first thickest."""
    thinner = 0.9 * i / max(count - 1, 1)
    return {"color": look.runs[i % len(look.runs)], "ls": _STYLES[i // len(look.runs)], "lw": 1.9 - thinner}


def _calm(curves: Sequence[Curve]) -> Sequence[Curve]:
    """Those of runs that did not diverge, or all if all did."""
    return [curve for curve in curves if not curve.wild] or curves


def _hold_range(ax: Axes, curves: Sequence[Curve], column: int, factor: float) -> None:
    """The range of the runs that did not diverge, where one did."""
    calm = _calm(curves)
    if len(calm) == len(curves):
        return
    first, last = ax.get_xlim()
    seen = [curve.values[(first <= curve.t_s) & (curve.t_s <= last)] for curve in calm]
    values = np.concatenate([part[:, min(column, part.shape[1] - 1)] for part in seen]) * factor
    values = values[np.isfinite(values)]
    if values.size and values.max() > values.min():
        room = 0.3 * (values.max() - values.min())
        ax.set_ylim(values.min() - room, values.max() + room)


def _heading(ensemble: Ensemble, what: str) -> str:
    names = list(dict.fromkeys(run.name for run in ensemble.runs))
    who = f"{names[0]}, {len(ensemble.runs)} runs" if len(names) == 1 else _listed(names)
    if len(who) > 60:
        who = f"{len(ensemble.runs)} runs"
    return f"{who} — {what}" if what else who


def _listed(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _residual_note(ensemble: Ensemble) -> str:
    """What the differences are taken of, and where."""
    first, *others = ensemble.runs
    counts = [len(common(first, run)[0]) for run in others]
    size = f"{counts[0]}" if len(set(counts)) == 1 else f"{min(counts)} to {max(counts)}"
    same = all(run.period_ns == first.period_ns for run in others)
    where = f"{size} common ticks" if same else f"{size} instants that both have (the periods differ)"
    return f"Δ: difference to {ensemble.labels[0]} at the {where}"


def _legend_rows(texts: Sequence[str]) -> tuple[int, int]:
    """(entries in a row, rows) that fit the page."""
    widest = max(len(text) for text in texts) * _CHARACTER_in + _KEY_in
    per_row = max(1, min(len(texts), int((_RIGHT - _LEFT) * WIDTH_in / widest)))
    return per_row, math.ceil(len(texts) / per_row)
