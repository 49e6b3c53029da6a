"""Where a scenario's values come from: a file or a built-in, what it extends, the overrides; merged, with origins."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

from sil.scenario_errors import Path, Problem, ScenarioInvalid, UnknownScenario, Where, one_of, printable, shown
from sil.scenario_yaml import read_mapping, read_value
from sil.scenarios import built_in_file, is_file, list_scenarios

MOST_BYTES = 1_000_000
# Keys that may be written short: `link: udp` is `link: {url: udp}`.
SHORT: dict[Path, str] = {("clock",): "mode", ("link",): "url", ("plant", "disturbance_Nm"): "constant_Nm"}


@dataclass
class Source:
    """Merged plain values, where each was written, and the directory relative paths of each file start from."""

    data: dict[str, Any]
    where: dict[Path, Where]
    directories: dict[str, FilePath] = field(default_factory=dict)
    recorded: bool = False  # plain values, such as those of a log, where a variant has been merged already

    def where_of(self, path: Path) -> Where:
        """Where `path`, or the nearest thing above it, was written."""
        while path and path not in self.where:
            path = path[:-1]
        return self.where.get(path, Where("scenario", 0))

    def directory_of(self, path: Path) -> FilePath:
        """Start of a relative file name written at `path`; for a --set the working directory."""
        return self.directories.get(self.where_of(path).file, FilePath())


def read_scenario(name_or_path: str, sets: Sequence[str]) -> Source:
    """A file or built-in with all it extends, then the overrides; raises ScenarioInvalid."""
    source = _read(name_or_path, FilePath(), [])
    source.data.setdefault("name", _name_of(name_or_path))
    return _override(source, sets)


def from_values(values: dict[str, Any], where: str, directory: FilePath, sets: Sequence[str]) -> Source:
    """Plain values, lists allowed, in place of a file."""
    data = _tuples(values)
    assert isinstance(data, dict)
    return _override(_normal(Source(data, {(): Where(where, 0)}, {where: directory}, recorded=True)), sets)


def _name_of(file: str) -> str:
    """The file's name as a scenario's: `my test (2).yaml` is my-test-2."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", FilePath(file).stem).strip("-_.") or "scenario"


def _read(name_or_path: str, directory: FilePath, chain: list[str]) -> Source:
    file = _find(name_or_path, directory)
    if str(file.resolve()) in chain:
        loop = " -> ".join(FilePath(each).stem for each in (*chain, str(file)))
        raise ScenarioInvalid([Problem(str(file), "extends", "no circle", loop)])
    shown_name = file.name if built_in_file(file.stem) == file else str(file)
    values = read_mapping(_text(file, shown_name), shown_name)
    source = _normal(Source(values.data, values.where, {shown_name: file.parent}))
    base = source.data.pop("extends", None)
    if base is None:
        return source
    place = source.where_of(("extends",))
    if not isinstance(base, str):
        raise ScenarioInvalid([Problem(str(place), "extends", "a scenario's name or path", shown(base), place.line)])
    try:
        below = _read(base, file.parent, [*chain, str(file.resolve())])
    except UnknownScenario as error:
        problem = error.problems[0]
        raise ScenarioInvalid([Problem(str(place), "extends", problem.expected, shown(base), place.line)]) from None
    below.data.pop("name", None)
    below.data.pop("about", None)
    return _merged(below, source)


def _find(name_or_path: str, directory: FilePath) -> FilePath:
    built_in = built_in_file(name_or_path)
    if built_in is not None:
        return built_in
    file = directory / name_or_path
    if is_file(file):
        return file
    raise UnknownScenario(name_or_path, [info.name for info in list_scenarios()])


def _text(file: FilePath, shown_name: str) -> str:
    try:
        if file.stat().st_size > MOST_BYTES:
            raise ScenarioInvalid(
                [Problem(shown_name, "file", f"at most {MOST_BYTES} bytes", str(file.stat().st_size))]
            )
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioInvalid([Problem(shown_name, "file", "readable UTF-8 text", str(error))]) from None


# -- variants ---------------------------------------------------------------------------------------------------------


def _with_variant(source: Source, overlay: Source) -> Source:
    """`source` with the variant that `variant` names merged over it, as a file is over what it extends; the others go.

    A recorded scenario says which variant it was and has no variants, so nothing is merged a second time.
    """
    name = overlay.data.get("variant", source.data.get("variant"))
    variants = source.data.get("variants") or {}
    if name is None or (not variants and "variant" not in overlay.data and source.recorded):
        return source
    place = (overlay if "variant" in overlay.data else source).where_of(("variant",))
    if not isinstance(variants, dict) or not isinstance(name, str) or not isinstance(variants.get(name), dict):
        known = variants if isinstance(variants, dict) else {}
        expected = one_of(known, name) if known else "no variant, since the scenario has no variants"
        raise ScenarioInvalid([Problem(str(place), "variant", expected, shown(name), place.line)])
    at: Path = ("variants", name)
    inside = {path[2:]: where for path, where in source.where.items() if path[:2] == at and len(path) > 2}
    over = _normal(Source(dict(variants[name]), inside))
    rest = {key: value for key, value in source.data.items() if key != "variants"}
    over.data.setdefault("name", f"{rest.get('name', 'scenario')}-{name}")
    over.data["variant"] = name
    return _merged(Source(rest, _without(source.where, ("variants",)), source.directories), over)


def variants_of(name_or_path: str) -> list[tuple[str, str]]:
    """(name, about) of the variants of a scenario file, for a shell; none where it cannot be read."""
    try:
        variants = _read(name_or_path, FilePath(), []).data.get("variants")
    except ScenarioInvalid:
        return []
    known = variants.items() if isinstance(variants, dict) else ()
    return [(name, str(keys.get("about", "")) if isinstance(keys, dict) else "") for name, keys in known]


# -- overrides --------------------------------------------------------------------------------------------------------


def _override(source: Source, sets: Sequence[str]) -> Source:
    overlay = Source({}, {})
    into_lists: list[tuple[Path, Any, Where]] = []
    for text in sets:
        key, equals, value_text = text.partition("=")
        where = Where("--set " + ".".join(printable(part) for part in key.split(".")), 0)
        if not equals or not all(key.split(".")):
            raise ScenarioInvalid([Problem("--set", repr(text), "KEY=VALUE, such as law.form=float", "no KEY=")])
        value = read_value(value_text, where.file)
        path: Path = tuple(int(part) if part.isascii() and part.isdigit() else part for part in key.split("."))
        if any(isinstance(part, int) for part in path):
            into_lists.append((path, value, where))
        else:
            _assign(overlay, path, value, where)
    merged = _merged(_with_variant(source, overlay), _normal(overlay))
    for path, value, where in into_lists:
        merged.data = _replaced(merged.data, path, value, path)
        merged.where = _without(merged.where, path) | {path: where}
    return merged


def _assign(overlay: Source, path: Path, value: Any, where: Where) -> None:
    """overlay.data at `path` becomes `value`, sections on the way are made; a later value replaces an earlier one."""
    section = overlay.data
    if path in SHORT and not isinstance(value, dict):
        path = (*path, SHORT[path])
    for depth, part in enumerate(path[:-1], start=1):
        if not isinstance(section.get(str(part)), dict):
            section[str(part)] = {}
        overlay.where.setdefault(path[:depth], where)
        section = section[str(part)]
    section[str(path[-1])] = value
    overlay.where = _without(overlay.where, path) | dict.fromkeys(_inside(value, path), where)


def _inside(value: Any, path: Path) -> Iterator[Path]:
    """`path` and, where its value is a section, the paths of all keys in it."""
    yield path
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _inside(item, (*path, str(key)))


def _replaced(data: Any, path: Path, value: Any, whole: Path) -> Any:
    """`data` with the item at `path` replaced; `whole` is for the message."""
    if not path:
        return value
    part, rest = path[0], path[1:]
    if isinstance(part, int):
        if not isinstance(data, tuple) or part >= len(data):
            got = f"{len(data)} of them" if isinstance(data, tuple) else shown(data)
            key = ".".join(printable(str(each)) for each in whole)
            raise ScenarioInvalid([Problem(f"--set {key}", key, f"a list with an item {part}", got)])
        return (*data[:part], _replaced(data[part], rest, value, whole), *data[part + 1 :])
    below = data if isinstance(data, dict) else {}
    return {**below, part: _replaced(below.get(part), rest, value, whole)}


# -- merging ----------------------------------------------------------------------------------------------------------


def _normal(source: Source) -> Source:
    """Short forms written out."""
    for path, name in SHORT.items():
        section: Any = source.data
        for part in path[:-1]:
            section = section.get(part) if isinstance(section, dict) else None
        value = section.get(path[-1]) if isinstance(section, dict) else None
        if value is not None and not isinstance(value, dict):
            section[path[-1]] = {name: value}
            source.where[(*path, str(name))] = source.where_of(path)
    return source


def _merged(base: Source, over: Source) -> Source:
    """`over` on `base`, section by section; lists and numbers are replaced. Another law drops the base's params."""
    data, where = base.data, dict(base.where)
    if _law_name(over.data) not in (None, _law_name(data)) and isinstance(data.get("law"), dict):
        data = {**data, "law": {key: value for key, value in data["law"].items() if key not in ("params", "version")}}
        where = _without(where, ("law", "params"))
    replaced = {path for path in over.where if path in where and not isinstance(_at(over.data, path), dict)}
    for path in replaced:
        where = _without(where, path)
    return Source(_deep(data, over.data), where | over.where, base.directories | over.directories)


def _deep(base: Any, over: Any) -> Any:
    if not isinstance(base, dict) or not isinstance(over, dict):
        return over
    return base | {key: _deep(base.get(key), value) for key, value in over.items()}


def _law_name(data: dict[str, Any]) -> Any:
    law = data.get("law")
    return law.get("name") if isinstance(law, dict) else None


def _at(data: Any, path: Path) -> Any:
    for part in path:
        if isinstance(data, dict):
            data = data.get(str(part))
        elif isinstance(data, tuple) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            return None
    return data


def _without(where: dict[Path, Where], path: Path) -> dict[Path, Where]:
    return {each: place for each, place in where.items() if each[: len(path)] != path}


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _tuples(item) for key, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value
