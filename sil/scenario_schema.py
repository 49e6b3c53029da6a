"""The JSON Schema of a scenario file, for editors and CI: what each key means, its unit, range and default.

python -m sil.scenario_schema > sil/scenarios/scenario.schema.json

JSON Schema draft 7, which every editor knows. It accepts the short forms (`link: udp`) and knows the parameters of each
built-in law. It cannot tell what only `sil check` can: whether keys fit each other, files exist, deadlines can be met.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from protocol.law_tables import AUTOMATIC, LAWS, LawTable, Word
from sil import scenario_law as laws
from sil.plants import PLANTS
from sil.profiles import PROFILES
from sil.scenario import json_schema
from sil.scenario_metrics import METRICS
from sil.scenario_sections import BOARDS, LINKS, Law
from sil.scenario_source import SHORT
from sil.scenario_validation import UNITS

DRAFT = "http://json-schema.org/draft-07/schema#"
BOUNDS = ("below", "above", "between")
# N of scaled:N from 0.01 to 1000, as sil.scenario_sections has it in SLOWEST and FASTEST
SCALES = r"^scaled:(0*[1-9][0-9]{0,2}(\.[0-9]+)?|0*1000(\.0+)?|0+\.(0[1-9]|[1-9])[0-9]*)$"

Schema = dict[str, Any]


def scenario_schema() -> Schema:
    """The schema that is published with the package."""
    schema = json_schema()
    known = schema["$defs"]
    _tidy(schema)
    _name_choices(schema)
    for path, name in SHORT.items():
        _shorten(schema, path, name)
    known["Law"]["allOf"] = [_law_rule(name, known) for name in sorted({table.name for table in LAWS.values()})]
    schema["if"], schema["then"] = _law_without_a_name()
    known["Requirement"]["oneOf"] = [_only(bound) for bound in BOUNDS]
    schema["properties"]["extends"]["description"] = "Scenario this one starts from: built-in name, or path from here."
    schema["description"] = "A scenario of sil: one test of an attitude controller. Every key has a default."
    first = {"$schema": DRAFT, "title": "sil scenario"}
    return first | {key: value for key, value in schema.items() if key not in ("$defs", *first)} | {"$defs": known}


def text() -> str:
    """The whole of scenario.schema.json."""
    return json.dumps(scenario_schema(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


# -- what pydantic says, said for draft 7 --------------------------------------------------------------------------


def _tidy(schema: Schema) -> None:
    """No titles made of key names, arrays of one kind of items, no siblings of $ref; units in the descriptions."""
    for section in (schema, *schema["$defs"].values()):
        section.pop("title", None)
        for name, property_ in section.get("properties", {}).items():
            property_.pop("title", None)
            if "$ref" in property_:
                section["properties"][name] = {"$ref": property_["$ref"]}
            elif unit := next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), ""):
                property_["description"] = f"[{unit}] {property_.get('description', '')}".strip()
    for part in _parts(schema):
        if "prefixItems" in part:
            part["items"] = part.pop("prefixItems")[0]


def _parts(schema: Any) -> Iterator[Schema]:
    """Every schema inside of this one, itself included."""
    if isinstance(schema, dict):
        yield schema
    for item in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from _parts(item)


def _name_choices(schema: Schema) -> None:
    """The names that the program looks up, so that an editor can offer them."""
    known = schema["$defs"]
    metrics = [f"{name}.{part}" if part else name for name, parts in METRICS.items() for part in parts or ("",)]
    clocks = _either(("lockstep", "realtime"), SCALES)
    law_names = sorted({table.name for table in LAWS.values()})
    for section, key, choices in (
        (schema, "board", _either(BOARDS, r"^((serial|udp)://|/dev/)\S+$")),
        (known["Link"], "url", _either(LINKS, r"^(serial:///?\S+|/dev/\S+|udp://[^\s:]+:\d+)$")),
        (known["Clock"], "mode", clocks),
        (known["Plant"], "kind", _either(list(PLANTS), r"\.py:")),
        (known["Guidance"], "profile", {"enum": list(PROFILES)}),
        (known["Requirement"], "metric", {"enum": metrics}),
        (known["Law"], "name", _either(law_names, r"\.py:")),
    ):
        property_ = section["properties"][key]
        property_.pop("type", None)
        property_ |= choices


def _either(names: tuple[str, ...] | list[str], pattern: str) -> Schema:
    return {"anyOf": [{"enum": list(names)}, {"type": "string", "pattern": pattern}]}


def _shorten(schema: Schema, path: tuple[str | int, ...], name: str) -> None:
    """The section at `path` may be written as the value of its key `name` alone."""
    section = schema
    for part in path[:-1]:
        section = _section(schema, section["properties"][part])
    reference = section["properties"][path[-1]]
    whole = _section(schema, reference)
    short = {key: value for key, value in whole["properties"][name].items() if key not in ("default", "description")}
    section["properties"][path[-1]] = {"anyOf": [short, reference], "description": whole["description"]}


def _section(schema: Schema, reference: Schema) -> Schema:
    found: Schema = schema["$defs"][reference["$ref"].rpartition("/")[2]]
    return found


def _only(bound: str) -> Schema:
    """Exactly this bound is given; null is not given."""
    others = {other: {"type": "null"} for other in BOUNDS if other != bound}
    return {"required": [bound], "properties": {bound: {"not": {"type": "null"}}, **others}}


# -- laws ----------------------------------------------------------------------------------------------------------


def _law_rule(name: str, known: dict[str, Schema]) -> Schema:
    """Where law.name is `name`, the parameters are those of its newest version."""
    versions = {table.version: table for table in LAWS.values() if table.name == name}
    known[f"Params_{name}"] = _params(versions[max(versions)])
    properties: Schema = {"version": {"enum": [*sorted(versions), None]}}
    if len(versions) == 1:
        properties["params"] = {"$ref": f"#/$defs/Params_{name}"}
    return {
        "if": {"properties": {"name": {"const": name}}, "required": ["name"]},
        "then": {"properties": properties},
    }


def _law_without_a_name() -> tuple[Schema, Schema]:
    """(if, then) of the whole file: parameters without a name are those of the law that flies by default.

    Not where the file extends another one, which may name the law.
    """
    nameless = {"type": "object", "not": {"required": ["name"]}}
    condition: Schema = {"required": ["law"], "properties": {"law": nameless, "extends": False}}
    name = Law.model_fields["name"].default
    one = sum(table.name == name for table in LAWS.values()) == 1
    params = {"params": {"$ref": f"#/$defs/Params_{name}"}} if one else {}
    return condition, {"properties": {"law": {"properties": params}}}


def _params(table: LawTable) -> Schema:
    defaults = laws.complete(table, {})
    properties = {}
    for param in laws.params_of(table):
        word = param.words[0]
        about = word.about.removesuffix(", x") + _of_null(word)
        properties[param.name] = {
            **_shape(param),
            "default": defaults[param.name],
            "description": f"[{word.unit}] {about}" if word.unit else about,
        }
    about = f"Parameters of law {table.name}, version {table.version}."
    return {"description": about, "type": "object", "properties": properties, "additionalProperties": False}


def _of_null(word: Word) -> str:
    """What null means there, if it may be."""
    if word.default == AUTOMATIC:
        return "; null: as many as fit"
    return "; null: no limit" if math.isinf(word.maximum) else ""


def _shape(param: laws.Param) -> Schema:
    """One number, one or three, a list, or a list of rows."""
    word = param.words[0]
    if not param.shape:
        return _one_or_three(word) if len(param.words) == 3 else _value(word)
    schema = _value(word)
    for _, most in reversed(param.shape):
        schema = {"type": "array", "items": schema, "maxItems": most}
    return schema


def _one_or_three(word: Word) -> Schema:
    one = _value(word)
    return {"anyOf": [one, {"type": "array", "items": one, "minItems": 3, "maxItems": 3}]}


def _value(word: Word) -> Schema:
    if word.choices == laws.OFF_ON:
        return {"enum": [True, False, *laws.OFF_ON]}
    if word.choices:
        return {"enum": list(word.choices)}
    whole = word.q == 0 and not word.lsb and word.unit == ""
    kind = "integer" if whole else "number"
    schema: Schema = {"type": kind, "minimum": word.minimum}
    if math.isfinite(word.maximum):
        schema["maximum"] = word.maximum
    if word.default == AUTOMATIC or math.isinf(word.maximum):
        schema["type"] = [kind, "null"]
    return schema


if __name__ == "__main__":
    print(text(), end="")
