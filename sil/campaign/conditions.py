"""The conditions of a sweep: what is varied, what is fixed, how often is drawn; from options, a file, or both.

set: {sensors.attitude.bits: 24}
vary:
  plant.inertia_kgm2.0: uniform(1.491, 2.769)
  law.params.c2_pole: [0.7, 0.8]
sample: lhs
draws: 200
seed: 42
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sil.campaign.axes import refuse_unwritable
from sil.scenario_errors import one_of, shown
from sil.scenario_yaml import Values, read_mapping
from sil.trouble import UsageError

SAMPLES = ("random", "lhs")
KEYS = ("about", "set", "vary", "sample", "draws", "seed")
SEED = 0


class Spec:
    """One line of `vary`: key, what it says, and where it was written."""

    def __init__(self, key: str, spec: Any, where: str) -> None:
        self.key, self.spec, self.where = key, spec, where


@dataclass(frozen=True)
class Conditions:
    """What was asked for, before any of it is held against the scenario. `sample`, `draws`: None if nobody said."""

    specs: tuple[Spec, ...]
    sets: tuple[str, ...] = ()
    sample: str | None = None
    draws: int | None = None
    seed: int = SEED


def conditions_from(
    file: Path | None, vary: Sequence[str], sample: str | None, draws: int | None, seed: int | None
) -> Conditions:
    """The file's conditions, where there is one, with the options over them, key by key; raises UsageError."""
    base = _read(file) if file is not None else Conditions(())
    specs = {spec.key: spec for spec in base.specs}
    given: set[str] = set()
    for text in vary:
        key, equals, spec = text.partition("=")
        if not equals or not key:
            raise UsageError(f"--vary {text}: expected KEY=SPEC, such as seed=1:20, got no KEY=")
        if key in given:
            raise UsageError(f"--vary {key}: expected each key once, got it again")
        given.add(key)
        specs[key] = Spec(key, spec, f"--vary {key}")
    if not specs:
        raise UsageError("--vary: expected at least one KEY=SPEC, such as seed=1:20, or a --vary-file, got none")
    return Conditions(
        tuple(specs.values()),
        base.sets,
        _sample(sample, "--sample") or base.sample,
        _whole(draws, "-n", 1) or base.draws,
        base.seed if seed is None else _whole(seed, "--seed", 0) or 0,
    )


def _read(file: Path) -> Conditions:
    try:
        values = read_mapping(file.read_text(encoding="utf-8"), str(file))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"--vary-file: expected a readable YAML file, got {file}: {reason}") from None
    data = values.data
    for key in data:
        if key not in KEYS:
            raise UsageError(f"{_at(values, key)}: unknown key; expected {one_of(KEYS, key)}")
    vary, fixed = _section(values, "vary"), _section(values, "set")
    for key, value in fixed.items():
        refuse_unwritable(value, _at(values, "set", key))
    return Conditions(
        tuple(Spec(key, spec, _at(values, "vary", key)) for key, spec in vary.items()),
        tuple(f"{key}={json.dumps(value)}" for key, value in fixed.items()),
        _sample(data.get("sample"), _at(values, "sample")),
        _whole(data.get("draws"), _at(values, "draws"), 1),
        _whole(data.get("seed"), _at(values, "seed"), 0) or SEED,
    )


def _section(values: Values, name: str) -> dict[str, Any]:
    section = values.data.get(name) or {}
    if not isinstance(section, dict):
        raise UsageError(f"{_at(values, name)}: expected a mapping KEY: VALUE, got {shown(section)}")
    return section


def _at(values: Values, *path: str) -> str:
    where = values.where.get(path)
    return f"{where}: {'.'.join(path[-1:])}" if where is not None else path[-1]


def _sample(value: Any, where: str) -> str | None:
    if value is not None and value not in SAMPLES:
        raise UsageError(f"{where}: expected {one_of(SAMPLES, value)}, got {shown(value)}")
    return value if isinstance(value, str) else None


def _whole(value: Any, where: str, least: int) -> int | None:
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 2**64:
        raise UsageError(f"{where}: expected a whole number from {least}, got {shown(value)}")
    return value
