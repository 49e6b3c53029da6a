"""Tables of fields: what stands where in the arrays `state` and `par` of a law and of the reference model.

Python's index constants and the C structs of firmware/core/generated/law_states.h come from the same tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Field(NamedTuple):
    """`length` numbers of one kind; fixed form: `q` fractional bits of `unit`, `width` bits each.

    `shift`: name of the field that holds the bits by which a product with this mantissa is shifted.
    """

    name: str
    length: int
    unit: str
    q: int
    width: int = 32
    shift: str = ""


def offsets(fields: Sequence[Field]) -> tuple[int, ...]:
    """Index of each field's first number."""
    starts = [0]
    for field in fields:
        starts.append(starts[-1] + field.length)
    return tuple(starts[:-1])


def size(fields: Sequence[Field]) -> int:
    """Length of the array."""
    return sum(field.length for field in fields)
