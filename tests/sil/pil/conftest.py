"""A firmware that misbehaves on command, built once a session with the compiler of the dev extra."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from provoked import Provoked

from sil.pil.image import Image, load_image
from sil.pil.machine import Machine
from tools.firmware_image import build


@pytest.fixture(scope="session")
def provoked_image(tmp_path_factory: pytest.TempPathFactory) -> Image:
    source = Path(__file__).with_name("provoked.c")
    return load_image(build("mps2-an386", tmp_path_factory.mktemp("provoked"), f"MAIN={source}"))


@pytest.fixture
def provoked(provoked_image: Image) -> Iterator[Provoked]:
    told: list[str] = []
    machine = Machine(provoked_image, told.append)
    assert machine.power_on() == b"boot"
    yield Provoked(machine, told)
    machine.close()
