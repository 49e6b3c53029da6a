"""Fuzzers of everything that reads what others wrote: `python -m tools.fuzz [--minutes 10] [TARGET...]`.

Targets in C run under libFuzzer with ASan and UBSan where there is a clang, else under a driver of our own; targets in
Python under atheris where it is installed (`pip install atheris`), else under mutation alone. What was found once stays
in tests/fuzz/corpus, and a test runs it again.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from random import Random
from typing import Protocol

from sil.pil import library

REPO = Path(__file__).resolve().parents[2]
CORPUS = REPO / "tests" / "fuzz" / "corpus"
BOARD_TESTS = REPO / "tests" / "firmware" / "board"  # the scripted board, in C and in Python

IN_C: dict[str, str] = {
    "decoder": "C: any bytes through the decoders and COBS, however they are cut",
    "packet": "C: any packet, with a right CRC, through all checks; CONFIG in parts",
    "board": "C: a board hears frames, noise and time in any order",
    "flight": "C: each law with any words and readings",
}
IN_PYTHON: dict[str, str] = {
    "stream": "tools.fuzz.stream:Stream",
    "twins": "tools.fuzz.twins:Twins",
    "scenario": "tools.fuzz.scenario:ScenarioFile",
    "log": "tools.fuzz.log:Log",
}
# Modules whose coverage guides atheris; never one that numba compiles.
GUIDED_BY: dict[str, tuple[str, ...]] = {
    "stream": ("protocol.frames", "protocol.codec", "cobs"),
    "twins": ("protocol.frames", "protocol.codec", "protocol.port", "protocol.config"),
    "scenario": ("yaml", "sil.scenario_yaml", "sil.scenario_source", "sil.scenario_validation", "sil.scenario_law"),
    "log": ("mcap", "sil.mcap_file", "sil.sinks.journal", "sil.sinks.seal", "sil.runs"),
}


class Finding(Exception):
    """What must not be."""


def expect(condition: object, said: str) -> None:
    """Raises Finding."""
    if not condition:
        raise Finding(said)


def expect_lines(error: Exception, count: int = 1) -> None:
    """A refusal of that many lines at most, and of one at least."""
    lines = str(error).splitlines()
    expect(0 < len(lines) <= count, f"{type(error).__name__} of {len(lines)} lines: {str(error)[:300]!r}")


class Target(Protocol):
    """A target in Python. `check` raises on a finding; what it lets pass is right, or rightly refused."""

    about: str

    def seeds(self) -> list[bytes]: ...

    def mutate(self, data: bytes, random: Random) -> bytes: ...

    def check(self, data: bytes) -> None: ...


def load(name: str) -> Target:
    """The Python target of this name."""
    module, _, attribute = IN_PYTHON[name].partition(":")
    target: Target = getattr(importlib.import_module(module), attribute)()
    return target


def build_folder() -> Path:
    """Where what is compiled for the fuzzers lies, named by a hash of its sources."""
    return library.cache_directory() / "fuzz"


def with_board_tests() -> None:
    """Makes c_board.py and hostile.py importable: the differential targets are made of them."""
    if str(BOARD_TESTS) not in sys.path:
        sys.path.insert(0, str(BOARD_TESTS))
