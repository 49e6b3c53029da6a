"""What the built-in laws share: a state array with a table of its fields, parameters, one compiled call per step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from protocol.law_tables import FORM_FLOAT, Configuration, Word, refusal

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
Step = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


class LawRefuses(ValueError):
    """The law cannot fly with this configuration; the message says why in one line."""


class Field(NamedTuple):
    """One field of a law's state: `count` numbers with `q` fractional bits of `unit`, `width` bits each (fixed form)."""

    name: str
    count: int
    unit: str
    q: int
    width: int = 32


def offsets(fields: Sequence[Field]) -> tuple[int, ...]:
    """Index of each field's first number."""
    starts = [0]
    for field in fields:
        starts.append(starts[-1] + field.count)
    return tuple(starts[:-1])


def size(fields: Sequence[Field]) -> int:
    """Length of the state array."""
    return sum(field.count for field in fields)


class CompiledLaw:
    """Base of pd, mrac and appc: `state` and `par` are int64 (fixed) or float64 arrays, `step` runs one function.

    A law gives STATE, RESTARTED (state index of "this step restarted the reference"), the four functions, telemetry().
    """

    STATE: ClassVar[tuple[Field, ...]]
    has_model: ClassVar[bool] = True

    def __init__(self, configuration: Configuration) -> None:
        why = refusal(configuration)
        if why is not None:
            raise LawRefuses(why)
        self.configuration = configuration
        self.is_float = configuration.common["form"] == FORM_FLOAT
        dtype = np.float64 if self.is_float else np.int64
        numbers: Sequence[float] = self.float_par(configuration) if self.is_float else self.fixed_par(configuration)
        self.par = np.array(numbers, dtype)
        self.state = np.zeros(size(self.STATE), dtype)
        self._run = self.float_step() if self.is_float else self.fixed_step()
        self.initialise(self.state)

    @staticmethod
    def float_par(configuration: Configuration) -> Sequence[float]:
        """Parameters of the float form."""
        raise NotImplementedError

    @staticmethod
    def fixed_par(configuration: Configuration) -> Sequence[int]:
        """Parameters of the fixed form, derived from the words by named operations only."""
        raise NotImplementedError

    @staticmethod
    def float_step() -> Step:
        """The compiled float step."""
        raise NotImplementedError

    @staticmethod
    def fixed_step() -> Step:
        """The compiled fixed step."""
        raise NotImplementedError

    def initialise(self, state: np.ndarray) -> None:
        """Set what does not start at zero."""

    @property
    def reference_restarted(self) -> bool:
        """True if the last step() began the reference anew."""
        return False

    def step(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """One tick; see inputs.py for the arrays."""
        self._run(self.state, self.par, inp, ref, out)

    def warm_up(self, inp: np.ndarray, ref: np.ndarray, out: np.ndarray) -> None:
        """Compile (or load) the step on copies; the law's state and all arguments stay as they are."""
        self._run(self.state.copy(), self.par, inp.copy(), ref.copy(), out.copy())

    def field(self, name: str) -> np.ndarray:
        """A view of one field of the state, in the form's own units."""
        index = [field.name for field in self.STATE].index(name)
        start = offsets(self.STATE)[index]
        return self.state[start : start + self.STATE[index].count]


def word_of(value: float, lsb: float) -> int:
    """A float as an int32 telemetry word, limited; not a number becomes the lowest int32."""
    if value != value:
        return INT32_MIN
    return int(round(min(max(value / lsb, INT32_MIN), INT32_MAX)))


def limited(words: Sequence[int], table: Sequence[Word]) -> list[int]:
    """Telemetry words within the ranges of their table."""
    return [
        int(min(max(value, round(word.minimum * 2.0 ** int(word.q))), round(word.maximum * 2.0 ** int(word.q)), INT32_MAX))
        for value, word in zip(words, table, strict=True)
    ]
