"""The file of a run as `sil.runs` reads it: found, checked, its messages as rows; what is wrong with it in one line."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sil import mcap_file
from sil.sinks import layouts

_UNREADABLE = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, struct.error, RecursionError)
_SECTIONS = {"metrics": dict, "guidance": dict, "law": dict, "plant": dict, "sensors": dict, "require": list}
_SHOWN = 200  # characters of what is wrong


class RunError(Exception):
    """The run cannot be read: one line that names the file."""


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Content that is whole by its CRCs and still not what this version writes is a RunError, whatever it led to."""
    try:
        yield
    except _UNREADABLE as error:
        raise RunError(f"{path}: written by another version, or damaged: {repr(error)[:_SHOWN]}") from error


def log_of(folder: Path) -> Path:
    """The log in a run directory. Raises RunError: there is none, or only the journal of one."""
    log = folder / "run.mcap"
    if log.exists():
        return log
    if (folder / "run.journal").exists():
        raise RunError(f"{folder}: no run.mcap yet; `sil recover {folder}` makes it from run.journal")
    raise RunError(f"{folder}: expected a run directory, found neither run.mcap nor run.journal in it")


def read(path: Path, topics: tuple[str, ...]) -> mcap_file.Content:
    """The log with the messages of these topics; every CRC is checked. Raises RunError."""
    try:
        return mcap_file.read(path, topics)
    except OSError as error:
        raise RunError(f"{path}: {error.strerror or error}") from error
    except mcap_file.McapError as error:
        raise RunError(f"{path}: {error}{_remedy(path)}") from error


def _remedy(path: Path) -> str:
    """What to do about a damaged log: its journal may be there still."""
    has_journal = path.name == "run.mcap" and (path.parent / "run.journal").exists()
    return f"; `sil recover {path.parent}` makes it anew from run.journal" if has_journal else ""


def check_sections(scenario: Any) -> None:
    """What a scenario's sections are, so that whoever reads a run may look into them. Raises ValueError."""
    kinds = {key: scenario.get(key) for key in _SECTIONS} if isinstance(scenario, dict) else {"": scenario}
    for key, value in kinds.items():
        if value is not None and not isinstance(value, _SECTIONS.get(key, dict)):
            raise ValueError(f"scenario.json: {key}: expected {_SECTIONS.get(key, dict).__name__}, got {value!r}")


def rows_of(messages: Mapping[str, list[mcap_file.Message]], topic: str, layout: layouts.Layout) -> npt.NDArray[Any]:
    """The messages of a topic as a structured array, in the order of the log."""
    start = len(layouts.CDR_HEADER)
    data = b"".join([message[1][start:] for message in messages.get(topic, ())])
    return np.frombuffer(data, layout.dtype)


def parsed(texts: Mapping[str, str]) -> dict[str, Any]:
    """Metadata values: JSON where they are JSON, else the text itself."""
    result: dict[str, Any] = {}
    for key, value in texts.items():
        try:
            result[key] = json.loads(value)
        except ValueError:
            result[key] = value
    return result
