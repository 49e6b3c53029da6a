"""What the terminal shows: progress on stderr while something takes time, results on stdout, errors in one line."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sil.runner import Watch
from sil.signals import Motion

QUIET_S = 1.0  # nothing is drawn for a run that is over sooner
DRAW_EVERY_S = 0.1
PLAIN_EVERY_S = 10.0
AXES = ("roll", "pitch", "yaw")
ALWAYS_SHOWN = ("missed", "late", "real_misses", "overruns", "crc_errors", "discarded_bytes")  # the others if not zero


class Silent(Watch):
    """Notes on stderr, nothing else: for --json."""

    def note(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)


class Terminal(Silent):
    """A progress bar (rich) on a terminal, a line every ten seconds elsewhere. Costs a clock read a tick."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._began = self._drawn = time.monotonic()
        self._bar: Any = None
        self._live = sys.stderr.isatty()

    def note(self, line: str) -> None:
        if self._bar is not None:
            self._bar.console.print(line, highlight=False)
        else:
            super().note(line)

    def stage(self, name: str) -> None:
        self._began = self._drawn = time.monotonic()
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def tick(self, tick: int, ticks: int, motion: Motion) -> None:
        now = time.monotonic()
        if now - self._drawn < (DRAW_EVERY_S if self._live else PLAIN_EVERY_S) or now - self._began < QUIET_S:
            return
        self._drawn = now
        x, y, z = np.degrees(motion.euler_rad).tolist()
        state = f"t {motion.t_ns * 1e-9:8.1f} s   attitude {x:7.2f} {y:7.2f} {z:7.2f} deg"
        if not self._live:
            print(f"{self._title}: {100 * (tick + 1) // ticks:3d} %  {state}", file=sys.stderr, flush=True)
            return
        if self._bar is None:
            self._start_bar(ticks)
        self._bar.update(self._task, completed=tick + 1, state=state)
        self._bar.refresh()

    def _start_bar(self, ticks: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TextColumn("{task.fields[state]}"),
            TimeRemainingColumn(),
        )
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
        self._task = self._bar.add_task(self._title, total=ticks, state="")
        self._bar.start()


def show_summary(summary: Mapping[str, Any]) -> None:
    """The result of a run, as a person reads it."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, soft_wrap=True)
    colour = {"passed": "green", "interrupted": "yellow", "degraded": "yellow"}.get(summary["verdict"], "red")
    timing = summary["timing"]
    console.print(
        f"[bold {colour}]{summary['verdict']}[/]  {summary['scenario']}: {summary['ticks']} ticks, "
        f"{summary['duration_s']:g} s in {timing['wall_s']:.2f} s ({timing['times_real_time']:,.0f} x real time)"
    )
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in ("", *AXES, ""):
        table.add_column(name, justify="left" if not name else "right")
    errors = summary["board"] != "none"  # without a board nobody follows a reference
    for key, label, unit, scale in (
        ("rms_error_deg", "rms error to reference", "deg", 1.0),
        ("peak_error_deg", "peak error to reference", "deg", 1.0),
        ("rms_setpoint_error_deg", "rms error to set-point", "deg", 1.0),
        ("rms_torque_Nm", "rms torque", "mN m", 1e3),
        ("peak_torque_Nm", "peak torque", "mN m", 1e3),
    ):
        values = summary["metrics"].get(key)
        if (errors or "error" not in key) and any(value is not None for value in values or ()):
            table.add_row(label, *(_number(value, scale) for value in values), unit)
    console.print(table)
    for line in summary["require"]:
        mark = "[green]met   [/]" if line["passed"] else "[red]failed[/]"
        console.print(f"{mark} {requirement_text(line)}")
    if summary["not_a_number"]:
        console.print(f"[red]failed[/] torque or plant was not a number, {summary['not_a_number']} times")
    if timing["degraded_ticks"]:
        late_ms = timing["wakeup_us"]["max"] / 1000
        woke = f"{timing['degraded_ticks']} of {summary['ticks']} ticks woke more than a period late"
        console.print(f"[yellow]degraded[/]: {woke}, at most {late_ms:.1f} ms: a busy machine or too fast a clock")
    link = {name: count for name, count in summary["link"].items() if count or name in ALWAYS_SHOWN}
    if errors:
        console.print("link: " + ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in link.items()))
    if not summary["reproducible"]:
        console.print("[yellow]not reproducible[/]: commands missed the clock though the model had them in time")
    console.print(f"run: {summary['run_dir']}   sha256 {summary['sha256'][:16]}")


def requirement_text(line: Mapping[str, Any]) -> str:
    """`rms_error_deg.roll < 0.5   got 0.0706`"""
    return f"{line['requirement']}   got {'none' if line['value'] is None else format(line['value'], '.4g')}"


def show_table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Plain columns on stdout."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for header in headers:
        table.add_column(header, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table)


def _number(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.4g}"
