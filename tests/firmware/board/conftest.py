"""The C board of these tests, built once."""

from __future__ import annotations

from pathlib import Path

import pytest
from c_board import SANITIZERS, CBoard, built, parallel_folder


@pytest.fixture(scope="session")
def build_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return parallel_folder(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="session")
def c_board(build_folder: Path) -> CBoard:
    return CBoard(build_folder)


@pytest.fixture(scope="session")
def sanitized_program(build_folder: Path) -> Path:
    """scripted.c with ASan and UBSan, which end it at the first finding."""
    return built(build_folder, "scripted", SANITIZERS, ["script.c", "scripted.c"])
