"""What several runs have in common, in one line, and what to call each of them: by what differs, not by its path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sil.plain import flat
from sil.report.signals import controlled
from sil.runs import Run

_NOT_THE_RUN = ("name", "about", "seed", "law.name", "law.form", "require", "metrics")
_KEY_CHARACTERS = 28


def facts(runs: Sequence[Run]) -> str:
    """Law, sampling, delay, length and end, where they are the same; what differs is in the labels, or listed."""
    parts = [f"law {law}" for law in _agreed(runs, law_of)]
    parts.append("sampling " + ", ".join(dict.fromkeys(f"{run.period_s:g}" for run in runs)) + " s")
    delays = _agreed(runs, lambda run: run.scenario.get("transport_delay_ticks") if controlled(run) else None)
    parts += [f"transport delay {delay} tick" + ("" if delay == 1 else "s") for delay in delays]
    parts += [f"{count} ticks" for count in _agreed(runs, len)]
    parts += _agreed(runs, lambda run: run.end.get("reason", ""))
    return "   ·   ".join(filter(None, parts))


def law_of(run: Run) -> str:
    """Such as `appc (fixed)`."""
    if not controlled(run):
        return "none: torque from a schedule"
    law: Any = run.scenario.get("law") or run.meta.get("law") or {}
    if not isinstance(law, Mapping) or not law.get("name"):
        return ""
    return f"{law['name']} ({law['form']})" if law.get("form") else str(law["name"])


def labels(runs: Sequence[Run]) -> list[str]:
    """A short name for each run, all different: scenario, law, seed, one other key of the scenario, directories.

    Only as much is named as it takes to tell the runs apart.
    """
    if len(runs) == 1:
        return [runs[0].name]
    words: list[list[str]] = [[] for _ in runs]
    for tell in (_name_of, law_of, _seed_of):
        _tell_apart(runs, words, tell)
    for group in _same(words):
        for i, word in zip(group, _one_key([runs[i] for i in group]), strict=False):
            words[i].append(word)
    for tell in (_directory_of, _path_of):
        _tell_apart(runs, words, tell)
    for group in _same(words):
        for number, i in enumerate(group, 1):
            words[i].append(f"({number})")  # the same directory twice
    return [_joined(said) for said in words]


def _one_key(runs: Sequence[Run]) -> list[str]:
    """The one key of the scenario that tells all of them apart, with its values; [] where no single one does."""
    flats = [flat(run.scenario) for run in runs]
    keys = dict.fromkeys(key for each in flats for key in each)
    counting = [key for key in keys if not any(f"{key}.".startswith(f"{other}.") for other in _NOT_THE_RUN)]
    for key in counting:
        said = [f"{key.rpartition('.')[2]} {_short(each.get(key))}" for each in flats]
        if len(set(said)) == len(said) and max(map(len, said)) <= _KEY_CHARACTERS:
            return said
    return []


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _tell_apart(runs: Sequence[Run], words: list[list[str]], tell: Callable[[Run], str]) -> None:
    """Append to the words of runs that have the same ones so far, if it tells some of them apart."""
    for group in _same(words):
        said = [tell(runs[i]) for i in group]
        if len(set(said)) > 1:
            for i, word in zip(group, said, strict=True):
                words[i].append(word)


def _joined(words: Sequence[str]) -> str:
    """mrac-rs232, mrac-rs232-001: the second says it all."""
    kept = [
        word for i, word in enumerate(words) if word and not any(later.startswith(word) for later in words[i + 1 :])
    ]
    return ", ".join(kept)


def _name_of(run: Run) -> str:
    return run.name


def _seed_of(run: Run) -> str:
    return f"seed {run.meta.get('seed')}"


def _directory_of(run: Run) -> str:
    return run.directory.resolve().name


def _path_of(run: Run) -> str:
    return str(run.path)


def _same(words: list[list[str]]) -> list[list[int]]:
    """Groups of runs that cannot be told apart yet."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for i, said in enumerate(words):
        groups.setdefault(tuple(said), []).append(i)
    return [group for group in groups.values() if len(group) > 1]


def _agreed(runs: Sequence[Run], what: Callable[[Run], Any]) -> list[Any]:
    """[what they all have], or [] where they differ."""
    said = [what(run) for run in runs]
    return [said[0]] if said[0] is not None and all(each == said[0] for each in said) else []
