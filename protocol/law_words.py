"""What the table of one law is made of: its words, its designs, and the names for the values of common words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

from protocol.words import Word

FORM_FIXED, FORM_FLOAT = 0, 1
REFERENCE_NONE, REFERENCE_ZOH, REFERENCE_PAPER = 0, 1, 2
STALE_PROPAGATE, STALE_REUSE = 0, 1
SEQUENCE_321, SEQUENCE_123 = 0, 1
ERROR_EULER, ERROR_QUATERNION = 0, 1
USER_LAW_ID = 0xFFFF
READ_EULER, READ_QUATERNION, READ_RATE = 1, 2, 4  # bits of readings_mask
AXES = ("x", "y", "z")
AUTOMATIC = -1.0  # default of a word with fractional bits: as many as the values that use it allow


class Variant(NamedTuple):
    """One design of a law: delays n it can live with, leads d of the reference, defaults that differ, readings."""

    transport_delays: tuple[int, ...]
    reference_leads: tuple[int, ...]
    defaults: Mapping[str, float] = {}
    needs: int = READ_EULER


class LawTable(NamedTuple):
    """One law, one version. With lead d, r(k) first shows in ym(k + d); the first allowed lead is the default.

    `variants`, if any, is indexed by the value of the word `variant_word`; `needs` are the readings with the defaults.
    """

    law_id: int
    version: int
    name: str
    params: tuple[Word, ...]
    telemetry: tuple[Word, ...]
    transport_delays: tuple[int, ...]
    period_s: tuple[float, float]
    reference_leads: tuple[int, ...]
    needs: int
    variant_word: str = ""
    variants: tuple[Variant, ...] = ()
    finite_in_fixed: tuple[str, ...] = ()  # words that may say "no limit" in the float form only
    has_model: bool = True  # without a reading it propagates its model; else it repeats its last command
    float_only: bool = False  # there is no fixed form
    fixed_most_Nm: float = math.inf  # the fixed form has no larger torque
    only_321: str = ""  # word that, where it is not 0, makes this a law for 3-2-1 angles only; law_id: always
    arrays: Mapping[str, tuple[str, ...]] = {}  # lists and matrices by name: the size, by name, in each direction
    sizes: Mapping[str, int] = {}  # the largest value of each size; what is smaller is filled up with zeros

    def variant(self, params: Mapping[str, float]) -> Variant:
        """The design that these parameter values choose; of a law with one design, that one."""
        if self.variant_word:
            return self.variants[int(params[self.variant_word])]
        return Variant(self.transport_delays, self.reference_leads, {}, self.needs)


def vector(name: str, unit: str, q: int | str, low: float, high: float, default: Sequence[float], about: str,
           axes: Sequence[str] = AXES) -> tuple[Word, ...]:  # fmt: skip
    """The words name_x, name_y, name_z, each with its own default."""
    return tuple(
        Word(f"{name}_{axis}", unit, q, low, high, value, f"{about}, {axis}")
        for axis, value in zip(axes, default, strict=True)
    )


def array(name: str, unit: str, q: int | str, low: float, high: float, shape: tuple[int, ...], about: str,
          default: Sequence[float] = ()) -> tuple[Word, ...]:  # fmt: skip
    """The words name_1, name_2, ... of a list, name_1_1, name_1_2, ... of a matrix by rows; zero after `default`."""
    indices = list(product(*(range(1, size + 1) for size in shape)))
    filled = [*default, *[0.0] * (len(indices) - len(default))]
    return tuple(
        Word("_".join((name, *map(str, index))), unit, q, low, high, value, about)
        for index, value in zip(indices, filled, strict=True)
    )


def flag(name: str, default: int, about: str) -> Word:
    """A word that is off or on."""
    return Word(name, "", 0, 0, 1, default, about, ("off", "on"))


def error_word(default: int) -> Word:
    """What a law takes for its attitude error (firmware_sim/controllers/attitude_error.py)."""
    about = "attitude error: difference of the Euler angles, or in body axes"
    return Word("error", "", 0, 0, 1, default, about, ("euler", "quaternion"))


INERTIA_WORDS = vector(
    "inertia_kgm2", "kg m^2", 26, 0.05, 30, (2.13, 3.04, 3.09), "principal inertia the law believes in"
)
