"""The keys an axis may vary, found in the resolved scenario: `plant.inertia_kgm2.0` is an item of a list."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sil.scenario_errors import Path
from sil.scenario_source import SHORT
from sil.trouble import UsageError

HOW = {  # is flown, not what: no axis
    "out": "--out says where a sweep goes",
    "clock": "--clock says it for all points",
    "timing": "the scenario says it for all points",
}
INERTIA: Path = ("plant", "inertia_kgm2")


def canonical_key(key: str, scenario: dict[str, Any], where: str) -> str:
    """`key` as a sweep writes it, short forms written out; raises UsageError for what cannot be varied.

    scenario: resolved values, as variable_values() returns them.
    """
    if not key or not all(key.split(".")):
        raise UsageError(f"{where}: expected KEY=SPEC, such as law.params.c2_pole=0.5:0.9:9, got {key!r}")
    for part in key.split("."):
        if part.isdigit() and not part.isascii():
            raise UsageError(f"{where}: expected an item as 0, 1, 2, got {part!r} in {key}")
    path = path_of(key)
    for short, name in SHORT.items():
        if path[: len(short)] == short and len(path) > len(short) and isinstance(path[len(short)], int):
            path = (*short, name, *path[len(short) :])  # plant.disturbance_Nm.0
    if path[0] in HOW:
        raise UsageError(f"{where}: expected a key of the test itself, got {key}; {HOW[path[0]]}")
    if path[:2] == INERTIA and len(path) == 3 and isinstance(held_at(scenario, path), list):
        row = path[2]
        expected = f"plant.inertia_kgm2.{row}.{row}, since the scenario's inertia has products (3 rows)"
        raise UsageError(f"{where}: expected {expected}, got {key}")
    return ".".join(map(str, path))


def refuse_overlaps(keys: Sequence[str]) -> None:
    """No key twice, and none inside of another: who of both would win?"""
    paths = [path_of(key) for key in keys]
    for i, path in enumerate(paths):
        for other in paths[:i]:
            shorter = min(len(path), len(other))
            if path[:shorter] == other[:shorter]:
                both = f"{'.'.join(map(str, other))} and {keys[i]}"
                raise UsageError(f"--vary {keys[i]}: expected each key once, and none inside of another, got {both}")


def variable_values(resolved: dict[str, Any]) -> dict[str, Any]:
    """The resolved scenario with a diagonal inertia written as 3 numbers, so that each of them has a key."""
    matrix = resolved["plant"]["inertia_kgm2"]
    if any(matrix[i][j] for i in range(3) for j in range(3) if i != j):
        return resolved
    diagonal = [matrix[i][i] for i in range(3)]
    return {**resolved, "plant": {**resolved["plant"], "inertia_kgm2": diagonal}}


def path_of(key: str) -> Path:
    """a.b.0 as ("a", "b", 0)"""
    return tuple(int(part) if part.isascii() and part.isdecimal() else part for part in key.split("."))


def held_at(scenario: Any, path: Path) -> Any:
    """What the scenario has at `path`; None where there is nothing."""
    for part in path:
        if isinstance(scenario, dict):
            scenario = scenario.get(str(part))
        elif isinstance(scenario, list | tuple) and isinstance(part, int) and part < len(scenario):
            scenario = scenario[part]
        else:
            return None
    return scenario
