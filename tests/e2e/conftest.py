"""Fixtures of the end-to-end tests (subprocesses.py)."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from cables import Cable
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


@pytest.fixture
def cable() -> Iterator[Cable]:
    """A cable with a real controller process on it."""
    joined = Cable()
    command = [sys.executable, "-P", "-m", "firmware_sim", "--link", f"serial://{joined.board}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as board:
        assert board.stdout is not None
        assert board.stdout.readline().startswith(b"listening")
        joined.start()
        yield joined
        board.terminate()
    joined.close()
