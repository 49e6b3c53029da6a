"""The result of a run on stdout: verdict, errors and torque per axis, requirements, link, timing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sil.link_counts import sentence
from sil.screen import NORMAL, QUIET, VERBOSE, requirement_text
from sil.screen.palette import AXES, BAD, DIM, GOOD, TITLE, WARN

ALWAYS_SHOWN = ("missed", "late", "real_misses", "overruns", "crc_errors", "discarded_bytes")  # the others if not zero
NARROWEST = 80  # columns of the table: a narrow terminal wraps it, numbers are never cut
MOST_TICKS = 8  # of a storm of restarts that the summary names
BAR = 40  # characters of the fullest line of a histogram
ROWS = (
    ("rms_error_deg", "rms error to reference", "deg", 1.0),
    ("peak_error_deg", "peak error to reference", "deg", 1.0),
    ("rms_setpoint_error_deg", "rms error to set-point", "deg", 1.0),
    ("rms_torque_Nm", "rms torque", "mN m", 1e3),
    ("peak_torque_Nm", "peak torque", "mN m", 1e3),
)


def show(summary: Mapping[str, Any], verbosity: int = NORMAL) -> None:
    """QUIET: the verdict and where the run lies, in one line. VERBOSE: with a histogram of the wake-ups."""
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, NARROWEST)
    if verbosity <= QUIET:
        console.print(f"{_verdict(summary)}  {escape(summary['scenario'])}: {escape(summary['run_dir'])}")
        return
    timing = summary["timing"]
    console.print(
        f"{_verdict(summary)}  {escape(summary['scenario'])}: {summary['ticks']} ticks, "
        f"{summary['duration_s']:g} s in {timing['wall_s']:.2f} s ({timing['times_real_time']:,.0f} x real time)"
    )
    console.print(_errors_and_torques(summary))
    for line in summary["require"]:
        mark = f"[{GOOD}]met   [/]" if line["passed"] else f"[{BAD}]failed[/]"
        console.print(f"{mark} {escape(requirement_text(line))}")
    if summary["not_a_number"]:
        console.print(f"[{BAD}]failed[/] torque or plant was not a number, {summary['not_a_number']} times")
    for line in (*_lateness(summary), *_link(summary)):
        console.print(line)
    if verbosity >= VERBOSE:
        for line in _detail(timing):
            console.print(line)
    console.print(f"run: {escape(summary['run_dir'])}   sha256 {summary['sha256'][:16]}")


def _verdict(summary: Mapping[str, Any]) -> str:
    colour = {"passed": f"bold {GOOD}", "interrupted": WARN, "degraded": WARN}.get(summary["verdict"], BAD)
    return f"[{colour}]{summary['verdict']}[/]"


def _errors_and_torques(summary: Mapping[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in ("", *AXES, ""):
        table.add_column(name, justify="left" if not name else "right")
    errors = summary["board"] != "none"  # without a board nobody follows a reference
    known = summary["metrics"].get("reference_mismatch_deg") is not None  # else nobody knows the reference
    for key, label, unit, scale in ROWS if known else (row for row in ROWS if row[0] != "rms_setpoint_error_deg"):
        values = summary["metrics"].get(key)
        label = label if known else label.replace("to reference", "to set-point")
        if (errors or "error" not in key) and any(value is not None for value in values or ()):
            table.add_row(label, *(_number(value, scale) for value in values), unit)
    return table


def _link(summary: Mapping[str, Any]) -> Iterator[str]:
    link = {name: count for name, count in summary["link"].items() if count or name in ALWAYS_SHOWN}
    if summary["board"] != "none":
        yield "link: " + ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in link.items())
    for way, counts in (summary.get("fates") or {}).items():
        if told := sentence(way, counts):
            yield f"link {told}"
    if not summary["reproducible"]:
        yield f"[{WARN}]not reproducible[/]: {'; '.join(_not_reproducible(summary))}"


def _not_reproducible(summary: Mapping[str, Any]) -> Iterator[str]:
    """Why a second run may have other bytes."""
    ticks = summary.get("restarted_at_ticks") or ()
    if ticks:
        shown = ", ".join(map(str, ticks[:MOST_TICKS])) + (", ..." if len(ticks) > MOST_TICKS else "")
        yield f"the board restarted at tick{'s' * (len(ticks) > 1)} {shown}"
    if summary["link"].get("real_misses") or not ticks:
        yield "commands missed the clock though the model had them in time"


# -- timing of paced runs ------------------------------------------------------------------------------------------


def _lateness(summary: Mapping[str, Any]) -> Iterator[str]:
    """How late the ticks woke up; nothing in lockstep, which has no wake-ups."""
    timing = summary["timing"]
    wakeup = timing["wakeup_us"]
    if wakeup["max"] is None:
        return
    yield f"wake-ups late by: {_percentiles(wakeup)}"
    late = timing["late_ticks"]
    if late:
        colour = WARN if summary["verdict"] == "degraded" else DIM
        beyond_ms = timing.get("late_beyond_ms")
        limit = f"more than {_duration(beyond_ms * 1e3)}" if beyond_ms else "more than a period"
        causes = _causes(timing, "late_ticks")
        why = f": {causes}" if causes else ": a busy machine or too fast a clock"
        yield f"[{colour}]late ticks[/]: {late} of {summary['ticks']} ticks woke {limit} late{why}"


def _percentiles(us: Mapping[str, float]) -> str:
    """`p50 0.34 us, p99 1.07 ms, p99.9 2.61 ms, at most 3.54 ms`"""
    names = (("p50", "p50"), ("p99", "p99"), ("p99_9", "p99.9"), ("max", "at most"))
    return ", ".join(f"{label} {_duration(us[key])}" for key, label in names)


def _causes(timing: Mapping[str, Any], which: str) -> str:
    """`machine 3, own work 1`, the most frequent first; "" where none is told."""
    causes = (timing.get("causes") or {}).get(which) or {}
    told = sorted(((count, name) for name, count in causes.items() if count), key=lambda one: -one[0])
    return ", ".join(f"{name.replace('_', ' ')} {count}" for count, name in told)


def _detail(timing: Mapping[str, Any]) -> Iterator[str]:
    """For -v: start and seal, answers, what the machine granted, and the histogram of the wake-ups."""
    yield f"time: {timing['start_s']:.2f} s to start, {timing['wall_s']:.2f} s to run, {timing['seal_s']:.2f} s to seal"
    if timing["answer_us"]["max"] is not None:
        yield f"answers after: {_percentiles(timing['answer_us'])}"
    granted = timing.get("granted") or {}
    if granted.get("priority") is not None:
        yield f"priority: SCHED_FIFO {granted['priority']}"
    for refused in granted.get("refused", ()):
        yield f"[{WARN}]refused[/]: {escape(refused)}"
    latest = _causes(timing, "latest_percent")
    if latest:
        yield f"the latest hundredth of all wake-ups: {latest}"
    yield from _histogram(timing.get("wakeup_histogram"))


def _histogram(histogram: Mapping[str, list[int]] | None) -> Iterator[str]:
    """A line per filled class and those between them; the longest bar is the fullest class."""
    counts = histogram["counts"] if histogram else []
    filled = [place for place, count in enumerate(counts) if count]
    if not histogram or not filled:
        return
    yield "[dim]wake-ups by lateness[/]"
    edges, top = histogram["edges_us"], max(counts)
    for place in range(filled[0], filled[-1] + 1):
        count = counts[place]
        edge = f"up to {_duration(edges[place])}" if place < len(edges) else f"beyond {_duration(edges[-1])}"
        yield f"  {edge:>15}  {count:>8}  [{TITLE}]{'━' * -(-BAR * count // top)}[/]".rstrip()


def _duration(us: float) -> str:
    for scale, unit in ((1e6, "s"), (1e3, "ms")):
        if us >= 0.9995 * scale:  # what three digits show as 1000 is one of the next unit
            return f"{us / scale:.3g} {unit}"
    return f"{us:.3g} us"


def _number(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.4g}"
