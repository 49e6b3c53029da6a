"""What a run was: scenario, law, versions, hashes, verdict, figures, events. `info` gives data, `text` the page."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from typing import Any

from protocol.events import name_of
from sil import mcap_file
from sil.metrics import AXIS_NAMES, NEVER_SETTLED, SETTLING, as_json, judge, measure
from sil.plain import plain
from sil.runs import Run, readable

_TYPES = {1: "CONFIG", 2: "SAMPLE", 3: "COMMAND", 4: "TELEMETRY", 5: "EVENT"}


def info(run: Run) -> dict[str, Any]:
    """All facts of a run as plain JSON values (numbers that do not exist are null). Raises RunError."""
    with readable(run.path):
        return _facts(run)


def _facts(run: Run) -> dict[str, Any]:
    metrics = measure(run)
    end = run.end
    content = {
        "run": str(run.path),
        "name": run.name,
        "verdict": run.summary.get("verdict"),
        "reason": end.get("reason"),
        "ticks": len(run),
        "period_s": run.period_s,
        "duration_s": len(run) * run.period_s,
        "law": {**_mapping(run.meta.get("law")), **_mapping(run.scenario.get("law"))} if run.config_words else None,
        "seed": run.meta.get("seed"),
        "identity": {key: value for key, value in sorted(run.meta.items()) if key not in ("name", "law", "seed")},
        "metrics": as_json(metrics),
        "require": [judgement._asdict() for judgement in judge(run.scenario.get("require") or (), metrics)],
        "packets": _packets(run),
        "sessions": run.sessions,
        "events": _events(run),
        "host": _host(run),
        "sha256": hashlib.sha256(run.path.read_bytes()).hexdigest(),
    }
    found: dict[str, Any] = plain(content)
    return found


def text(content: Mapping[str, Any]) -> str:
    """The same for reading."""
    law = content["law"] or {}
    lines = [
        _row("run", content["run"]),
        _row("scenario", content["name"]),
        _row("ended", f"{content['reason']} after {content['ticks']} ticks ({content['duration_s']:g} s)"),
        _row("verdict", content["verdict"] or "not judged"),
        _row("law", " ".join(filter(None, (law.get("name", "none"), law.get("form", ""))))),
        _row("sampling", f"{content['period_s']:g} s"),
        _row("seed", content["seed"]),
    ]
    if len(content["sessions"]) > 1:
        starts = ", ".join(str(tick) for tick in content["sessions"])
        lines.append(_row("board sessions", f"{len(content['sessions'])}, from ticks {starts}: the board restarted"))
    lines += [_row(key, _short(value)) for key, value in content["identity"].items() if value not in (None, "", {})]
    lines += [_row("sha256", content["sha256"]), "", _heading("roll", "pitch", "yaw")]
    lines += [_metric(name, value) for name, value in _named(content["metrics"]).items()]
    lines += _block("requirements", [_required(line) for line in content["require"]])
    lines += _block("frames", [f"{key:<48}{count:>8}" for key, count in content["packets"].items()])
    lines += _block("events", [_event_line(name, entry) for name, entry in content["events"].items()])
    lines += _block("host", [f"{key:<24}{_short(value)}" for key, value in content["host"].items()])
    return "\n".join(lines)


def _packets(run: Run) -> dict[str, int]:
    """Frames by direction, type and, where it is not `delivered`, fate; by cause where the link did something."""
    counts: Counter[str] = Counter()
    for packet in run.packets:
        fate = "" if packet.fate == "delivered" else f" {packet.fate}"
        said = f" ({packet.cause})" if packet.cause else ""
        copy = ", a further copy" if packet.copy else ""
        counts[f"{packet.direction} {_TYPES.get(packet.type, hex(packet.type))}{fate}{said}{copy}"] += 1
    return dict(sorted(counts.items()))


def _events(run: Run) -> dict[str, dict[str, Any]]:
    """Events by name: how many, first and last tick."""
    result: dict[str, dict[str, Any]] = {}
    for event in run.events:
        key = f"{name_of(event.code)}" if event.origin == "board" else f"{name_of(event.code)} (laboratory)"
        entry = result.setdefault(key, {"count": 0, "first_tick": event.tick, "last_tick": event.tick})
        entry["count"] += 1
        entry["last_tick"] = event.tick
    return result


def _host(run: Run) -> dict[str, Any]:
    """What timing.mcap beside the log says of machine, link and board; {} where it is missing or damaged."""
    try:
        content = mcap_file.read(run.directory / "timing.mcap", ())
    except (OSError, mcap_file.McapError):
        return {}
    return {key: _value(value) for key, value in content.metadata.get("host", {}).items()}


def _value(text_: str) -> Any:
    try:
        return json.loads(text_)
    except ValueError:
        return text_


def _mapping(value: Any) -> dict[str, Any]:
    return dict(value) if isinstance(value, Mapping) else {}


# -- text --------------------------------------------------------------------------------------------------------------


def _row(key: str, value: Any) -> str:
    return f"{key:<26}{value}"


def _named(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """What never settled says so in its place."""
    shown = {name: value for name, value in metrics.items() if name != NEVER_SETTLED}
    settling = zip(AXIS_NAMES, metrics[SETTLING], strict=True)
    return {**shown, SETTLING: ["never" if axis in metrics[NEVER_SETTLED] else value for axis, value in settling]}


def _heading(*columns: str) -> str:
    return f"{'metric':<26}" + "".join(f"{column:>14}" for column in columns)


def _metric(name: str, value: Any) -> str:
    if isinstance(value, list):
        return f"{name:<26}" + "".join(f"{_number(v):>14}" for v in value)
    return f"{name:<26}{_number(value):>14}"


def _number(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _required(line: Mapping[str, Any]) -> str:
    got = line["reason"] or _number(line["value"])
    return f"{'passed' if line['passed'] else 'FAILED':<8}{line['requirement']}   got {got}"


def _event_line(name: str, entry: Mapping[str, Any]) -> str:
    first, last = entry["first_tick"], entry["last_tick"]
    when = f"tick {first}" if first == last else f"ticks {first} to {last}"
    return f"{name:<36}{entry['count']:>6} x   {when}"


def _block(title: str, lines: list[str]) -> list[str]:
    return ["", title, *(f"  {line}" for line in lines)] if lines else []


def _short(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {item}" for key, item in value.items())
    return str(value)
