"""Pictures of a run, or of several over each other: an overview, and detail pages by signal.

A page is 12 inches wide: 1200 pixels as PNG. Signals are those of sil.report.signals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from sil.report import overlay, panels
from sil.report.colours import DARK, LIGHT, Look
from sil.report.look import DPI
from sil.report.signals import GROUP, Signal, chosen, controlled, identified, signals_of
from sil.report.whole_file import beside
from sil.runs import Run
from sil.trouble import UsageError

FORMATS = (".png", ".pdf")
USUAL = ("attitude", "error", "torque", "momentum")
_NAMED_RUNS = 3


class PlotError(UsageError):
    """The picture cannot be made: one line."""


class Page(NamedTuple):
    """One picture; `name` is what its file is called."""

    name: str
    figure: Figure


def plot(
    runs: Sequence[Run],
    out: Path,
    signals: Sequence[str] = (),
    residuals: bool = False,
    dark: bool = False,
    span_s: tuple[float, float] = (-math.inf, math.inf),
) -> list[Path]:
    """Write pictures. `out` *.pdf: all pages in one file; *.png: the overview; a directory: every page as a PNG.

    runs: one, or several that are drawn over each other. signals: names to show instead of the usual ones. residuals:
    what each further run differs by from the first. span_s: the part of the time to draw. Returns the files written.
    Raises PlotError for other suffixes, an empty run, a span without ticks, or a place that cannot be written, and
    SignalError for signals that are not there.
    """
    for run in runs:
        if not len(run):
            raise PlotError(f"{run.path}: the run has no ticks to plot")
    if residuals and len(runs) < 2:
        raise PlotError("--residuals: expected two runs or more, got one")
    if out.suffix and out.suffix not in FORMATS:
        raise PlotError(f"{out}: expected one of {', '.join(FORMATS)} or a directory, got {out.suffix}")
    look = (DARK if dark else LIGHT)._replace(span_s=span_s)
    begin, end = look.window(min(run.t_s[0] for run in runs), max(run.t_s[-1] for run in runs))
    if not begin < end:
        raise PlotError(f"--time: expected a part of the runs, got {span_s[0]:g}:{span_s[1]:g} s")
    made = pages(runs, signals, residuals, look, whole=out.suffix != ".png")
    try:
        if out.suffix == ".pdf":
            return [_write_pdf(out, made)]
        if out.suffix == ".png":
            return [_write_png(out, made[0].figure)]
        out.mkdir(parents=True, exist_ok=True)
        return [_write_png(out / f"{page.name}.png", page.figure) for page in made]
    except OSError as error:
        raise PlotError(f"{out}: {error.strerror or error}") from error


def pages(
    runs: Sequence[Run],
    signals: Sequence[str] = (),
    residuals: bool = False,
    look: Look = LIGHT,
    whole: bool = True,
) -> list[Page]:
    """All pages, the overview first (only that unless `whole`); those without data are left out."""
    if len(runs) == 1:
        return _pages_of_one(runs[0], signals, look, whole)
    shown = chosen(runs, signals, USUAL)
    ensemble = overlay.Ensemble(runs, look)
    one = len(shown) == 1 and not residuals
    if residuals and not any(ensemble.residuals(signal) for signal in shown):
        raise PlotError(f"--residuals: expected a signal that {runs[0].path} and another run have, got none")
    made = [Page("overview", overlay.stacked(ensemble, shown[0]) if one else overlay.grid(ensemble, shown, residuals))]
    if not whole:
        return made
    for signal in shown:
        made.append(Page(signal.name, overlay.stacked(ensemble, signal)))
        if residuals and ensemble.residuals(signal):
            made.append(Page(f"{signal.name}-residual", overlay.stacked(ensemble, signal, is_residual=True)))
    return made


def default_out(runs: Sequence[Run]) -> Path:
    """RUN/plot.png; of several runs plot-A-B.png here, by the names of their directories."""
    if len(runs) == 1:
        return runs[0].directory / "plot.png"
    names = [run.directory.resolve().name for run in runs]
    return Path(f"plot-{'-'.join(names) if len(names) <= _NAMED_RUNS else f'{len(names)}-runs'}.png")


def _pages_of_one(run: Run, signals: Sequence[str], look: Look, whole: bool) -> list[Page]:
    shown = chosen([run], signals, (*USUAL, *identified(run)[:1]))
    made = [Page("overview", panels.stack(run, "", [panels.panel_of(signal) for signal in shown], look))]
    if not whole:
        return made
    detail = shown if signals else chosen([run], (), USUAL)
    made += [Page(s.name, _detail(run, s, look)) for s in detail if s.name not in identified(run)]
    reported = identified(run) if not signals else [s.name for s in shown if s.name in identified(run)]
    if reported:
        known = signals_of(run)
        stack = [panels.panel_of(known[name]) for name in reported]
        made.append(Page(GROUP, panels.stack(run, GROUP.capitalize(), stack, look)))
    return made


def _detail(run: Run, signal: Signal, look: Look) -> Figure:
    if signal.name in panels.PER_AXIS and (signal.name != "error" or controlled(run)):
        return panels.per_axis(run, signal.name, look)
    return panels.stack(run, signal.title, [panels.panel_of(signal)], look)


def _write_pdf(out: Path, made: Sequence[Page]) -> Path:
    with beside(out) as new, PdfPages(new, metadata={"CreationDate": None}) as document:
        for page in made:
            document.savefig(page.figure, facecolor=page.figure.get_facecolor())
    return out


def _write_png(out: Path, figure: Figure) -> Path:
    with beside(out) as new:
        figure.savefig(new, format="png", dpi=DPI, facecolor=figure.get_facecolor())
    return out
