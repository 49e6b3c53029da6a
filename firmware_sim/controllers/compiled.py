"""What the built-in laws share: a state array with a table of its fields, parameters, one compiled call per step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, TypeAlias

import numpy as np

from firmware_sim import jit
from firmware_sim.fields import Field, offsets, size
from firmware_sim.fixed import INT32_MAX, INT32_MIN, clip, div_trunc, shift_round
from protocol.law_tables import AXES, FORM_FLOAT, Configuration, Word, refusal

Ranges: TypeAlias = tuple[tuple[int, int], ...]
Step = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


class LawRefuses(ValueError):
    """The law cannot fly with this configuration; the message says why in one line."""


class CompiledLaw(ABC):
    """Base of pd, mrac and appc: `state` and `par` are int64 (fixed) or float64 arrays, `step` runs one function.

    A law gives STATE, PAR, RANGES, `functions` and `compiled` (float step, fixed step, as source and compiled), the
    parameters, and WORDS or telemetry().
    """

    STATE: ClassVar[tuple[Field, ...]]
    PAR: ClassVar[tuple[Field, ...]]
    RANGES: ClassVar[Ranges]  # of its telemetry words
    WORDS: ClassVar[tuple[tuple[int, float], ...]] = ()  # each word: its place in the state, LSB of the float form
    functions: ClassVar[tuple[Step, Step]]
    compiled: ClassVar[tuple[Step, Step]]
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
        self._run = self.compiled[0] if self.is_float else self.compiled[1]
        self._gather = _words_float if self.is_float else _words_fixed
        self._lsb = np.array([lsb for _, lsb in self.WORDS])
        self._places = np.array([(place, *limits) for (place, _), limits in zip(self.WORDS, self.RANGES, strict=False)])
        self._words = np.zeros(len(self.WORDS), np.int64)
        self.initialise(self.state)

    @staticmethod
    @abstractmethod
    def float_par(configuration: Configuration) -> Sequence[float]:
        """Parameters of the float form."""

    @staticmethod
    @abstractmethod
    def fixed_par(configuration: Configuration) -> Sequence[int]:
        """Parameters of the fixed form, derived from the words by named operations only."""

    def initialise(self, state: np.ndarray) -> None:  # noqa: B027  (only laws with a state that is not zero do something)
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
        self.telemetry()

    def telemetry(self) -> list[int]:
        """WORDS of TELEMETRY after the common ones, within the ranges of the law's table."""
        self._gather(self.state, self._places, self._lsb, self._words)
        words: list[int] = self._words.tolist()
        return words

    def field(self, name: str) -> np.ndarray:
        """A view of one field of the state, in the form's own units."""
        index = [field.name for field in self.STATE].index(name)
        start = offsets(self.STATE)[index]
        return self.state[start : start + self.STATE[index].length]


def words_fixed(state: np.ndarray, places: np.ndarray, lsb: np.ndarray, words: np.ndarray) -> None:
    """`words`: the state at `places` (rows of index, lowest, highest), limited."""
    for n in range(len(places)):
        words[n] = clip(state[places[n, 0]], places[n, 1], places[n, 2])


def words_float(state: np.ndarray, places: np.ndarray, lsb: np.ndarray, words: np.ndarray) -> None:
    """The same in counts of `lsb`; what is not a number becomes the lowest word."""
    for n in range(len(places)):
        count = state[places[n, 0]] / lsb[n]
        words[n] = places[n, 1]
        if count == count:
            words[n] = clip(int(np.rint(min(max(count, -2147483648.0), 2147483647.0))), places[n, 1], places[n, 2])


_words_fixed, _words_float = jit.compile(words_fixed), jit.compile(words_float)


def word_of(value: float, lsb: float) -> int:
    """A float as an int32 telemetry word, limited; not a number becomes the lowest int32."""
    if value != value:
        return INT32_MIN
    return round(min(max(value / lsb, INT32_MIN), INT32_MAX))


def ranges_of(table: tuple[Word, ...]) -> Ranges:
    """(lowest, highest) count of each word of a telemetry table."""
    scales = [2.0 ** int(word.q) for word in table]
    return tuple(
        (max(round(word.minimum * scale), INT32_MIN), min(round(word.maximum * scale), INT32_MAX))
        for word, scale in zip(table, scales, strict=True)
    )


def torque_limits_fixed(common: Mapping[str, int]) -> list[int]:
    """torque_limit x, y, z in Q28; at most 8 N m, and at most what 32 bits of the wire's LSB hold."""
    bits = common["torque_bits"] - 28
    words = [common[f"torque_limit_{axis}"] for axis in AXES]
    if bits > 0:
        return [div_trunc(word, shift_round(1, -bits)) for word in words]  # never above the limit
    return [clip(shift_round(word, bits), 0, INT32_MAX) for word in words]
