"""A user's own law: `./file.py:Class`, loaded by path, float arithmetic, flown like any other.

    class MyLaw:
        PARAMS = {"kp": (0.02, "N m/rad", 1e-6)}        # name: (default, unit, lsb); may be left out
        def init(self, params): ...                     # once before its first step(); params: {name: float}
        def step(self, sample): return torque           # every tick; three numbers, N m, on the body

Without a reading the law is not asked: its last command is repeated and COMMAND says so. With MODEL = True in the class
step() is called all the same; then sample.fresh is False and the readings are NaN, never stale. No made-up
sample warms it up; a bumpless re-start (SPEC B8) flies a new object. A torque of NaN is sent as 0, with event NAN.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from firmware_sim.controllers import inputs
from firmware_sim.controllers.compiled import LawRefuses
from firmware_sim.guidance.reference import NOW, RATE_NOW
from protocol.law_tables import COMMON, FORM_FLOAT, Configuration, LawTable, refusal, user_table

RAD_PER_BAM = 2.0 * math.pi / 2**32
RAD_PER_TURN36 = 2.0 * math.pi / 2**36


class LawFileError(ValueError):
    """A law that cannot be loaded; one line: file and class, what was expected, what was found."""


class LawFailed(RuntimeError):
    """The law's own code raised, or gave something that is not a torque; one line with its place."""


@dataclass(frozen=True, slots=True)
class LawSample:
    """What a user's law is given at tick k. Arrays are float64; body axes; angles [x, y, z] as configured."""

    tick: int  # k
    period_s: float  # T_s
    fresh: bool  # this tick's reading is there
    attitude_rad: np.ndarray  # (3,) Euler angles
    quaternion: np.ndarray  # (4,) scalar first, zero where there is no such sensor
    rate_radps: np.ndarray  # (3,) body rate, zero where there is no such sensor
    setpoint_rad: np.ndarray  # (3,) r(k)
    reference_rad: np.ndarray  # (3,) reference model ym(k)
    reference_rate_radps: np.ndarray  # (3,) its rate
    applied_Nm: np.ndarray  # (3,) torque that acts from now on
    momentum_Nms: np.ndarray  # (3,) wheels


def load_user_law(spec: str) -> tuple[LawTable, type]:
    """Table and class of `FILE.py:CLASS`; raises LawFileError. Runs the file."""
    path_text, _, name = spec.rpartition(":")
    path = Path(path_text)
    if not path_text.endswith(".py") or not name.isidentifier():
        raise LawFileError(f"law.name: expected FILE.py:CLASS, got {spec!r}")
    if not path.is_file():
        raise LawFileError(f"law.name: no file {path}")
    cls = getattr(_module(path), name, None)
    if not isinstance(cls, type):
        raise LawFileError(f"{path}: no class {name}")
    return _table(f"{path.name}:{name}", cls), cls


def _module(path: Path) -> ModuleType:
    directory = str(path.resolve().parent)
    if directory not in sys.path:
        sys.path.append(directory)  # last: the law's neighbours, but nothing installed is hidden by them
    loader = importlib.util.spec_from_file_location(f"user_law_{path.stem}", path)
    assert loader is not None and loader.loader is not None
    module = importlib.util.module_from_spec(loader)
    sys.modules[module.__name__] = module
    try:
        loader.loader.exec_module(module)
    except SyntaxError as error:
        raise LawFileError(f"{path}, line {error.lineno}: {error.msg}") from None
    except Exception as error:
        raise LawFileError(f"{path}{_line(error, path)}: {type(error).__name__}: {error}") from None
    return module


def _table(name: str, cls: type) -> LawTable:
    params = getattr(cls, "PARAMS", {})
    if not isinstance(params, dict):
        raise LawFileError(f"{name}: PARAMS: expected {{name: (default, unit, lsb)}}, got {params!r}")
    needed = ["step", "init"] if params else ["step"]
    for method in needed:
        if not callable(getattr(cls, method, None)):
            raise LawFileError(f"{name}: expected a method {method}, got none")
    for key, value in params.items():
        _check_param(name, key, value)
    return user_table(cls.__name__, {k: (float(d), str(u), float(lsb)) for k, (d, u, lsb) in params.items()})


def _check_param(name: str, key: object, value: object) -> None:
    if not isinstance(key, str) or not key.isidentifier() or key in {word.name for word in COMMON}:
        raise LawFileError(f"{name}: PARAMS: {key!r} is not a free name")
    match value:
        case (int() | float() as default, str(), int() | float() as lsb) if math.isfinite(default + lsb):
            pass
        case _:
            raise LawFileError(f"{name}: PARAMS[{key!r}]: expected (default, unit, lsb), got {value!r}")
    if not lsb > 0 or abs(default) / lsb >= 2**31:
        raise LawFileError(f"{name}: PARAMS[{key!r}]: {default} does not fit 32 bits of lsb {lsb}")


def _line(error: BaseException, path: Path) -> str:
    """ ", line N" of the innermost frame in the user's file."""
    trace, line = error.__traceback__, 0
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).name == path.name:
            line = trace.tb_lineno
        trace = trace.tb_next
    return f", line {line}" if line else ""


class UserLaw:
    """A user's class behind the interface of the built-in laws."""

    reference_restarted = False

    def __init__(self, cls: type, configuration: Configuration) -> None:
        why = refusal(configuration)
        if why is not None:
            raise LawRefuses(why)
        self._name = cls.__name__
        self._path = Path(sys.modules[cls.__module__].__file__ or "")
        self.has_model = bool(getattr(cls, "MODEL", False))
        self._period_s = configuration.common["period_us"] * 1e-6
        self._is_float = configuration.common["form"] == FORM_FLOAT
        self._scale = np.ones(inputs.SIZE) if self._is_float else inputs.si_scale(configuration.common)
        self._torque_unit = 1.0 if self._is_float else 2.0 ** -configuration.common["torque_bits"]
        self._command = np.zeros(3)
        self._started = False
        self._law: Any = self._call("__init__", cls)
        if hasattr(cls, "init"):
            self._call("init", self._law.init, {name: configuration.values[name] for name in configuration.params})

    def step(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """One tick; see inputs.py for the arrays."""
        fresh = bool(inp[inputs.FRESH])
        self._started = self._started or fresh
        if fresh or (self.has_model and self._started):
            self._command = self._torque(self._call("step", self._law.step, self._sample(inp, ref, fresh)))
        out[:3] = self._command if self._is_float else self._wire(out)
        out[inputs.OUT_FLAGS] = 0 if self._started else inputs.STARTING

    def warm_up(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """Nothing: a user's law may keep count of its calls, and cannot be copied."""

    def telemetry(self) -> list[int]:
        """No words of its own."""
        return []

    def _sample(self, inp: np.ndarray, ref: np.ndarray, fresh: bool) -> LawSample:
        si = inp * self._scale
        if not fresh:
            si[inputs.EULER] = si[inputs.QUATERNION] = si[inputs.RATE] = math.nan
        angle, rate = (1.0, 1.0) if self._is_float else (RAD_PER_BAM, RAD_PER_TURN36)
        return LawSample(
            int(inp[inputs.TICK]),
            self._period_s,
            fresh,
            si[inputs.EULER],
            si[inputs.QUATERNION],
            si[inputs.RATE],
            si[inputs.SETPOINT],
            ref[NOW : NOW + 3] * angle,
            ref[RATE_NOW : RATE_NOW + 3] * rate / self._period_s,
            si[inputs.APPLIED],
            si[inputs.MOMENTUM],
        )

    def _torque(self, value: object) -> np.ndarray:
        try:
            torque = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            torque = np.zeros(0)
        if torque.shape != (3,):
            raise LawFailed(f"law {self._name}: step: expected three numbers, N m, got {value!r}")
        return torque

    def _wire(self, out: np.ndarray) -> np.ndarray:
        missing = np.isnan(self._command)
        counts = np.where(missing, 0.0, self._command) / self._torque_unit
        wire = np.rint(np.clip(counts, -(2**31) + 1, 2**31 - 1)).astype(out.dtype)
        wire[missing] = inputs.NOT_A_NUMBER
        return wire

    def _call(self, what: str, function: Any, *arguments: object) -> Any:
        try:
            return function(*arguments)
        except Exception as error:
            place = f"{self._path.name}{_line(error, self._path)}"
            raise LawFailed(f"law {self._name}: {what}: {type(error).__name__}: {error} ({place})") from error
