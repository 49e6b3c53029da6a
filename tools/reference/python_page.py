"""docs/reference/python.md: what a script, a law, a plant or a new part of the product sees, with signatures and units.

Read from the sources, so docstrings, annotations and the remarks behind fields appear as they stand there.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tools.spec_tables import table

REPO = Path(__file__).resolve().parents[2]
WIDE = 88  # a longer signature has a line for each parameter
HEAD = """# Python

Made by `python -m tools.reference --write` of the sources; a test keeps it current. `help(sil.open_run)` says the same.

`Array` is a numpy array, `Vector` one of float64; N is the number of ticks. Axes x, y, z are the body's (roll, pitch,
yaw). `q_BN` is scalar first and maps body to inertial components, v_N = q v_B q\\* (Hamilton product).
"""
# Heading, what is said under it, and where each thing is defined.
CHAPTERS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    (
        "From a script or a notebook",
        "`import sil` is all that a script needs; how: [read a run and its logs](../how-to/read-logs.md).",
        (
            "sil:run",
            "sil:open_run",
            "sil.runs:Run",
            "sil.runs:EventRow",
            "sil.runs:PacketRow",
            "sil.trouble:SilError",
            "sil.scenario_errors:ScenarioInvalid",
            "sil.runs:RunError",
        ),
    ),
    (
        "A law of your own",
        "A class in a file, with `PARAMS`, `init(params)` and `step(sample)`; how: [a law of your own]"
        "(../how-to/own-law.md).",
        ("firmware_sim.controllers.user:LawSample",),
    ),
    (
        "A plant of your own",
        "A class in a file, with `from_scenario(scenario)` and what `Plant` says; how: [a plant of your own]"
        "(../how-to/own-plant.md).",
        ("sil.signals:Motion", "sil.signals:Plant"),
    ),
    (
        "Parts of the product",
        "What a new sensor, actuator, law, link or board's hardware has to be; where to register it: "
        "[architecture](../ARCHITECTURE.md).",
        (
            "sil.signals:Sensor",
            "sil.signals:Observer",
            "sil.signals:Actuator",
            "firmware_sim.controllers:Law",
            "protocol.link:Link",
            "firmware_sim.hal:Hal",
        ),
    ),
)


class Source(NamedTuple):
    """Something that is defined in a module: where, its node, and the lines of its file."""

    module: str
    node: ast.ClassDef | ast.FunctionDef
    lines: list[str]

    @property
    def name(self) -> str:
        """With its module, such as sil.open_run."""
        return f"{self.module}.{self.node.name}"


def markdown() -> str:
    """The whole page."""
    parts = [HEAD]
    for heading, about, places in CHAPTERS:
        parts += [f"## {heading}\n\n{about}\n", *(part for place in places for part in _entry(found(place)))]
    return "\n".join(parts)


def found(place: str) -> Source:
    """`module:Name` as it is defined there, or where this module has it from; raises LookupError."""
    module, _, name = place.partition(":")
    path = REPO.joinpath(*module.split("."))
    text = (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text(encoding="utf-8")
    for node in ast.parse(text).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            return Source(module, node, text.splitlines())
        if isinstance(node, ast.ImportFrom) and any(each.name == name for each in node.names):
            return found(f"{node.module}:{name}")._replace(module=module)
    raise LookupError(f"{place}: no such thing; what the page shows stands in CHAPTERS of {__file__}")


def _entry(source: Source) -> Iterator[str]:
    node = source.node
    yield f"### {source.name}\n"
    if isinstance(node, ast.FunctionDef):
        yield f"```python\n{_signature(source.name, node)}\n```\n\n{_said(node)}\n"
        return
    bases = ", ".join(ast.unparse(base) for base in node.bases)
    yield f"```python\nclass {source.name}{f'({bases})' if bases else ''}\n```\n\n{_said(node)}\n"
    if rows := [*_fields(source), *_properties(node)]:
        yield table(("name", "type", "meaning"), rows)
    for method in _methods(node):
        yield f"```python\n{_signature(method.name, method)}\n```\n\n{_said(method)}\n"


def _fields(source: Source) -> Iterator[tuple[str, str, str]]:
    """Annotated names of a class, with the remark behind each."""
    for node in source.node.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            remark = re.search(r"  # (.*)$", source.lines[node.lineno - 1])
            yield f"`{node.target.id}`", _type(node.annotation), _cell(remark[1]) if remark else ""


def _properties(node: ast.ClassDef) -> Iterator[tuple[str, str, str]]:
    for each in _public(node):
        if _is_property(each) and each.returns is not None:
            yield f"`{each.name}`", _type(each.returns), _cell(_said(each))


def _methods(node: ast.ClassDef) -> list[ast.FunctionDef]:
    """Public methods that say something; properties stand in the table."""
    return [each for each in _public(node) if not _is_property(each) and ast.get_docstring(each)]


def _public(node: ast.ClassDef) -> list[ast.FunctionDef]:
    return [each for each in node.body if isinstance(each, ast.FunctionDef) and not each.name.startswith("_")]


def _is_property(node: ast.FunctionDef) -> bool:
    return any(ast.unparse(each) in ("property", "cached_property") for each in node.decorator_list)


def _signature(name: str, node: ast.FunctionDef) -> str:
    """`name(parameters) -> result`, without self."""
    node.args.args = [each for each in node.args.args if each.arg not in ("self", "cls")]
    result = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
    parameters = _parameters(node.args)
    one_line = f"{name}({', '.join(parameters)}){result}"
    if len(one_line) <= WIDE:
        return one_line
    return f"{name}(\n{''.join(f'    {each},{chr(10)}' for each in parameters)}){result}"


def _parameters(arguments: ast.arguments) -> list[str]:
    """Each parameter with its annotation and default; commas inside brackets do not part them."""
    given = re.split(r", (?![^\[]*\])", ast.unparse(arguments)) if ast.unparse(arguments) else []
    return [re.sub(r"^(\w+: [^=]*)=", r"\1 = ", each) for each in given]


def _type(annotation: ast.expr) -> str:
    return f"`{ast.unparse(annotation)}`".replace("|", "\\|")


def _said(node: ast.ClassDef | ast.FunctionDef) -> str:
    """Its docstring, in which an asterisk is an asterisk; indented lines and `these` are code, tables are tables."""
    parts = re.split(r"(`[^`]*`|^    .*$)", ast.get_docstring(node) or "", flags=re.MULTILINE)
    return "".join(part if index % 2 else part.replace("*", "\\*") for index, part in enumerate(parts))


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
