"""What the page says of a run in words: verdict, requirements, metrics, events, scenario, versions and hashes."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from protocol import events
from protocol.events import name_of
from sil.metrics import MISMATCH, NEVER_SETTLED, SETTLING, judge, measure
from sil.plain import flat, plain
from sil.report.facts import law_of
from sil.report.page.link import between
from sil.report.signals import controlled, without_wheels
from sil.runs import Run

MOST_EVENTS = 400  # of a run, evenly by code: what is left out is counted
MOST_MARKS = 500  # places under the slider at which something happened
_OF_A_LAW = ("rms_error_deg", "peak_error_deg", "rms_setpoint_error_deg", "settling_s")  # nobody follows without
_METRICS = (
    ("rms_error_deg", "rms error to reference", "deg", 1.0),
    ("peak_error_deg", "peak error to reference", "deg", 1.0),
    ("rms_setpoint_error_deg", "rms error to set-point", "deg", 1.0),
    ("settling_s", "settling", "s", 1.0),
    ("rms_torque_Nm", "rms torque", "mN m", 1e3),
    ("peak_torque_Nm", "peak torque", "mN m", 1e3),
    ("peak_momentum_Nms", "peak wheel momentum", "mN m s", 1e3),
    ("effort_Nms", "effort", "N m s", 1.0),
)
_DIFFERS_ANYWAY = ("name", "about", "extends")
_LONG = 120  # characters of a value


def summary(run: Run, label: str) -> dict[str, Any]:
    """Everything about one run that is not drawn over time."""
    metrics = measure(run)
    told = run.summary
    return {
        "label": label,
        "name": run.name,
        "about": str(run.scenario.get("about") or ""),
        "path": str(run.path),
        "verdict": str(told.get("verdict") or "not judged"),
        "failure": str(told.get("failure") or ""),
        "facts": _facts(run),
        "ticks": len(run),
        "period_s": run.period_s,
        "end_s": float(run.t_s[-1]) + run.period_s,
        "require": _required(run, metrics),
        "metrics": _metrics(run, metrics),
        "events": _events(run),
        "spans": _spans(run),
        "identity": _identity(run),
        "scenario": yaml.safe_dump(plain(run.scenario), sort_keys=False, allow_unicode=True, width=100),
    }


def differences(runs: Sequence[Run]) -> list[list[str]]:
    """[[key, value of each run, ...], ...] of what their scenarios do not share."""
    flats = [flat(run.scenario) for run in runs]
    keys = dict.fromkeys(key for each in flats for key in each if key.partition(".")[0] not in _DIFFERS_ANYWAY)
    rows = [[key, *(_short(each.get(key)) for each in flats)] for key in keys]
    return [row for row in rows if len(set(row[1:])) > 1]


def _facts(run: Run) -> list[list[str]]:
    delay = run.scenario.get("transport_delay_ticks") if controlled(run) else None
    return [
        [key, text]
        for key, text in (
            ("law", law_of(run)),
            ("sampling", f"{run.period_s:g} s"),
            ("transport delay", "" if delay is None else f"{delay} tick" + "s" * (delay != 1)),
            ("ran", f"{len(run)} ticks, {len(run) * run.period_s:g} s, {run.end.get('reason')}"),
            ("seed", str(run.meta.get("seed", ""))),
        )
        if text
    ]


def _required(run: Run, metrics: Mapping[str, Any]) -> list[dict[str, Any]]:
    """As the summary says; from the log where there is none."""
    lines = run.summary.get("require")
    if lines is None:
        lines = [judgement._asdict() for judgement in judge(run.scenario.get("require") or (), metrics)]
    return [
        {
            "requirement": line["requirement"],
            "got": line.get("reason") or _number(line["value"]),
            "passed": bool(line["passed"]),
        }
        for line in lines
    ]


def _metrics(run: Run, metrics: Mapping[str, Any]) -> list[list[Any]]:
    """[[name, unit, [roll, pitch, yaw]], ...]; numbers without axes are repeated in none of them."""
    rows: list[list[Any]] = []
    unsaid: tuple[str, ...] = () if controlled(run) else _OF_A_LAW
    known = metrics.get(MISMATCH) is not None
    unsaid += () if known else ("rms_setpoint_error_deg",)
    unsaid += ("peak_momentum_Nms",) if without_wheels(run) else ()
    for name, words, unit, factor in _METRICS:
        values = metrics.get(name)
        if isinstance(values, list | tuple) and name not in unsaid:
            words = words if known else words.replace("to reference", "to set-point")
            rows.append([words, unit, [_metric(name, value, factor) for value in values]])
    diverged = metrics.get("diverged_at_s")
    if diverged is not None:
        rows.append(["diverged at", "s", [_number(diverged)]])
    return rows


def _metric(name: str, value: float | None, factor: float) -> str:
    if name in (SETTLING, NEVER_SETTLED) and value == math.inf:
        return "never"
    return "–" if value is None else _number(value * factor)


def _number(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "not a number" if value is not None else "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _events(run: Run) -> dict[str, Any]:
    """Counts of all, rows of the first ones of each code, in order, and the times of all but references, thinned."""
    counts: dict[int, int] = {}
    rows, codes = [], {event.code for event in run.events}
    each = max(1, MOST_EVENTS // max(1, len(codes)))
    for event in run.events:
        counts[event.code] = counts.get(event.code, 0) + 1
        if counts[event.code] <= each:
            name = name_of(event.code)
            rows.append([event.t_s, event.origin, name, event.text.removeprefix(f"{name}: ")])
    width_s = len(run) * run.period_s / MOST_MARKS
    bins = {int((event.t_s - run.t_s[0]) / width_s) for event in run.events if event.code != events.REFERENCE_RESTART}
    marks = [float(run.t_s[0]) + each * width_s for each in sorted(bins)]
    return {"counts": [[name_of(code), count] for code, count in sorted(counts.items())], "rows": rows, "marks": marks}


def _spans(run: Run) -> list[dict[str, Any]]:
    """Times in which something is wrong on purpose, to be shaded."""
    found = [
        {"name": "fault of an instrument", "spans": between(run, events.FAULT_BEGINS, events.FAULT_ENDS, True)},
        {"name": "link disconnected", "spans": between(run, events.LINK_DOWN, events.LINK_UP)},
        {"name": "board off", "spans": between(run, events.BOARD_OFF, events.BOARD_ON)},
    ]
    return [each for each in found if each["spans"]]


def _identity(run: Run) -> list[list[str]]:
    rows = [["run", str(run.path)], ["sha256 of run.mcap", hashlib.sha256(run.path.read_bytes()).hexdigest()]]
    for key, value in sorted(flat(run.meta).items()):
        if key not in ("name", "ticks") and value not in (None, "", {}):
            rows.append([key.replace("_", " "), str(value)])
    if len(run.sessions) > 1:
        rows.append(["board sessions from ticks", ", ".join(map(str, run.sessions))])
    return rows


def _short(value: Any) -> str:
    text = "–" if value is None else str(value)
    return text if len(text) <= _LONG else text[: _LONG - 1] + "…"
