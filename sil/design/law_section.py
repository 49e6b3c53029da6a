"""Designs as the `law:` section of a scenario."""

from __future__ import annotations

from collections.abc import Iterable

from sil.design.fuzzy import ENTRIES, Inference
from sil.design.linear import Array
from sil.design.sheet import MOST_STATES, Sheet
from sil.trouble import UsageError

STATE_BITS = 28  # states reach 8: theirs is 1 at most, but for an integrator's


def law_section(sheet: Sheet) -> str:
    """YAML of law state_space; raises UsageError where there is no such law."""
    C = sheet.discrete
    if C is None or sheet.sampling is None:
        raise UsageError("--yaml, --out: expected --period beside it, the law is discrete")
    if not C.order:
        raise UsageError("--yaml, --out: expected a compensator with states; PD is law pd, `rate: sensed`")
    if C.order > MOST_STATES:
        raise UsageError(f"--yaml, --out: expected an order of at most {MOST_STATES}, got {C.order}; see --order")
    lines = [
        f"# {sheet.title}; every {sheet.sampling.period_s:g} s, {sheet.sampling.method}.",
        "# torque = gain x (C x + D e), e = ref - y; C and D are for an inertia of 1 kg m^2.",
        "law:",
        "  name: state_space",
        "  params:",
        f"    state_bits: {STATE_BITS}",
        "    A:",
        *(f"      - {_row(row)}" for row in C.A),
        f"    B: {_row(C.B[:, 0])}",
        f"    C: {_row(C.C[0])}",
        f"    D: {_number(C.D[0, 0])}",
        f"    gain: {_row(sheet.inertia)}",
    ]
    return "\n".join(lines) + "\n"


def fuzzy_section(inference: Inference, table: Array) -> str:
    """YAML of law fvsc with its table; raises UsageError where the law has no such table."""
    if table.shape != (ENTRIES,):
        raise UsageError(f"--yaml, --out: expected one input and {ENTRIES} entries, the table of law fvsc")
    lines = [
        f"# Mamdani, min and {inference.aggregation}, exact centroid: -f(e)/L at {ENTRIES} errors from 0 to E.",
        "law:",
        "  name: fvsc",
        "  params:",
        "    inference: table",
        f"    E: {_number(inference.ranges[0])}",
        f"    L: {_number(inference.reach)}",
        f"    f_table: {_row(table)}",
    ]
    return "\n".join(lines) + "\n"


def _row(values: Iterable[float]) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Twelve digits: more than the words hold. YAML wants a digit before an exponent, which %g gives."""
    return f"{float(value):.12g}"
