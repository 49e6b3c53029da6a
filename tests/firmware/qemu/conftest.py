"""Fixtures of the tests in QEMU. All of them need it, and an image of these sources."""

from __future__ import annotations

from pathlib import Path

import pytest
from powered import MACHINES, need_qemu

from tools.firmware_image import build


@pytest.fixture(autouse=True, scope="session")
def qemu() -> None:
    need_qemu()


@pytest.fixture(scope="session")
def accident_image(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """For each chip, the firmware with incidents.c for its main."""
    folder = tmp_path_factory.mktemp("incidents")
    main = f"MAIN={Path(__file__).with_name('incidents.c')}"
    return {chip: build(chip, folder, main) for chip in MACHINES}
