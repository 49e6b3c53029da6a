"""Checked mode: the integer functions of a law un-jitted, over Python integers, where nothing can wrap unseen.

The functions are the very ones that are compiled; only the names they call are bound anew: check64 and check32 raise,
and every operation of fixed.py reports the largest magnitude it took or gave. After each step every field of the state
has to fit its width. register_use() says what fraction of its register each field and each operation came to fill.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

from firmware_sim import fixed
from firmware_sim.controllers.compiled import CompiledLaw, Step
from firmware_sim.fields import offsets


class RegisterOverflow(ArithmeticError):
    """A number that does not fit its register."""


class CheckedLaw:
    """A fixed-form law run in checked mode; `state` is its own copy, an array of Python integers."""

    def __init__(self, law: CompiledLaw) -> None:
        if law.is_float:
            raise ValueError("checked mode: expected the fixed form, got float")
        self._law = law
        self._peaks: dict[str, int] = {}
        self.state = np.array(law.state.tolist(), dtype=object)
        self._par = np.array(law.par.tolist(), dtype=object)
        self._step: Step = rebound(type(law).functions[1], self._peaks)

    def step(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """As the law's step(); `inp`, `ref` and `out` are int64 arrays, `ref` and `out` are written."""
        objects = [np.array(array.tolist(), dtype=object) for array in (inp, ref, out)]
        self._step(self.state, self._par, *objects)
        self._check_fields()
        ref[:], out[:] = objects[1].astype(np.int64), objects[2].astype(np.int64)
        for value in objects[2][:3]:
            _fits("torque", value, 32)

    def register_use(self) -> dict[str, float]:
        """Largest magnitude so far: fields by name as a fraction of their register, operations of 2^63.

        Products and sums inside the operations count as intermediate64 (of 2^63) and intermediate32 (of 2^31).
        """
        widths = {field.name: field.width for field in self._law.STATE} | {"intermediate32": 32}
        return {name: peak / 2.0 ** (widths.get(name, 64) - 1) for name, peak in sorted(self._peaks.items())}

    def _check_fields(self) -> None:
        for field, start in zip(self._law.STATE, offsets(self._law.STATE), strict=True):
            for value in self.state[start : start + field.length]:
                _fits(field.name, value, field.width)
                self._peaks[field.name] = max(self._peaks.get(field.name, 0), abs(value))


def _fits(name: str, value: int, width: int) -> int:
    if not -(2 ** (width - 1)) <= value < 2 ** (width - 1):
        raise RegisterOverflow(f"{name}: {value} does not fit {width} bits")
    return value


def rebound(function: Callable[..., Any], peaks: dict[str, int]) -> Callable[..., Any]:
    """`function` with every function of firmware_sim it calls replaced by a checked one; peaks: name -> largest."""
    checked: Callable[..., Any] = _rebind(function, peaks, {})
    return checked


def _rebind(function: Any, peaks: dict[str, int], done: dict[Any, Any]) -> Any:
    if function in done:
        return done[function]
    names = dict(function.__globals__)
    copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)
    done[function] = _recorded(copy, peaks) if function.__module__ == fixed.__name__ else copy
    for name in function.__code__.co_names:
        callee = names.get(name)
        if name in ("check32", "check64"):
            names[name] = functools.partial(_intermediate, peaks, 32 if name == "check32" else 64)
        elif isinstance(callee, FunctionType) and callee.__module__.startswith("firmware_sim."):
            names[name] = _rebind(callee, peaks, done)
    return done[function]


def _intermediate(peaks: dict[str, int], width: int, value: int) -> int:
    name = f"intermediate{width}"
    peaks[name] = max(peaks.get(name, 0), abs(value))
    return _fits(name, value, width)


def _recorded(function: Callable[..., int], peaks: dict[str, int]) -> Callable[..., int]:
    name = function.__name__

    @functools.wraps(function)
    def checked(*arguments: Any) -> int:
        result = function(*arguments)
        for value in (*arguments, result):
            if isinstance(value, int):
                _fits(name, value, 64)
                peaks[name] = max(peaks.get(name, 0), abs(value))
        return result

    return checked
