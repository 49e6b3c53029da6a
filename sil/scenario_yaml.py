"""YAML in, plain values with the file and line of every key out.

YAML 1.2 scalars: 1e-4 is a number, `on` and `yes` are texts, 1:30 is a text. A key given twice, an alias cycle and a
tag are errors. Lists become tuples.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import yaml

from sil.scenario_errors import Path, Problem, ScenarioInvalid, Where, key_of

MOST_LEVELS = 12
MOST_VALUES = 100_000  # an alias stands for all that it names, so a short text may mean many
MOST_DIGITS = 400  # a longer number is text: no key takes it, and Python refuses it
NUMBER_INT = re.compile(r"[-+]?[0-9]+|0x[0-9a-fA-F]+|0o[0-7]+")
NUMBER_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
NOT_FINITE = {".inf": float("inf"), "+.inf": float("inf"), "-.inf": -float("inf"), ".nan": float("nan")}
WORDS: dict[str, Any] = {"null": None, "~": None, "": None, "true": True, "false": False}


@dataclass
class Values:
    """Plain values (dict, tuple, str, int, float, bool, None) and where each path was written."""

    data: dict[str, Any]
    where: dict[Path, Where] = field(default_factory=dict)


def read_mapping(text: str, file: str) -> Values:
    """The mapping a scenario file holds; raises ScenarioInvalid."""
    node = _compose(text, file)
    values = Values({})
    if node is None:
        return values
    if not isinstance(node, yaml.MappingNode):
        raise ScenarioInvalid([Problem(f"{file}:1", "scenario", "a mapping of keys", _kind(node), 1)])
    values.data = _plain(node, (), file, values.where)
    return values


def read_value(text: str, where: str) -> Any:
    """The value behind the = of a --set."""
    node = _compose(text, where)
    return None if node is None else _plain(node, (), where, {})


class _Loader(yaml.BaseLoader):
    """Gives up on a nesting that no scenario has, instead of trying out how far Python recurses."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth += 1
        if self._depth > 4 * MOST_LEVELS:
            raise RecursionError
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


def _compose(text: str, file: str) -> yaml.Node | None:
    try:
        node: yaml.Node | None = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        reason = " ".join(part for part in (error.context, error.problem) if part)
        raise ScenarioInvalid([Problem(_place(file, line), "YAML", "valid YAML", reason, line)]) from None
    except yaml.YAMLError as error:
        raise ScenarioInvalid([Problem(file, "YAML", "valid YAML", " ".join(str(error).split()))]) from None
    except RecursionError:
        line = _too_deep(text)
        expected = f"at most {MOST_LEVELS} levels"
        raise ScenarioInvalid([Problem(_place(file, line), "YAML", expected, "a deeper nesting", line)]) from None
    return node


def _too_deep(text: str) -> int:
    """The line where the first value stands that is more than MOST_LEVELS deep."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.BaseLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_LEVELS:
            return event.start_mark.line + 1 if event.start_mark else 1
    return 1


def _plain(node: yaml.Node, path: Path, file: str, where: dict[Path, Where]) -> Any:
    if len(path) > MOST_LEVELS:
        got = "a deeper nesting or an alias cycle"
        raise ScenarioInvalid([_problem(node, path, file, f"at most {MOST_LEVELS} levels", got)])
    if len(where) > MOST_VALUES:
        expected = f"at most {MOST_VALUES} values"
        raise ScenarioInvalid([_problem(node, path[:1], file, expected, "more, aliases written out")])
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, path, file, where)
    where[path] = _where(node, file)
    if isinstance(node, yaml.SequenceNode):
        return tuple(_plain(item, (*path, index), file, where) for index, item in enumerate(node.value))
    assert isinstance(node, yaml.ScalarNode)
    if node.tag != "tag:yaml.org,2002:str":
        raise ScenarioInvalid([_problem(node, path, file, "a plain value", f"the tag {node.tag}")])
    return node.value if node.style else _scalar(node.value)


def _mapping(node: yaml.MappingNode, path: Path, file: str, where: dict[Path, Where]) -> dict[str, Any]:
    where.setdefault(path, _where(node, file))
    plain: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = key_node.value if isinstance(key_node, yaml.ScalarNode) else repr(key_node.value)
        here = (*path, key)
        if key in plain:
            before = where[here].line
            raise ScenarioInvalid(
                [_problem(key_node, here, file, "each key once", f"it again (first in line {before})")]
            )
        plain[key] = _plain(value_node, here, file, where)
        where[here] = _where(key_node, file)
    return plain


def _scalar(text: str) -> Any:
    if text in WORDS:
        return WORDS[text]
    if NUMBER_INT.fullmatch(text) and len(text) <= MOST_DIGITS:
        return int(text, 0) if text[:2] in ("0x", "0o") else int(text)
    if NUMBER_FLOAT.fullmatch(text):
        return float(text)
    return NOT_FINITE.get(text.lower(), text)


def _where(node: yaml.Node, file: str) -> Where:
    return Where(file, 0 if file.startswith("--set") else node.start_mark.line + 1)


def _place(file: str, line: int) -> str:
    return file if file.startswith("--set") else f"{file}:{line}"


def _problem(node: yaml.Node, path: Path, file: str, expected: str, got: str) -> Problem:
    line = node.start_mark.line + 1
    return Problem(_place(file, line), key_of(path), expected, got, line)


def _kind(node: yaml.Node) -> str:
    return "a list" if isinstance(node, yaml.SequenceNode) else f"the text {node.value!r}"
