"""What a check finds (ok, note or problem, and what to do about it), and the machine it looks at."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

OK, NOTE, PROBLEM = "ok", "note", "problem"
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Finding(NamedTuple):
    """One line of the doctor. `check` is filled in by whoever calls the check.

    found: what is so. advice: what to do about it; commands: what to type. lines: more of what was found; raw:
    bytes, never folded. data: the numbers, for programs.
    """

    status: str
    found: str
    advice: str = ""
    commands: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    data: Mapping[str, Any] = NOTHING
    check: str = ""
    raw: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        order = ("check", "status", "found", "advice", "commands", "lines", "raw", "data")
        mine = {**self._asdict(), "data": dict(self.data)}
        return {name: mine[name] for name in order}


@dataclass(frozen=True)
class Surroundings:
    """The machine as the checks see it. `root`: where /proc, /sys and /dev are; a test hands in a tree of its own.

    folder: the working directory, where runs go. search_path: where Python looks for modules.
    """

    root: Path = Path("/")
    folder: Path = field(default_factory=Path.cwd)
    search_path: tuple[str, ...] = field(default_factory=lambda: tuple(sys.path))

    def at(self, path: str) -> Path:
        """`path`, which is absolute, below the root."""
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str:
        """What a small file says, without white space around it; "" when it is not there or not ours to read."""
        try:
            return self.at(path).read_text(errors="replace").strip()
        except OSError:
            return ""

    def number(self, path: str) -> int | None:
        """The same as an integer."""
        try:
            return int(self.text(path))
        except ValueError:
            return None

    def in_container(self) -> bool:
        """Whether this is a container, whose limits are set outside of it."""
        return any(self.at(mark).exists() for mark in ("/.dockerenv", "/run/.containerenv"))


def size_text(count: float) -> str:
    """1536 -> 1.5 KiB"""
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "bytes" or count >= 10 else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.1f} TiB"


def user_name() -> str:
    """Who we are, as usermod and limits.conf want to know it."""
    import pwd

    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())
