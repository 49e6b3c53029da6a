"""From pydantic's findings to one line each: which key, what was expected with its unit, what stands there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from sil.scenario_errors import Path, Problem, Where, key_of, one_of, shown, unknown_key

WhereOf = Callable[[Path], Where]

# Longest suffix first: _degps2 before _degps before _s.
UNITS = {  # by how the name of a key ends
    "_degps2": "deg/s^2",
    "_degps": "deg/s",
    "_radps": "rad/s",
    "_kgm2": "kg m^2",
    "_Nms": "N m s",
    "_Nm": "N m",
    "_deg": "deg",
    "_ticks": "ticks",
    "_s": "s",
    "_ms": "ms",
    "_us": "us",
    "_m": "m",
    "_tick": "ticks",
    "_percent": "%",
    "hold_limit": "ticks",
    "link_limit": "ticks",
    "telemetry_every": "ticks",
    "baud": "bit/s",
    "bits": "bits",
}
PLAIN = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "missing": "a value",
}
BOUNDS = {"greater_than": "above {gt:g}", "greater_than_equal": "not below {ge:g}"}
BOUNDS |= {"less_than": "below {lt:g}", "less_than_equal": "not above {le:g}"}


def unknown_keys(
    model: type[BaseModel], data: Mapping[str, Any], where_of: WhereOf, path: Path = ()
) -> Iterator[Problem]:
    """Keys that no section knows, at any depth."""
    for key, value in data.items():
        here = (*path, key)
        field = model.model_fields.get(key)
        if field is None:
            yield unknown_key(where_of(here), here, model.model_fields)
            continue
        inner = _model_of(field.annotation)
        if inner is None:
            continue
        items = enumerate(value) if isinstance(value, tuple) else [(None, value)]
        for index, item in items:
            if isinstance(item, dict):
                yield from unknown_keys(inner, item, where_of, here if index is None else (*here, index))


def problems_of(error: ValidationError, where_of: WhereOf) -> Iterator[Problem]:
    """One problem per finding; unknown keys are left to unknown_keys()."""
    for finding in error.errors(include_url=False):
        if finding["type"] == "extra_forbidden":
            continue
        path: Path = tuple(finding["loc"])
        place = where_of(path)
        got = "nothing" if finding["type"] == "missing" else shown(finding["input"])
        yield Problem(str(place), key_of(path), _expected(finding, path), got, place.line)


def _expected(finding: Any, path: Path) -> str:
    kind, context = finding["type"], finding.get("ctx", {})
    unit = _unit(path)
    if kind == "expected":
        return _with_unit(str(context["expected"]), unit)
    if kind == "literal_error":
        names = str(context["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
        return one_of(names, finding["input"])
    if kind in BOUNDS:
        number = "a number" if unit != "ticks" else "a whole number"
        return f"{_with_unit(number, unit)} {BOUNDS[kind].format(**context)}"
    if kind in ("model_type", "model_attributes_type"):
        return "a mapping of keys"
    return _with_unit(PLAIN.get(kind, str(finding["msg"])), unit)


def _with_unit(text: str, unit: str) -> str:
    """`3 numbers` becomes `3 numbers in N m`; only what starts with a number has a unit."""
    for start in ("a number", "a whole number", "a finite number", "3 numbers"):
        if unit and text.startswith(start):
            return f"{start} in {unit}{text.removeprefix(start)}"
    return text


def _unit(path: Path) -> str:
    name = next((part for part in reversed(path) if isinstance(part, str)), "")
    return next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), "")


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """The section inside Section, Section | None or tuple[Section, ...]."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for part in get_args(annotation) if (model := _model_of(part)) is not None), None)
