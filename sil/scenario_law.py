"""The law's own parameters in a scenario, checked against the table of the law (protocol/law_tables.py).

A triple such as inertia_kgm2 is one key with three numbers here and three words (inertia_kgm2_x, _y, _z) on the wire;
a list or matrix such as A is one key with as many numbers as there are, and words up to its largest size on the wire.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path as FilePath
from typing import Any, NamedTuple

from protocol.law_tables import AUTOMATIC, INT32_MAX, LAWS, LawTable, Word, array_of, elements, user_table
from sil.scenario_errors import Path, Problem, Where, key_of, one_of, shown, unknown_key
from sil.scenario_sections import is_number

UserTable = Callable[[FilePath, str], LawTable]  # (file, class name) -> table; raises ValueError, OSError, SyntaxError
WhereOf = Callable[[Path], Where]
OFF_ON = ("off", "on")


class Param(NamedTuple):
    """One key of law.params: one word, the three words of a triple, or those of a list or matrix."""

    name: str
    words: tuple[Word, ...]
    shape: tuple[tuple[str, int], ...] = ()  # of a list or matrix: what each size is called, and the largest


def is_user_law(name: str) -> bool:
    """./my_law.py:MyLaw"""
    return ".py:" in name


def built_in_table(name: str, version: int | None) -> LawTable | str:
    """The table of a built-in law, newest version if None, or what was expected instead."""
    versions = {table.version: table for table in LAWS.values() if table.name == name}
    if not versions:
        return f"{one_of(sorted({table.name for table in LAWS.values()}), name)}, or ./FILE.py:CLASS"
    if version is not None and version not in versions:
        return f"law.version {', '.join(map(str, sorted(versions)))}"
    return versions[max(versions) if version is None else version]


def table_of_user_law(file: FilePath, name: str) -> LawTable:
    """The table of class `name`, from its PARAMS = {name: (default, unit, lsb)}, read without running the file."""
    for node in ast.parse(file.read_text(encoding="utf-8"), str(file)).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return user_table(name, _params_literal(node))
    raise ValueError(f"no class {name}")


def _params_literal(node: ast.ClassDef) -> dict[str, tuple[float, str, float]]:
    for statement in node.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == "PARAMS" for target in targets):
            value = getattr(statement, "value", None)
            params = ast.literal_eval(value) if value is not None else {}
            return {str(key): (float(default), str(unit), float(lsb)) for key, (default, unit, lsb) in params.items()}
    return {}


def params_of(table: LawTable) -> list[Param]:
    """The keys of law.params in the order of the table."""
    params: list[Param] = []
    words = list(table.params)
    while words:
        if name := array_of(table, words[0]):
            shape = tuple((size, table.sizes[size]) for size in table.arrays[name])
            count = math.prod(most for _, most in shape)
            params.append(Param(name, tuple(words[:count]), shape))
            del words[:count]
            continue
        base = words[0].name.removesuffix("_x")
        triple = tuple(words[:3])
        if [word.name for word in triple] == [f"{base}_{axis}" for axis in "xyz"]:
            params.append(Param(base, triple))
            del words[:3]
        else:
            params.append(Param(words[0].name, (words.pop(0),)))
    return params


def complete(table: LawTable, given: Mapping[str, Any]) -> dict[str, Any]:
    """All parameters with their defaults; null is automatic, or no limit; flags are true and false."""
    params = params_of(table)
    defaults = {param.name: _default(param) for param in params if not param.shape} | _default_arrays(params)
    return {param.name: _normal(param, given.get(param.name, defaults[param.name])) for param in params}


def wire_values(table: LawTable, params: Mapping[str, Any]) -> dict[str, Any]:
    """Complete parameters as protocol.law_tables.config_words() takes them."""
    values: dict[str, Any] = {}
    for param in params_of(table):
        value = params[param.name]
        if value is None and math.isfinite(param.words[0].maximum):
            continue  # automatic
        values[param.name] = math.inf if value is None else value
    return values


def problems(table: LawTable, given: Mapping[str, Any], where_of: WhereOf) -> Iterator[Problem]:
    """What is wrong with law.params: unknown keys, types, ranges."""
    known = {param.name: param for param in params_of(table)}
    for name, value in given.items():
        path: Path = ("law", "params", name)
        place = where_of(path)
        if name not in known:
            yield unknown_key(place, path, known)
        elif expected := _refused(known[name], value):
            yield Problem(str(place), key_of(path), expected, shown(value), place.line)
    yield from _size_problems([param for param in known.values() if param.shape], given, where_of)


def _size_problems(arrays: list[Param], given: Mapping[str, Any], where_of: WhereOf) -> Iterator[Problem]:
    """Lists and matrices that share a size: who gives one of them gives all, and all of the same size."""
    sound = [param for param in arrays if param.name in given and not _refused(param, given[param.name])]
    sizes: dict[str, tuple[int, str]] = {}  # by name: how many, and which key says so
    for param in sound:
        for (name, _), count in zip(param.shape, _lengths(given[param.name], len(param.shape)) or (), strict=False):
            sizes.setdefault(name, (count, param.name))
    for param in arrays if sizes else ():
        value = given.get(param.name)
        counts = [sizes[name][0] for name, _ in param.shape if name in sizes]
        if param.name in given and (param not in sound or _lengths(value, len(param.shape)) == tuple(counts)):
            continue
        path: Path = ("law", "params", param.name)
        place, first = where_of(path), sizes[param.shape[0][0]][1]
        numbers = " rows of ".join(map(str, counts)) + " numbers"
        expected = numbers if first == param.name else f"{numbers}, as {first} has"
        got = shown(value) if param.name in given else "nothing"
        yield Problem(str(place), key_of(path), expected, got, place.line)


def _lengths(value: Any, depth: int) -> tuple[int, ...] | None:
    """(rows, numbers in each) of what _refused() lets pass; None: the rows differ. An empty matrix is 0 x 0."""
    if depth == 1 or not value:
        return (len(value),) * depth
    inner = {_lengths(item, depth - 1) for item in value}
    return (len(value), *only) if len(inner) == 1 and (only := inner.pop()) is not None else None


def _refused(param: Param, value: object) -> str | None:
    """What was expected, or None if the value will do."""
    word = param.words[0]
    if param.shape:
        most = " rows of ".join(str(n) for _, n in param.shape)
        return None if _fits(param, value) else f"at most {most} numbers {_range(word)}"
    if value is None and (word.default == AUTOMATIC or math.isinf(word.maximum)):
        return None
    if len(param.words) == 3:
        items = value if isinstance(value, tuple | list) else (value,) * 3
        fits = len(items) == 3 and not any(_bad(w, item) for w, item in zip(param.words, items, strict=True))
        return None if fits else f"3 numbers {_range(word)}"
    return _expected(word, value) if _bad(word, value) else None


def _fits(param: Param, value: object) -> bool:
    """A list or matrix of good numbers, not larger than it may be."""
    found = elements(value, len(param.shape))
    if found is None or any(_bad(param.words[0], number) for number in found.values()):
        return False
    return all(i <= most for index in found for i, (_, most) in zip(index, param.shape, strict=True))


def _bad(word: Word, value: object) -> bool:
    if word.choices == OFF_ON:
        return not (isinstance(value, bool) or value in OFF_ON)
    if word.choices:
        return value not in word.choices
    if not is_number(value):
        return True
    number = float(value)  # type: ignore[arg-type]
    whole = word.q == 0 and not word.lsb and word.unit == ""
    return not word.minimum <= number <= min(word.maximum, _most(word)) or (whole and number != round(number))


def _most(word: Word) -> float:
    """The largest value 32 bits hold where the scale is fixed."""
    return math.inf if isinstance(word.q, str) else INT32_MAX * (word.lsb or math.ldexp(1.0, -word.q))


def _expected(word: Word, got: object) -> str:
    if word.choices == OFF_ON:
        return "true or false"
    if word.choices:
        return one_of(word.choices, got)
    return f"a number {_range(word)}"


def _range(word: Word) -> str:
    most = min(word.maximum, _most(word))
    text = f"from {word.minimum:g} to {most:g}" if math.isfinite(most) else f"from {word.minimum:g}"
    return f"{text} {word.unit}".rstrip() + (", or null" if math.isinf(word.maximum) else "")


def _default_arrays(params: list[Param]) -> dict[str, Any]:
    """Defaults of lists and matrices by name, without the zeros with which all that share a size are filled up."""
    found: dict[str, dict[tuple[int, ...], float]] = {}
    sizes: dict[str, int] = {}
    for param in params:
        indices = product(*(range(1, most + 1) for _, most in param.shape)) if param.shape else ()
        found[param.name] = dict(zip(indices, (word.default for word in param.words), strict=False))
        for index, number in found[param.name].items():
            for (size, _), i in zip(param.shape, index, strict=True):
                sizes[size] = max(sizes.get(size, 0), i if number else 0)
    arrays = [param for param in params if param.shape]
    return {param.name: _nested(found[param.name], [sizes[size] for size, _ in param.shape]) for param in arrays}


def _nested(numbers: Mapping[tuple[int, ...], float], shape: list[int], at: tuple[int, ...] = ()) -> Any:
    """The numbers by their places as a list, or a list of rows."""
    if len(at) == len(shape):
        return numbers[at]
    return [_nested(numbers, shape, (*at, i)) for i in range(1, shape[len(at)] + 1)]


def _default(param: Param) -> Any:
    values = [None if word.default == AUTOMATIC else word.default for word in param.words]
    return values[0] if len(values) == 1 else values


def _normal(param: Param, value: Any) -> Any:
    word = param.words[0]
    if param.shape:
        return _floats(value)
    if len(param.words) == 3:
        return tuple(float(item) for item in (value if isinstance(value, tuple | list) else (value,) * 3))
    if value is None or value == math.inf:
        return None
    if word.choices == OFF_ON:
        return value == "on" if isinstance(value, str) else bool(value)
    if word.choices:
        return value if isinstance(value, str) else word.choices[int(value)]
    return int(value) if word.q == 0 and not word.lsb else float(value)


def _floats(value: Any) -> Any:
    return tuple(map(_floats, value)) if isinstance(value, tuple | list) else float(value)
