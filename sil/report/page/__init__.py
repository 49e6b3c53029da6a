"""A run, or several, as one HTML page that needs nothing else: no network, no further file. `report` writes it.

The page is assets/page.html with style, scripts and data put in. The data are one JSON object: what is said in words
(summary), times and values as base64 (columns, attitudes), and which of them each plot shows (plots). The same runs
give the same bytes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sil.plain import plain
from sil.report.colours import AXIS_NAMES, DARK, LIGHT, Look
from sil.report.facts import labels
from sil.report.page.arithmetic import arithmetic
from sil.report.page.attitudes import view
from sil.report.page.columns import Columns
from sil.report.page.link import link
from sil.report.page.plots import plots
from sil.report.page.summary import differences, summary
from sil.report.page.times import times
from sil.report.whole_file import beside
from sil.runs import Run, readable
from sil.trouble import UsageError

ASSETS = Path(__file__).parent / "assets"
SCRIPTS = ("numbers", "rotations", "scene", "plots", "tables", "player", "page")  # in this order
POINTS, POINTS_OF_ALL, POINTS_LEAST = 10_000, 30_000, 1_000  # of a line: of one run, of all together
MOST_RUNS = 21  # colours by dashes; more than that nobody tells apart
ALSO = ("/sample",)  # topics that a report asks for: open_run(path, ALSO) reads them at once

Stage = Callable[[str], None]


class ReportError(UsageError):
    """The page cannot be made: one line."""


def report(runs: Sequence[Run], out: Path, stage: Stage = lambda _: None) -> Path:
    """Write the page of these runs to `out`; `stage` hears what is being done. Raises ReportError, RunError."""
    _check(runs, out)
    text = page(runs, stage)
    stage(f"writing {out}")
    try:
        with beside(out) as new:
            new.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ReportError(f"{out}: cannot write the page: {error.strerror or error}") from error
    return out


def default_out(runs: Sequence[Run]) -> Path:
    """RUN/report.html; of several runs report-A-B.html here, by the names of their directories."""
    if len(runs) == 1:
        return runs[0].directory / "report.html"
    names = [run.directory.resolve().name for run in runs]
    return Path(f"report-{'-'.join(names) if len(names) <= 3 else f'{len(names)}-runs'}.html")


def page(runs: Sequence[Run], stage: Stage = lambda _: None) -> str:
    """The page as text."""
    uplot = _asset("vendor/uPlot.iife.min.js")
    licence = "/*\nuPlot, vendored; the satellite, the tables and the rest are attitude-sil's.\n\n"
    scripts = [licence + _asset("vendor/uPlot.LICENSE") + "*/\n" + uplot]
    scripts += [f"// {name}.js\n{_asset(f'{name}.js')}" for name in SCRIPTS]
    style = "\n".join((_asset("vendor/uPlot.min.css"), _colours(), _asset("page.css")))
    title = " / ".join(labels(runs)[:3]).replace("&", "&amp;").replace("<", "&lt;")
    title = title.encode("utf-8", "replace").decode("utf-8")
    parts = {"STYLE": style, "SCRIPTS": "\n".join(scripts), "TITLE": title, "DATA": _json(content(runs, stage))}
    return re.sub(r"{{(\w+)}}", lambda place: parts[place[1]], _asset("page.html"))


def content(runs: Sequence[Run], stage: Stage = lambda _: None) -> dict[str, Any]:
    """The data of the page as plain JSON values."""
    points = max(POINTS_LEAST, min(POINTS, POINTS_OF_ALL // len(runs)))
    columns = [Columns(run, points) for run in runs]
    called = labels(runs)
    said = [_said(run, each, label, stage) for run, each, label in zip(runs, columns, called, strict=True)]
    stage("putting the plots together")
    with readable(runs[0].path):
        drawn = plots(runs, columns, called)
    for run, each in zip(said, columns, strict=True):
        run["data"] = each.content()
    made: dict[str, Any] = plain(
        {
            "made_by": f"attitude-sil {version('attitude-sil')}",
            "axes": AXIS_NAMES,
            "runs": said,
            "plots": drawn,
            "differences": differences(runs) if len(runs) > 1 else [],
        }
    )
    return made


def _said(run: Run, columns: Columns, label: str, stage: Stage) -> dict[str, Any]:
    """All of one run but its plots."""
    stage(f"{run.path}: metrics, link, times")
    with readable(run.path):
        return {
            **summary(run, label),
            "view": view(run, columns),
            "link": link(run),
            "times": times(run),
            "arithmetic": arithmetic(run),
        }


def _check(runs: Sequence[Run], out: Path) -> None:
    if len(runs) > MOST_RUNS:
        raise ReportError(f"report: expected at most {MOST_RUNS} runs, got {len(runs)}; `sil compare` takes any number")
    for run in runs:
        if not len(run):
            raise ReportError(f"{run.path}: the run has no ticks to show; `sil info {run.directory}` says what it has")
    if out.is_dir():
        raise ReportError(f"--out: expected a file such as report.html, got the directory {out}")


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _json(made: Any) -> str:
    """JSON that cannot end the script element it stands in; a path's bytes that are no UTF-8 are escaped."""
    text = json.dumps(made, allow_nan=False, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _colours() -> str:
    """The colours of the pictures as CSS variables."""
    light, dark = _variables(LIGHT), _variables(DARK)
    return (
        f":root{{{light}}}\n:root[data-theme=dark]{{{dark}}}\n"
        f"@media (prefers-color-scheme:dark){{:root:not([data-theme=light]){{{dark}}}}}\n"
    )


def _variables(look: Look) -> str:
    axes = [f"--axis-{i}:{colour}" for i, colour in enumerate(look.axes)]
    over = [f"--over-{i}:{colour}" for i, colour in enumerate(look.over)]
    runs = [f"--run-{i}:{colour}" for i, colour in enumerate(look.runs)]
    return ";".join([*axes, *over, *runs])
