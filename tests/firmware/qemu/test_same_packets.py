"""The same packets: a manoeuvre on the image in QEMU and one on the Python board end in the same run.mcap."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from powered import MACHINES

from sil.boards.qemu import QemuBoard
from sil.runner import run_scenario
from sil.scenario import load_scenario
from tools.firmware_image import IMAGES, build

SCENARIOS = ["pd-root-locus", "mrac-rs232", "appc-rs232"]
SETS = ["sensors.attitude.noise_deg=0.02", "duration_s=150", "require=[]", "clock.mode=lockstep"]
CROSS = "arm-none-eabi-"


@pytest.fixture(scope="module")
def python_board(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Any]]:
    """The summary of a scenario on the Python board, flown once."""

    @cache
    def fly(name: str) -> dict[str, Any]:
        folder = tmp_path_factory.mktemp("python") / name
        return run_scenario(load_scenario(name, [*SETS, "board=inproc", "link.url=inproc"]), folder)

    return fly


def fly_in_qemu(name: str, folder: Path) -> dict[str, Any]:
    return run_scenario(load_scenario(name, [*SETS, "board=qemu", "link.url=pty"]), folder)


@pytest.mark.parametrize("chip", MACHINES)
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_manoeuvre_in_qemu_gives_the_python_boards_bytes(monkeypatch, tmp_path, python_board, name, chip):
    """Compiler, start-up, interrupts and UART driver change nothing: 300 ticks with noise, both chips."""
    monkeypatch.setattr(QemuBoard, "options", lambda self, order: ["--chip", chip])
    flown = fly_in_qemu(name, tmp_path / "run")
    assert (flown["ticks"], flown["exit_code"]) == (300, 0), flown
    assert flown["sha256"] == python_board(name)["sha256"]


def test_the_comparison_can_fail(tmp_path, python_board):
    other = load_scenario("pd-root-locus", [*SETS, "board=inproc", "link.url=inproc", "seed=1"])
    assert run_scenario(other, tmp_path / "run")["sha256"] != python_board("pd-root-locus")["sha256"]


@pytest.fixture(scope="module")
def gcc_images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Where CI is set, tools/install-system brings it."""
    if shutil.which(f"{CROSS}gcc") is None:
        said = f"{CROSS}gcc is not here; the images that ship are ziglang's"
        assert "CI" not in os.environ, said
        pytest.skip(said)
    folder = tmp_path_factory.mktemp("gcc")
    return {chip: build(chip, folder, f"CROSS={CROSS}") for chip in MACHINES}


@pytest.mark.parametrize(("name", "chip"), [*((name, "mps2-an386") for name in SCENARIOS), ("mrac-rs232", "stm32f405")])
def test_gccs_images_give_the_same_bytes(monkeypatch, tmp_path, python_board, gcc_images, name, chip):
    """What a compiler may choose freely shows nowhere."""
    image = gcc_images[chip]
    assert image.read_bytes() != (IMAGES / f"{chip}.elf").read_bytes()
    monkeypatch.setattr(QemuBoard, "options", lambda self, order: ["--chip", chip, "--image", str(image)])
    assert fly_in_qemu(name, tmp_path / "run")["sha256"] == python_board(name)["sha256"]
