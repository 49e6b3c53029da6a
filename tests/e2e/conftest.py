"""Fixtures of the end-to-end tests (subprocesses.py)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from subprocesses import Cli


@pytest.fixture
def cli(tmp_path: Path) -> Cli:
    return Cli(tmp_path)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """recorded("mrac-rs232", "--set", ...): the run directory of a run that is made once a session."""
    made: dict[tuple[str, ...], Path] = {}

    def run(*arguments: str) -> Path:
        if arguments not in made:
            folder = tmp_path_factory.mktemp("run")
            Cli(folder)("run", *arguments, "--clock", "lockstep", "--out", "it")
            made[arguments] = folder / "it"
        return made[arguments]

    return run
