"""A firmware image for the emulated board: found, read from its ELF file, refused where it is not what it should be.

The image that ships with the package is firmware/images/mps2-an386.elf. The manifest beside it says the SHA-256 of what
is loaded (an ELF file holds more, which no two builds agree on), so a damaged one is found before it flies.
"""

from __future__ import annotations

import hashlib
import json
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FLASH, FLASH_SIZE = 0x00000000, 0x400000
RAM, RAM_SIZE = 0x20000000, 0x400000
BUILT_IN = Path(__file__).resolve().parents[2] / "firmware" / "images" / "mps2-an386.elf"
REMEDY = "build it with `make firmware`"
NEEDS = "needs pyelftools: pip install 'attitude-sil[pil]'"
ARM = "EM_ARM"


class ImageError(Exception):
    """An image that cannot be used; one line with the file, what was expected and the remedy."""


@dataclass(frozen=True)
class Image:
    """What is loaded, and what the linker called it. `functions`: (address, size, name) by address, no Thumb bit."""

    path: Path
    segments: tuple[tuple[int, bytes], ...]
    symbols: dict[str, tuple[int, int]]
    functions: tuple[tuple[int, int, str], ...]
    sections: dict[str, int]  # bytes of each that takes memory on the part

    @property
    def vectors(self) -> tuple[int, int]:
        """(initial stack pointer, address of the first instruction), the first two words of flash."""
        first = next(data for address, data in self.segments if address == FLASH)
        return int.from_bytes(first[0:4], "little"), int.from_bytes(first[4:8], "little")

    @property
    def loadable(self) -> bytes:
        """What goes into flash, from its start on, gaps as zeros, as `objcopy -O binary` lays it out."""
        flash = bytearray()
        for address, data in sorted(self.segments):
            flash += bytes(address - FLASH - len(flash)) + data
        return bytes(flash)

    def place(self, address: int) -> str:
        """An address as a person wants it: `mrac_step+0x1c`, or hexadecimal outside of all functions."""
        at = bisect_right(self.functions, (address, 2**32, "")) - 1
        if at >= 0:
            start, size, name = self.functions[at]
            if address < start + max(size, 1):
                return f"{name}+{address - start:#x} ({address:#010x})"
        return f"{address:#010x}"


def load_image(path: Path | None = None) -> Image:
    """The image at `path`; None: the one that ships with the package, held against its manifest. Raises ImageError."""
    file = path or BUILT_IN
    image = _read(file)
    _refuse_foreign(image)
    if path is None:
        _compare_with_manifest(image)
    return image


def _read(file: Path) -> Image:
    try:
        from elftools.common.exceptions import ELFError
        from elftools.elf.elffile import ELFFile
    except ImportError:
        raise ImageError(NEEDS) from None
    try:
        with file.open("rb") as stream:
            return _parsed(file, ELFFile(stream))
    except FileNotFoundError:
        raise ImageError(f"{file}: no such image: {REMEDY}") from None
    except OSError as error:
        raise ImageError(f"{file}: cannot read: {error.strerror}") from None
    except (ELFError, ValueError, LookupError, AttributeError, TypeError) as error:
        # What pyelftools raises on a damaged file depends on where the damage is.
        what = " ".join(str(error).split())[:80] or type(error).__name__
        raise ImageError(f"{file}: expected an ELF image, got a damaged or another file ({what}): {REMEDY}") from None


def _parsed(file: Path, elf: Any) -> Image:
    if elf.header["e_machine"] != ARM or elf.elfclass != 32 or not elf.little_endian:
        got = f"{elf.header['e_machine']}, {elf.elfclass} bits"
        raise ImageError(f"{file}: expected an image for ARM, 32 bits, little endian, got {got}: {REMEDY}")
    loaded = [each for each in elf.iter_segments() if each["p_type"] == "PT_LOAD" and each["p_filesz"]]
    segments = tuple((each["p_paddr"], each.data()) for each in loaded)
    if any(len(data) != each["p_filesz"] for (_, data), each in zip(segments, loaded, strict=True)):
        raise ImageError(f"{file}: the file is cut off: {REMEDY}")
    table = elf.get_section_by_name(".symtab")
    named = [each for each in table.iter_symbols() if each.name] if table is not None else []
    functions = sorted((each["st_value"] & ~1, each["st_size"], each.name) for each in named if _is_function(each))
    return Image(
        file,
        segments,
        {each.name: (each["st_value"] & ~_is_function(each), each["st_size"]) for each in named},
        tuple(functions),
        {each.name: each["sh_size"] for each in elf.iter_sections() if each["sh_flags"] & 2 and each["sh_size"]},
    )


def _is_function(symbol: Any) -> bool:
    return bool(symbol["st_info"]["type"] == "STT_FUNC")


def _refuse_foreign(image: Image) -> None:
    """Not for this machine: its vectors elsewhere, a stack or a start where there is no memory."""
    begins = min((address for address, _ in image.segments), default=None)
    if begins != FLASH:
        got = "nothing to load" if begins is None else f"one that begins at {begins:#010x}"
        raise ImageError(f"{image.path}: expected an image for mps2-an386, its vectors at {FLASH:#x}, got {got}")
    if any(not FLASH <= address <= address + len(data) <= FLASH + FLASH_SIZE for address, data in image.segments):
        raise ImageError(f"{image.path}: expected an image for mps2-an386, got one that loads beyond its flash")
    stack, start = image.vectors
    if not (RAM < stack <= RAM + RAM_SIZE and start & 1 and FLASH <= start < FLASH + FLASH_SIZE):
        got = f"stack {stack:#010x}, start {start:#010x}"
        raise ImageError(f"{image.path}: expected a stack in RAM and Thumb code in flash, got {got}: {REMEDY}")


def _compare_with_manifest(image: Image) -> None:
    """The image that ships is the one that its manifest was written for."""
    file, chip = image.path.with_name("manifest.json"), image.path.stem
    try:
        expected = str(json.loads(file.read_text(encoding="utf-8"))[chip]["loadable_sha256"])
    except (OSError, ValueError, LookupError, TypeError):
        raise ImageError(f"{file}: expected the loadable_sha256 of {chip}, got none: {REMEDY}") from None
    got = hashlib.sha256(image.loadable).hexdigest()
    if got != expected:
        raise ImageError(f"{image.path}: expected sha256 {expected[:16]}..., got {got[:16]}...: damaged, {REMEDY}")
