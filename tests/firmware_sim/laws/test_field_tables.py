"""The tables PAR and STATE describe the arrays as they are, so the C structs made from them can hold the numbers."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

import numpy as np
import pytest

from firmware_sim.controllers import LAWS, new_law
from firmware_sim.fields import Field, offsets, size
from firmware_sim.guidance import reference
from protocol.law_tables import config_words, law_by_name, parse_configuration
from protocol.laws import IN_C
from tools.c_states import SHARED, STRUCTS, c_dtype, c_order, c_size

TABLES = [(name, table) for name, (_, par, state) in STRUCTS.items() for table in (par, state)]
EIGHT = [1000.0] * 8
CORNERS = {
    "state_space": [
        {"A": [EIGHT] * 8, "B": EIGHT, "C": EIGHT, "D": 1e6, "gain": -1.0, "state_bits": 20},
        {"A": [[1.0]], "B": [1e-12], "C": [1e-12], "gain": 1e-12, "torque_bits": 8, "state_bits": 30},
    ],
    "pd": [
        {"period_us": 1000, "kd": 1e6, "kp": -1e6},
        {"period_us": 10_000_000, "kd": 1e-9, "torque_bits": 8},
        {"rate": 1, "kd": 1e6, "rate_bits": 8, "error": 1},
        {"rate": 1, "kd": 1e-9, "rate_bits": 30},
    ],
    "mrac": [
        {"period_us": 200_000, "inertia_kgm2": 30.0, "forgetting": 0.9, "c2_pole": 0.999, "kappa": 0},
        {"period_us": 1_000_000, "inertia_kgm2": 0.126, "kappa": 1, "trace_max": 2000, "torque_bits": 8},
        {"design": "printed", "printed_b0": -1.99},
    ],
    "appc": [
        {"period_us": 200_000, "inertia_kgm2": 30.0, "controller_pole": 0, "observer_pole": 0},
        {"period_us": 1_000_000, "inertia_kgm2": 0.05, "controller_pole": 0.99, "orbit_rate_radps": 0.007},
    ],
}
CORNERS["vsc"] = [
    {"period_us": 1000, "ka": 1e6, "Ks": 2000, "Kr": 2000, "m": 100, "torque_bits": 30, "torque_limit": 1},
    {"period_us": 10_000_000, "ka": 1e-9, "torque_bits": 8, "rate_bits": 30, "rate_in_S": 1, "error": 0},
]
FUZZY = [{"E": 2.0**-9}, {"E": 3.2, "inference": 1}]
CORNERS["fvsc"] = [corner | fuzzy for corner in CORNERS["vsc"] for fuzzy in FUZZY]
CORNERS["ifvsc"] = [corner | {"Ki": 2000, "integral_limit": 2000} for corner in CORNERS["fvsc"]]
REFERENCES = [{"reference_pole": pole, "reference_kind": kind} for pole in (0, 1) for kind in (0, 1, 2)]


def fits(numbers: np.ndarray, fields: Sequence[Field]) -> None:
    assert len(numbers) == size(fields)
    for field, start in zip(fields, offsets(fields), strict=True):
        values = numbers[start : start + field.length].tolist()
        assert all(-(2 ** (field.width - 1)) <= x < 2 ** (field.width - 1) for x in values), f"{field.name}: {values}"


def test_every_law_has_a_struct_under_its_name() -> None:
    assert set(STRUCTS) == {*IN_C, "reference"} - set(SHARED)
    for name in IN_C:
        module, _, cls = LAWS[name].partition(":")
        law = getattr(importlib.import_module(module), cls)
        assert STRUCTS[SHARED.get(name, name)][1:] == (law.PAR, law.STATE)


@pytest.mark.parametrize("law", [law for law in LAWS if not law_by_name(law).float_only])
def test_parameters_and_first_state_fit_their_fields(law: str) -> None:
    """At the corners of what the law's table allows, where they are largest."""
    for corner in CORNERS[law]:
        flown = new_law(law, parse_configuration(config_words(law_by_name(law), {"torque_limit": 0.1} | corner)))
        fits(flown.par, flown.PAR)  # type: ignore[attr-defined]
        fits(flown.state, flown.STATE)  # type: ignore[attr-defined]
        floats = type(flown).float_par(flown.configuration)  # type: ignore[attr-defined]
        assert len(floats) == size(flown.PAR)  # type: ignore[attr-defined]


@pytest.mark.parametrize("values", REFERENCES, ids=str)
def test_the_references_parameters_fit_their_fields(values: dict[str, float]) -> None:
    model = reference.Reference(parse_configuration(config_words(law_by_name("pd"), values)).common, False)
    fits(model.par, reference.PAR)
    fits(model.state, reference.STATE)
    assert len(reference.float_parameters(1, 0.5)) == size(reference.PAR)


@pytest.mark.parametrize(("name", "table"), TABLES, ids=lambda value: value if isinstance(value, str) else len(value))
def test_a_table_makes_a_struct_without_padding(name: str, table: tuple[Field, ...]) -> None:
    names = [field.name for field in table]
    assert len(set(names)) == len(names) and "reserved" not in names
    assert all(field.shift in ("", *names) and field.width in (32, 64) for field in table)
    at = 0
    for field in c_order(table):  # each at a multiple of its own size, one after the other
        assert at % (field.width // 8) == 0
        at += field.length * field.width // 8
    assert at == c_dtype(table).itemsize and at % 8 == 0
    assert c_size(name) % 8 == 0
