"""docs/reference/scenario.md: every key of a scenario with unit, default, what it may be and what it means.

Made of the JSON Schema (sil/scenario_schema.py), so of the models that check scenarios, and of the laws' tables.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from protocol.law_tables import LAWS, LawTable
from sil.scenario_instruments import Fault
from sil.scenario_law import OFF_ON
from sil.scenario_metrics import METRICS
from sil.scenario_schema import scenario_schema
from sil.scenario_validation import UNITS
from tools.spec_tables import table

HEAD = """# Every key of a scenario

Made by `python -m tools.reference --write` of the models that check a scenario; a test keeps it current. An editor gets
the same from the JSON Schema, `sil schema`, and `sil check` says what a schema cannot: whether keys fit each other.
How to write one: [write a scenario](../how-to/write-a-scenario.md); those that are built in: [scenarios](scenarios.md).

A scenario is one YAML file. Every key has a default unless it says *needed*, so that an empty file is a scenario.
A key's name ends with its unit. Triples are `[x, y, z]` in body axes, angles are Euler angles in `attitude.sequence`.
`a.b` stands for `a: {b: ...}`, `a[].b` for the key `b` of every item of the list `a`; `--set a.b=VALUE` overrides one,
`--set events.0.at_s=5` one in the first item of a list. An unknown key is an error with its line.
"""
COLUMNS = ("key", "unit", "default", "may be", "meaning")
OWN = "The scenario"  # heading of the keys that are in no section
# Models that stand at several places have a table of their own; several models in one: their common keys.
SHARED: dict[str, tuple[str, ...]] = {
    "Faults of an instrument": ("AttitudeFault", "RateFault", "WheelFault"),
    "Sampling of one sensor": ("OwnSampling",),
    "One direction of the link": ("OneWay",),
    "Loss in bursts": ("BurstFault",),
    "Jitter": ("JitterFault",),
}
HEADING_OF = {model: heading for heading, models in SHARED.items() for model in models}

UNIT = re.compile(r"\[([^\],]*)\] ?")  # with which a description begins
PATTERNS = {
    "^scaled:": "`scaled:N`",
    r"\.py:": "`./FILE.py:CLASS`",
    "^(serial": "`/dev/X`, `serial:///dev/X?baud=N`, `udp://HOST:PORT`",
    "^((serial": "`/dev/X`, `serial:///dev/X?baud=N`, `udp://HOST:PORT`",
}
NO_BREAK = "\u00a0"  # a space at which no line ends
LONGEST = 8  # list that is written out as a default

Schema = dict[str, Any]


class Key(NamedTuple):
    """One row: where the key stands, and the schema of its value. `model`: the section it holds, empty: none."""

    path: str
    schema: Schema
    needed: bool
    model: str


def markdown() -> str:
    """The whole page."""
    schema = scenario_schema()
    models = schema["$defs"]
    top = list(_keys("", schema, models))
    sections = [key for key in top if key.model]
    parts = [HEAD, f"## {OWN}\n", _table(top)]
    parts += [part for key in sections for part in _section(key, models)]
    return "\n".join([*parts, *_shared(top, models), *_metrics()])


# -- tables ------------------------------------------------------------------------------------------------------------


def _section(section: Key, models: dict[str, Schema]) -> Iterator[str]:
    yield f"## {section.path.removesuffix('[]')}\n\n{_about(models[section.model])}\n"
    yield _table(list(_below(section, models)))
    if section.path == "law":
        yield "Fractional bits and TELEMETRY of each law: [the wire, section 9](../../protocol/SPEC.md#9-laws).\n"
        yield from (part for law in _newest() for part in _law(law, models))


def _below(section: Key, models: dict[str, Schema]) -> Iterator[Key]:
    """Its keys, and those of the sections in it but for models that have a table of their own."""
    for key in _keys(section.path, models[section.model], models):
        yield key
        if key.model and key.model not in HEADING_OF:
            yield from _below(key, models)


def _law(law: LawTable, models: dict[str, Schema]) -> Iterator[str]:
    yield f"### Parameters of {law.name}\n\n{_flies(law)}\n"
    yield _table(list(_keys("law.params", models[f"Params_{law.name}"], models)))


def _flies(law: LawTable) -> str:
    """When the law may fly, in one paragraph."""
    low, high = law.period_s
    delays = ", ".join(map(str, law.transport_delays))
    form = " Float form only." if law.float_only else ""
    model = "its model goes on" if law.has_model else "it repeats its last command"
    return (
        f"Version {law.version}. `period_s` {low:g} to {high:g}; `transport_delay_ticks` {delays}.{form} "
        f"Without a reading {model}."
    )


def _shared(top: list[Key], models: dict[str, Schema]) -> Iterator[str]:
    places: dict[str, list[str]] = {}
    for key in top:
        for name, path in _places(key, models):
            places.setdefault(HEADING_OF[name], []).append(path)
    for heading, names in SHARED.items():
        about = _about({"description": Fault.__doc__}) if len(names) > 1 else _about(models[names[0]])
        yield f"## {heading}\n\n{about}\n\nStands at {', '.join(f'`{path}`' for path in places[heading])}.\n"
        rows = {(key.path, _about(key.schema)): key for name in names for key in _keys("", models[name], models)}
        yield _table(list(rows.values()))


def _places(key: Key, models: dict[str, Schema]) -> Iterator[tuple[str, str]]:
    """(model, path) of every model with a table of its own, at this key or below."""
    if key.model in HEADING_OF:
        yield key.model, key.path
    for inner in _keys(key.path, models[key.model], models) if key.model else ():
        yield from _places(inner, models)


def _metrics() -> Iterator[str]:
    yield "## Metrics\n\nWhat `require[].metric` may name: the name, a dot, and one of the parts. What each measures: "
    yield "[verdicts and metrics](../concepts/verdicts-and-metrics.md).\n"
    rows = [(f"`{name}`", _unit(name, {}), ", ".join(f"`{part}`" for part in parts)) for name, parts in METRICS.items()]
    yield table(("metric", "unit", "parts"), rows)


def _table(keys: list[Key]) -> str:
    return table(COLUMNS, [_row(key) for key in keys])


def _row(key: Key) -> tuple[str, ...]:
    default = "*needed*" if key.needed else _code(key.schema["default"]) if "default" in key.schema else ""
    may_be = _holds(key) if key.model else _accepted(key.schema)
    unit = _unit(key.path, key.schema).replace(" ", NO_BREAK)
    return f"`{key.path.removesuffix('[]')}`", unit, default, may_be, _about(key.schema)


def _holds(key: Key) -> str:
    """What a key with a section in it may be: a link to the table of its keys, or those that stand below it."""
    name, is_list = key.path.removesuffix("[]"), key.path.endswith("[]")
    heading = HEADING_OF.get(key.model) or ("" if "." in name else name)
    said = f"[{heading}](#{heading.lower().replace(' ', '-')})" if heading else "the keys below"
    others = [_accepted(each) for each in key.schema.get("anyOf", ()) if "$ref" not in each]
    return " or ".join([f"list: {said}" if is_list else said, *others])


# -- what the schema says ----------------------------------------------------------------------------------------------


def _keys(path: str, section: Schema, models: dict[str, Schema]) -> Iterator[Key]:
    for name, schema in section["properties"].items():
        model, is_list = _model(schema)
        about = {"description": models[model]["description"]} if model and not _about(schema) else {}
        at = f"{path}.{name}" if path else name
        yield Key(at + ("[]" if is_list else ""), schema | about, name in section.get("required", ()), model)


def _model(schema: Schema) -> tuple[str, bool]:
    """(the model that a value of this schema holds, whether it is a list of them)."""
    own = next((each["$ref"] for each in (schema, *schema.get("anyOf", ())) if "$ref" in each), "")
    items = schema.get("items", {}).get("$ref", "") if isinstance(schema.get("items"), dict) else ""
    return (own or items).rpartition("/")[2], bool(items)


def _about(schema: Schema) -> str:
    """Its description without the unit, in one line, with the signs that Markdown takes for its own."""
    text = UNIT.sub("", " ".join(schema.get("description", "").split()))
    return re.sub(r"([|*<\[\]])", r"\\\1", text)


def _unit(path: str, schema: Schema) -> str:
    if said := UNIT.match(schema.get("description", "")):
        return said[1]
    name = re.split(r"[.\[]", path.removesuffix("[]"))[-1]
    return next((unit for suffix, unit in UNITS.items() if name.endswith(suffix)), "")


def _accepted(schema: Schema) -> str:
    """What a value may be, in a few words."""
    if "anyOf" in schema:
        one, *others = schema["anyOf"]
        if len(others) == 1 and others[0].get("items") == one:
            return f"{_accepted(one)}; or {others[0]['minItems']} of these"
        return " or ".join(_accepted(each) for each in schema["anyOf"] if "$ref" not in each)
    if "enum" in schema:
        return ", ".join(_code(each) for each in schema["enum"] if each not in OFF_ON or True not in schema["enum"])
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return " or ".join(_of_kind(kind, schema) for kind in kinds)


def _of_kind(kind: str, schema: Schema) -> str:
    if kind in ("number", "integer"):
        return " ".join(filter(None, ("whole number" if kind == "integer" else "number", _range(schema))))
    if kind == "string":
        return next((said for start, said in PATTERNS.items() if schema.get("pattern", "").startswith(start)), "text")
    return _list(schema) if kind == "array" else {"boolean": "`true`, `false`", "null": "`null`"}.get(kind, "mapping")


def _range(schema: Schema) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        return f"{_plain(low)} to {_plain(high)}"
    words = (("from", low), ("above", schema.get("exclusiveMinimum")), ("at most", high))
    words = (*words, ("below", schema.get("exclusiveMaximum")))
    return ", ".join(f"{word} {_plain(value)}" for word, value in words if value is not None)


def _list(schema: Schema) -> str:
    """`3 numbers`, `3 numbers or 3 rows of 3 numbers`, `at most 8 rows of at most 8 numbers -1000 to 1000`."""
    fewest, most = schema.get("minItems"), schema.get("maxItems")
    count = "" if most is None else str(most) if most == fewest else f"at most {most}"
    kinds = schema["items"].get("anyOf", [schema["items"]])
    return " or ".join(f"{count or 'list of'} {_several(kind, count)}" for kind in kinds)


def _several(items: Schema, count: str) -> str:
    if items.get("type") == "array":
        return f"rows of {_list(items)}" if count else f"pairs: {_list(items)}"
    return re.sub(r"^((?:whole )?number)", r"\1s", _accepted(items))


def _code(value: Any) -> str:
    return f"`{_plain(value)}`"


def _plain(value: Any) -> str:
    """As one writes it in YAML; of a long list its ends."""
    if isinstance(value, list | tuple):
        parts = [_plain(item) for item in value]
        return f"[{', '.join(parts if len(parts) <= LONGEST else [*parts[:2], '...', parts[-1]])}]"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "2^64" if value == 2**64 else f"{value:.10g}".replace("e+", "e")
    return value if isinstance(value, str) and value else json.dumps(value)


def _newest() -> list[LawTable]:
    """One table a law, the newest version, in the order of their ids."""
    return list({table.name: table for _, table in sorted(LAWS.items())}.values())
