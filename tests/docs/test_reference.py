"""docs/reference/ says what the product is now, and all of it: verbs, options, keys, parameters, exports, words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import typer.main
from pydantic import BaseModel

import sil
from protocol.law_tables import LAWS
from sil.cli import app
from sil.scenario import Scenario
from sil.scenario_law import params_of
from tools.reference import PAGES
from tools.reference.__main__ import main

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"


def chapters(page: str) -> dict[str, str]:
    """Text by heading of one page."""
    parts = re.split(r"^#+ (.*)\n", (REFERENCE / page).read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_pages_are_current(capsys: pytest.CaptureFixture[str]) -> None:
    """Renewed by `python -m tools.reference --write`."""
    assert main(["--check"]) == 0, capsys.readouterr().err


def test_a_page_that_is_not_current_is_named(capsys: pytest.CaptureFixture[str], monkeypatch: Any) -> None:
    monkeypatch.setitem(PAGES, "cli.md", lambda: "something else")
    assert main([]) == 1
    assert "docs/reference/cli.md is out of step" in capsys.readouterr().err


# -- the command line ----------------------------------------------------------------------------------------------


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    """Every verb as click has it, by what one types."""
    inner = getattr(command, "commands", {})
    if not inner:
        yield name, command
    for word, each in inner.items():
        yield from commands(f"{name} {word}", each)


VERBS = dict(commands("sil", typer.main.get_command(app)))


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_its_options_examples_and_exit_codes(verb: str) -> None:
    text = chapters("cli.md")[verb]
    for parameter in VERBS[verb].params:
        if parameter.name != "help":
            names = [name for name in parameter.opts if name.startswith("-")] or [parameter.metavar.removesuffix("...")]
            rows = [rf"^\| `[^|]*{re.escape(name)}\b" for name in names]
            assert [row for row in rows if not re.search(row, text, re.MULTILINE)] == []
            assert parameter.help.split("`")[0].replace("*", "\\*") in text
    assert f"\n{verb}" in text and "| exit code | meaning |\n" in text and "Examples:" in text
    assert not re.search(r"\[/?(bold|dim|cyan)?\]|None`", text)


# -- the scenario --------------------------------------------------------------------------------------------------


def keys(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, str]]:
    """(where the section stands, key) of every key in the models that check a scenario; lists as `events[]`."""
    for name, field in model.model_fields.items():
        yield path, name
        inner = section_of(field.annotation)
        if inner is not None:
            mark = "[]" if "tuple" in str(field.annotation) else ""
            yield from keys(inner, f"{path}.{name}{mark}" if path else f"{name}{mark}")


def section_of(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for part in get_args(annotation) if (model := section_of(part)) is not None), None)


def test_every_key_of_a_scenario_is_there() -> None:
    """By its whole path; or, of a section that stands at several places, in a table that names this place."""
    found = chapters("scenario.md")
    whole = "\n".join(found.values())
    shared = [text for text in found.values() if "\nStands at " in text]
    missing = [
        f"{section}.{key}"
        for section, key in keys(Scenario)
        if f"| `{section}.{key}` |".replace("`.", "`", 1) not in whole
        and not any(f"`{section}`" in text and f"| `{key}` |" in text for text in shared)
    ]
    assert missing == []


def test_every_row_says_unit_default_range_and_meaning() -> None:
    text = (REFERENCE / "scenario.md").read_text(encoding="utf-8").replace("\u00a0", " ")
    rows = [re.split(r" (?<!\\)\| ", f" {row} ") for row in re.findall(r"^\| (`.*) \|$", text, re.MULTILINE)]
    rows = [[cell.strip() for cell in row] for row in rows if len(row) == 5]
    assert len(rows) > 200
    units = {"_s": "s", "_deg": "deg", "_Nm": "N m", "_Nms": "N m s", "_kgm2": "kg m^2", "_ms": "ms", "_ticks": "ticks"}
    for key, unit, default, may_be, meaning in rows:
        ending = next((end for end in units if key.endswith(f"{end}`")), "")
        assert may_be and meaning and unit == units.get(ending, unit), key
        assert default or "[" in may_be or "below" in may_be or key in ("`extends`", "`law.params`"), key


@pytest.mark.parametrize("table", LAWS.values(), ids=lambda table: f"{table.name}-{table.version}")
def test_every_parameter_of_every_law_is_there(table: Any) -> None:
    text = chapters("scenario.md")[f"Parameters of {table.name}"]
    assert [each.name for each in params_of(table) if f"| `law.params.{each.name}` |" not in text] == []


# -- Python, words -------------------------------------------------------------------------------------------------


def test_every_export_is_there_with_its_signature() -> None:
    found = chapters("python.md")
    assert [name for name in sil.__all__ if f"sil.{name}(" not in found.get(f"sil.{name}", "")] == []
    assert all("```python" in text for heading, text in found.items() if "." in heading)


def test_the_glossary_is_in_order_and_says_each_word_once() -> None:
    words = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", chapters("glossary.md")["Glossary"], re.MULTILINE)[1:]
    assert len(words) > 40 and words == sorted(set(words))
