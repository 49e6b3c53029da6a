"""The images that ship are what their sources give, fit the part, and hold nothing of the machine that built them."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from tools.firmware_image import CHIPS, FIRMWARE, IMAGES, build, entry, loadable, manifest, sources_sha256

CODE_MAX, RAM_MAX = 32 * 1024, 128 * 1024


@pytest.fixture(params=CHIPS)
def chip(request) -> str:
    return request.param


def test_an_image_is_of_these_sources(chip):
    """An edit of core or of a chip's hal has to be followed by `make firmware`."""
    assert manifest()[chip]["sources_sha256"] == sources_sha256(chip), "renew with: make firmware"


def test_the_manifest_is_its_images(chip):
    image, shipped = IMAGES / f"{chip}.elf", manifest()[chip]
    assert hashlib.sha256(loadable(image)).hexdigest() == shipped["loadable_sha256"]
    found = entry(chip, image)
    assert (found["bytes"], found["symbols"]) == (shipped["bytes"], shipped["symbols"])


def test_ziglang_builds_the_same_image_again(chip, tmp_path):
    """In another folder; another release of the compiler may choose otherwise. The dev extra names the one."""
    made = entry(chip, build(chip, tmp_path))
    if made["compiler"] != manifest()[chip]["compiler"]:
        said = f"built by {manifest()[chip]['compiler']}, here is {made['compiler']}"
        assert "CI" not in os.environ, said
        pytest.skip(said)
    assert made == manifest()[chip]


def test_an_image_fits_the_part(chip):
    """Code and constants 32 KiB, as promised; RAM with all CONFIG words, and 2 KiB of stack."""
    size = manifest()[chip]["bytes"]
    assert size["text"] + size["data"] <= CODE_MAX
    assert size["data"] + size["bss"] + size["stack"] <= RAM_MAX
    assert size["stack"] == 2048


def test_an_image_names_no_place_on_the_machine_that_built_it(chip):
    data = (IMAGES / f"{chip}.elf").read_bytes()
    for place in (str(FIRMWARE.parent), str(Path.home()), sys.prefix, "ziglang", "/tmp"):
        assert place.encode() not in data, place


def test_an_image_holds_nothing_of_a_compilers_library(chip):
    """memory.c and arithmetic.c stand in for it: every file that has left a symbol is one of firmware/."""
    with (IMAGES / f"{chip}.elf").open("rb") as file:
        table = ELFFile(file).get_section_by_name(".symtab")
        files = {symbol.name for symbol in table.iter_symbols() if symbol["st_info"]["type"] == "STT_FILE"}
    assert "arithmetic.c" in files
    assert files <= {path.name for path in FIRMWARE.rglob("*.c")}
