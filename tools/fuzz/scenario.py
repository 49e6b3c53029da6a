"""Target `scenario`: any text as a scenario file, with overrides: a Scenario or ScenarioInvalid, nothing else."""

from __future__ import annotations

import json
import tempfile
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import yaml

from sil.checks import check as findings_of
from sil.rig import law_orders
from sil.scenario import Scenario, json_schema, load_scenario, load_values
from sil.scenario_errors import ScenarioInvalid
from sil.scenarios import built_in_file, list_scenarios
from sil.trouble import UsageError
from tools.fuzz import expect, expect_lines
from tools.fuzz.mutation import mutated

SEPARATOR = b"\0"  # file, then a --set each
MOST_TICKS = 100_000  # of a scenario that is looked at more closely
ODD: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 0.5, -0.5, 1e-9, 1e9, 1e308, -1e308, 5e-324, 2**31 - 1, 2**31, 2**32, 2**63,
    2**64 - 1, 10**399, -(10**399), float("nan"), float("inf"), "", "a", "on", "A", "pd", "mrac", "appc", "process",
    "a" * 300, "a" * 5000, "../..", "/", "./law.py:Law", "./broken.py:Law", "x.csv", "udp://[::1", "udp://h:99999999",
    "serial://", "\x00", "\ud800", "é", "scaled:0", "scaled:1e3", "lockstep", "loop.yaml", [], {}, [1, 2, 3], [[]],
    [None] * 3, [1e308] * 3, [10**399] * 3, [True, 1, 1], [[1, 0, 0], [0, 1, 0], [0, 0, 1]], {"a": 1}, [{}],
    [1, 0, 0, 0],
)  # fmt: skip
LAWS = {
    "law.py": "class Law:\n    PARAMS = {'gain': (1.0, 'N m', 0.001)}\n",
    "broken.py": "class Law:\n    PARAMS = {'gain': (" + "9" * 400 + ", 'N m', 0.001), 'b': 1}\n",
    "loop.yaml": "extends: loop.yaml\n",
    "x.csv": "t,u1,u2,u3\n",
}


class ScenarioFile:
    """Input: the file's bytes, and behind a NUL each an override."""

    about = "Python: any text as a scenario: a Scenario or ScenarioInvalid"

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-scenario-")
        self._file = Path(self._folder.name) / "s.yaml"
        for name, text in LAWS.items():
            (self._file.parent / name).write_text(text)
        self._paths = _key_paths(json_schema())
        names = [info.name for info in list_scenarios()]
        self._files = [path.read_bytes() for name in names if (path := built_in_file(name)) is not None]
        self._tokens = [key.encode() + b": " for path in self._paths if isinstance(key := path[-1], str)]
        self._tokens += [b"&a ", b"*a", b"<<: ", b"[", b"{", b"- ", b"'", b'"', b"|\n", b"!!binary ", b"? ", b"\n  "]

    def seeds(self) -> list[bytes]:
        own_law, extended = b"law: {name: ./law.py:Law, form: float}\n", b"extends: appc-rs232\0duration_s=60"
        return [*self._files, b"", b"{}", own_law, extended]

    def mutate(self, data: bytes, random: Random) -> bytes:
        """Mostly another value at a key that is known; also bytes."""
        if random.random() < 0.3:
            return mutated(data, random, self._files, self._tokens)
        file, *sets = data.split(SEPARATOR)
        path = random.choice(self._paths)
        value = _odd(random)
        if random.random() < 0.25:
            sets.append((".".join(map(str, path)) + "=" + json.dumps(value)).encode("utf-8", "replace"))
            return SEPARATOR.join([file, *sets[-4:]])
        return SEPARATOR.join([_replaced(file, path, value), *sets])

    def check(self, data: bytes) -> None:
        file, *sets = data.split(SEPARATOR)
        self._file.write_bytes(file)
        try:
            scenario = load_scenario(self._file, [text.decode(errors="replace") for text in sets])
        except ScenarioInvalid as error:
            expect_lines(error, len(error.problems))
            return
        self._look_at(scenario)

    def _look_at(self, scenario: Scenario) -> None:
        """What is accepted loads again as it was resolved, and what a run begins with takes it, or says why not."""
        again = load_values(json.loads(json.dumps(scenario.resolved())), directory=self._file.parent)
        expect(json.dumps(again.resolved()) == json.dumps(scenario.resolved()), "resolved, it loads as another one")
        if scenario.ticks > MOST_TICKS:
            return
        findings_of(scenario)
        if scenario.board != "none":
            try:
                law_orders(scenario)
            except UsageError as error:
                expect_lines(error)


def _key_paths(schema: dict[str, Any]) -> list[tuple[str | int, ...]]:
    """Every key of a scenario, as a path; the items of lists by number."""
    found: list[tuple[str | int, ...]] = []

    def walk(part: dict[str, Any], path: tuple[str | int, ...]) -> None:
        if path:
            found.append(path)
        if len(path) > 6:
            return
        for option in (part, *part.get("anyOf", ()), *part.get("allOf", ())):
            if "$ref" in option:
                option = schema["$defs"][option["$ref"].rpartition("/")[2]]
            for key, below in option.get("properties", {}).items():
                walk(below, (*path, key))
            if isinstance(option.get("items"), dict):
                walk(option["items"], (*path, 0))

    walk(schema, ())
    return found


def _odd(random: Random) -> Any:
    value = random.choice(ODD)
    if random.random() < 0.2:
        return [value, random.choice(ODD), random.choice(ODD)]
    if random.random() < 0.2:
        return round(random.uniform(-3, 3), random.randrange(4))
    return {random.choice(("a", "x", "sine", "url", "mode")): value} if random.random() < 0.05 else value


def _replaced(file: bytes, path: tuple[str | int, ...], value: Any) -> bytes:
    """The file with another value at `path`, as JSON, which is YAML too; unreadable ones are replaced whole."""
    try:
        content = _plain(file)
        content = content if isinstance(content, dict) else {}
        _put(content, path, value)
        return json.dumps(content, default=str).encode("utf-8", "replace")
    except (yaml.YAMLError, ValueError, RecursionError, TypeError):
        made: Any = value
        for part in reversed(path):
            made = [made] if isinstance(part, int) else {part: made}
        return json.dumps(made).encode("utf-8", "replace")


def _plain(file: bytes) -> Any:
    """JSON, if it is that: most of what was mutated before; else YAML, which takes a hundred times longer."""
    try:
        return json.loads(file)
    except ValueError:
        if b"&" in file:
            raise  # few bytes that stand for many
        return yaml.safe_load(file)


def _put(content: dict[Any, Any], path: tuple[str | int, ...], value: Any) -> None:
    section: Any = content
    for part, after in pairwise(path):
        fits = isinstance(section[part], list if isinstance(after, int) else dict) if _has(section, part) else False
        if not fits:
            section[part] = [None] if isinstance(after, int) else {}
        section = section[part]
        if isinstance(section, list) and not section:
            section.append(None)
    section[path[-1]] = value


def _has(section: Any, part: str | int) -> bool:
    return part < len(section) if isinstance(part, int) else part in section
