"""Images that are damaged, of another chip, or none at all: one line with file and remedy, never a traceback."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest

from sil.pil.image import BUILT_IN, Image, ImageError, load_image

FOR_ANOTHER_CHIP = BUILT_IN.with_name("stm32f405.elf")


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the image that ships, and of its manifest, in its place."""
    for file in (BUILT_IN, BUILT_IN.with_name("manifest.json")):
        shutil.copy(file, tmp_path)
    monkeypatch.setattr("sil.pil.image.BUILT_IN", tmp_path / BUILT_IN.name)
    return tmp_path / BUILT_IN.name


def refusal(path: Path | None) -> str:
    with pytest.raises(ImageError) as refused:
        load_image(path)
    line = str(refused.value)
    assert "\n" not in line
    return line


def test_the_image_that_ships_is_what_its_manifest_says() -> None:
    image = load_image()
    stack, start = image.vectors
    assert stack == image.symbols["stack_top"][0]
    assert image.place(start & ~1).startswith("on_reset+0x0 ")
    assert image.place(0x2000_0000) == "0x20000000"


def test_every_cut_of_the_file_is_refused(shipped: Path) -> None:
    whole = shipped.read_bytes()
    for size in (0, 1, 4, 20, 52, 60, 100, 1000, len(whole) // 2, len(whole) - 1):
        shipped.write_bytes(whole[:size])
        assert refusal(shipped).startswith(f"{shipped}: "), size


def test_a_flipped_bit_in_what_is_loaded_is_found(shipped: Path) -> None:
    whole = bytearray(shipped.read_bytes())
    code = load_image(BUILT_IN).segments[0][1]
    whole[whole.index(code[:64]) + 0x400] ^= 1
    shipped.write_bytes(whole)
    assert "expected sha256 " in refusal(None)
    assert refusal(None).endswith("damaged, build it with `make firmware`")


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"mps2-an386": {}}'])
def test_a_manifest_that_does_not_say(shipped: Path, content: str) -> None:
    shipped.with_name("manifest.json").write_text(content)
    assert "expected the loadable_sha256 of mps2-an386" in refusal(None)
    assert load_image(shipped), "an image that somebody names needs no manifest"


def test_other_files(shipped: Path, tmp_path: Path) -> None:
    text = tmp_path / "image.txt"
    text.write_text("not an image at all, but a text\n" * 4)
    assert refusal(text).startswith(f"{text}: expected an ELF image, got a damaged or another file (")
    assert "expected an image for ARM" in refusal(Path(sys.executable))
    assert "its vectors at 0x0, got one that begins at 0x08000000" in refusal(FOR_ANOTHER_CHIP)
    assert refusal(tmp_path / "none.elf") == f"{tmp_path / 'none.elf'}: no such image: build it with `make firmware`"
    assert "cannot read" in refusal(tmp_path)


def test_without_pyelftools_the_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("elftools", "elftools.elf.elffile", "elftools.common.exceptions"):
        monkeypatch.setitem(sys.modules, name, None)
    assert refusal(None) == "needs pyelftools: pip install 'attitude-sil[pil]'"


@pytest.mark.parametrize(
    ("vectors", "got"),
    [
        ((0, 0x201), "stack 0x00000000"),
        ((0x2000_0800, 0x200), "start 0x00000200"),
        ((0x2000_0800, 0x7000_0001), "start 0x7"),
    ],
)
def test_vectors_that_lead_nowhere(shipped: Path, vectors: tuple[int, int], got: str) -> None:
    whole = bytearray(shipped.read_bytes())
    at = whole.index(load_image(shipped).segments[0][1][:64])
    whole[at : at + 8] = b"".join(word.to_bytes(4, "little") for word in vectors)
    shipped.write_bytes(whole)
    assert got in refusal(shipped)


def test_the_manifest_is_json_with_an_entry_for_each_image() -> None:
    manifest = json.loads(BUILT_IN.with_name("manifest.json").read_text(encoding="utf-8"))
    assert set(manifest) == {file.stem for file in BUILT_IN.parent.glob("*.elf")}


def test_an_address_has_a_name() -> None:
    made = Image(Path("x"), (), {}, ((0x100, 8, "one"), (0x110, 0, "two")), {})
    named = {0xFE: "", 0x100: "one+0x0", 0x107: "one+0x7", 0x108: "", 0x110: "two+0x0", 0x111: ""}
    for address, name in named.items():
        assert made.place(address) == (f"{name} ({address:#010x})" if name else f"{address:#010x}")
