"""One int32 word of CONFIG or TELEMETRY: its name, unit, scale and range; numbers to words and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

INT32_MAX = 2**31 - 1
NO_LIMIT = INT32_MAX  # of words whose maximum is infinite: no limit
STATUS_BAD_WORD, STATUS_UNKNOWN_LAW, STATUS_MISSING = 1, 2, 4  # READY statuses, as in protocol.frames
NO_INDEX = 0xFFFF


class Word(NamedTuple):
    """One int32 word. `q`: fractional bits, or the word that holds them; `lsb`, if not 0, replaces 2^-q (user laws)."""

    name: str
    unit: str
    q: int | str
    minimum: float
    maximum: float
    default: float
    about: str
    choices: tuple[str, ...] = ()
    lsb: float = 0.0


class ConfigError(ValueError):
    """A word that cannot be used. `status` and `index` are READY's."""

    def __init__(self, message: str, status: int = STATUS_BAD_WORD, index: int = NO_INDEX) -> None:
        super().__init__(message)
        self.status = status
        self.index = index


def lsb_of(word: Word, words: Mapping[str, int]) -> float:
    """Value of one count of `word`; `words` holds the word that `word.q` may name."""
    if word.lsb:
        return word.lsb
    return math.ldexp(1.0, -(words[word.q] if isinstance(word.q, str) else word.q))


def quantise(word: Word, value: float | str | bool, words: Mapping[str, int]) -> int:
    """The int32 of `value`; raises ConfigError that names key, range and unit."""
    number = number_of(word, value)
    if number == math.inf and word.maximum == math.inf:
        return NO_LIMIT
    if not word.minimum <= number <= word.maximum:
        raise ConfigError(f"{word.name}: expected {range_text(word)}, got {value}")
    count = round(number / lsb_of(word, words))
    if not -INT32_MAX - 1 <= count <= INT32_MAX:
        raise ConfigError(f"{word.name}: {value} {word.unit} does not fit 32 bits of {lsb_of(word, words)} each")
    return count


def dequantise(word: Word, count: int, words: Mapping[str, int]) -> float:
    """The value of a word; the inverse of quantise() up to half an LSB."""
    if count == NO_LIMIT and word.maximum == math.inf:
        return math.inf
    return count * lsb_of(word, words)


def in_range(word: Word, count: int, words: Mapping[str, int]) -> bool:
    """Is the word within its range, but for half an LSB of rounding? Zero only where zero is: laws divide by words.

    Twice the value is compared, so that all is exact in 64 bits, and in integers too (firmware/core/config.c).
    """
    if (word.q == 0 and not word.lsb) or count == 0:
        return word.minimum <= count <= word.maximum
    lsb = lsb_of(word, words)
    return (2 * count + 1) * lsb >= 2.0 * word.minimum and (2 * count - 1) * lsb <= 2.0 * word.maximum


def number_of(word: Word, value: float | str | bool) -> float:
    """The number that a choice's name, a truth value or a number stands for; raises ConfigError for unknown names."""
    if isinstance(value, str):
        if value not in word.choices:
            raise ConfigError(f"{word.name}: expected {range_text(word)}, got {value!r}")
        return float(word.choices.index(value))
    return float(value)


def range_text(word: Word) -> str:
    """What a value may be, in words."""
    if word.choices:
        return "one of " + ", ".join(word.choices)
    return f"{word.minimum:g} to {word.maximum:g} {word.unit}".rstrip()
