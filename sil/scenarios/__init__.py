"""The built-in scenarios, package data found by name, and the JSON Schema that they follow."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

DIRECTORY = Path(__file__).resolve().parent
SCHEMA = DIRECTORY / "scenario.schema.json"  # made by `python -m sil.scenario_schema`, kept equal by a test


class ScenarioInfo(NamedTuple):
    """One line of `sil scenarios`."""

    name: str
    about: str


def list_scenarios() -> tuple[ScenarioInfo, ...]:
    """All built-in scenarios in alphabetical order."""
    files = sorted(DIRECTORY.glob("*.yaml"), key=lambda file: file.stem)
    return tuple(ScenarioInfo(file.stem, _about(file)) for file in files)


def built_in_file(name: str) -> Path | None:
    """The file of the built-in scenario `name`, None if there is none of that name."""
    file = DIRECTORY / f"{name}.yaml"
    return file if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name) and is_file(file) else None


def is_file(path: Path) -> bool:
    """A file is there and may be looked at. What no file can be called (too long a name) is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _about(file: Path) -> str:
    """The value of the line `about: ...`."""
    line = re.search(r"^about: *(.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return line.group(1).strip("\"' ") if line else ""
