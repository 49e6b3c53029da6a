"""A user's own plant: `plant.kind: ./FILE.py:CLASS`, loaded by path in the laboratory, flown like any other.

    class MyPlant:
        @classmethod
        def from_scenario(cls, scenario): ...             # the resolved scenario: scenario.plant.inertia_kgm2, ...
        def motion(self, t_ns): ...                       # sil.signals.Motion, fresh arrays
        def advance(self, torque_B, t_ns, period_ns): ... # torque (3,) N m on the body, held

What it raises is one line with its place. What is not a number ends the run as it does for the product's plants.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sil.plants import PLANTS
from sil.plugins import load
from sil.scenario_law import is_user_law
from sil.signals import Motion, Plant, Vector
from sil.trouble import UsageError

if TYPE_CHECKING:
    from sil.scenario import Scenario

METHODS = ("from_scenario", "motion", "advance")
SHAPES = {"q_BN": (4,), "omega_BN_B": (3,), "momentum_B": (3,), "euler_rad": (3,), "rate_rel": (3,)}
Answer = TypeVar("Answer")


def plant_of(scenario: Scenario) -> Plant:
    """The plant of a scenario; raises UsageError where a user's own is none."""
    file = scenario.file_of("plant.kind")
    if file is None:
        built: Plant = load(PLANTS, "plant.kind", scenario.plant.kind).from_scenario(scenario)
        return built
    name = scenario.plant.kind.rpartition(":")[2]
    kind = getattr(_called(file, lambda: _module(file)), name)
    if missing := [method for method in METHODS if not callable(getattr(kind, method, None))]:
        raise UsageError(f"{file}: expected class {name} with {', '.join(METHODS)}, got none called {missing[0]}")
    return UserPlant(file, _called(file, lambda: kind.from_scenario(scenario)))


def sha256_of(scenario: Scenario) -> str:
    """Of the file of a user's own plant; "" for a plant of the product."""
    file = scenario.file_of("plant.kind")
    return "" if file is None else hashlib.sha256(file.read_bytes()).hexdigest()


def refused(file: Path, kind: str) -> str | None:
    """What was expected of `./FILE.py:CLASS`, or None; the file is read and not run."""
    name = kind.rpartition(":")[2]
    if not file.is_file():
        return "a file that exists"
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"), str(file))
    except (ValueError, OSError, SyntaxError, RecursionError, MemoryError) as error:
        return f"a Python file ({' '.join(str(error).split())})"
    classes = [node.name for node in tree.body if isinstance(node, ast.ClassDef)]
    return None if name in classes else f"a class of {file.name} ({', '.join(classes) or 'it has none'})"


class UserPlant:
    """The plant `user` with whatever it raises in one line; its first motion is looked at."""

    def __init__(self, file: Path, user: Any) -> None:
        self._file, self._user = file, user
        _check(file, self.motion(0))

    def motion(self, t_ns: int) -> Motion:
        """Truth at t_ns."""
        found: Motion = _called(self._file, lambda: self._user.motion(t_ns))
        return found

    def advance(self, torque_B: Vector, t_ns: int, period_ns: int) -> None:
        """From t_ns to t_ns + period_ns, with a copy of the torque: the file is not ours."""
        _called(self._file, lambda: self._user.advance(torque_B.copy(), t_ns, period_ns))


def _check(file: Path, motion: object) -> None:
    if not isinstance(motion, Motion):
        raise UsageError(f"{file}: expected a sil.signals.Motion from motion(), got {type(motion).__name__}")
    for name, shape in SHAPES.items():
        value = getattr(motion, name)
        if not isinstance(value, np.ndarray) or value.shape != shape or value.dtype != np.float64:
            got = f"{value.dtype} {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
            raise UsageError(f"{file}: expected Motion.{name} as float64 {shape}, got {got}")


def _called(file: Path, function: Callable[[], Answer]) -> Answer:
    try:
        return function()
    except Exception as error:
        here = str(file.resolve())
        frames = [each for each in traceback.extract_tb(error.__traceback__) if each.filename == here]
        place = f"{file}:{frames[-1].lineno}" if frames else str(file)
        raise UsageError(f"{place}: the plant raised {type(error).__name__}: {' '.join(str(error).split())}") from error


def _module(file: Path) -> ModuleType:
    directory = str(file.resolve().parent)
    if directory not in sys.path:
        sys.path.append(directory)  # last: its neighbours, but nothing installed is hidden by them
    spec = importlib.util.spec_from_file_location(f"user_plant_{file.stem}", file.resolve())
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


def is_user_plant(kind: str) -> bool:
    """./my_plant.py:MyPlant"""
    return is_user_law(kind)
