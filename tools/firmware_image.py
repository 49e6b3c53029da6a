"""The images in firmware/images/: `python -m tools.firmware_image --write` builds them, `--check` compares.

An image is a pure function of its sources and of the compiler, as far as what is loaded goes: an ELF file also holds
what is never loaded, so hashes are of the loadable bytes alone, laid out as `objcopy -O binary` does.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile

FIRMWARE = Path(__file__).parent.parent / "firmware"
IMAGES = FIRMWARE / "images"
CHIPS = ("mps2-an386", "stm32f405")
SOURCES = ("Makefile", "core/*.[ch]", "core/generated/*.[ch]", "hal/cortex-m/*")  # of any image, and hal/CHIP/*
SYMBOLS = ("vectors", "stack_bottom", "stack_top", "boot_record", "the_board", "board_serve")  # what tools look up


def main(argv: list[str] | None = None) -> int:
    """Exit code 1 when --check finds an image older than its sources, or when a build fails."""
    parser = argparse.ArgumentParser(prog="python -m tools.firmware_image", description=__doc__)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", action="store_true", help="build with ziglang, into firmware/images/")
    action.add_argument("--check", action="store_true", help="build with ziglang elsewhere, and compare what is loaded")
    action.add_argument("--size", nargs="+", metavar="ELF", type=Path, help="bytes of code, data and RAM")
    options = parser.parse_args(argv)
    if options.size:
        for path in options.size:
            print(f"{path}: {', '.join(f'{name} {size}' for name, size in sizes(path).items())}")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        made = {chip: entry(chip, build(chip, Path(folder))) for chip in CHIPS}
        if options.write:
            IMAGES.mkdir(exist_ok=True)
            for chip in CHIPS:
                shutil.copyfile(Path(folder) / f"{chip}.elf", IMAGES / f"{chip}.elf")
            (IMAGES / "manifest.json").write_text(json.dumps(made, indent=2) + "\n", encoding="utf-8")
    stale = [chip for chip, shipped in manifest().items() if shipped != made[chip]]
    for chip in stale:
        print(f"firmware/images/{chip}.elf: not what its sources give; renew with `make firmware`", file=sys.stderr)
    return 1 if stale else 0


def build(chip: str, out: Path, *settings: str) -> Path:
    """The chip's ELF, built into `out` by firmware/Makefile; settings: variables of make, such as MAIN=/abs/file.c.

    Raises SystemExit with the compiler's words.
    """
    command = ["make", "-s", "-j2", "-C", str(FIRMWARE), chip, f"OUT={out}", f"PYTHON={sys.executable}", *settings]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise SystemExit(f"firmware: {chip} does not build:\n{made.stdout}{made.stderr}")
    return out / f"{chip}.elf"


def entry(chip: str, elf: Path) -> dict[str, Any]:
    """What the manifest says of one image."""
    version = subprocess.run([sys.executable, "-m", "ziglang", "version"], capture_output=True, text=True, check=True)
    table = symbols(elf)
    return {
        "sources_sha256": sources_sha256(chip),
        "loadable_sha256": hashlib.sha256(loadable(elf)).hexdigest(),
        "compiler": f"ziglang {version.stdout.strip()}",
        "bytes": sizes(elf),
        "symbols": {name: f"0x{table[name]:08x}" for name in SYMBOLS},
    }


def manifest() -> dict[str, dict[str, Any]]:
    """What stands beside the shipped images."""
    found: dict[str, dict[str, Any]] = json.loads((IMAGES / "manifest.json").read_text(encoding="utf-8"))
    return found


def sources_sha256(chip: str) -> str:
    """Of the list of names and hashes that `sha256sum` prints; its first eight digits stand in HELLO's build."""
    patterns = [*SOURCES, f"hal/{chip}/*"]
    names = sorted({path.relative_to(FIRMWARE).as_posix() for text in patterns for path in FIRMWARE.glob(text)})
    lines = [f"{hashlib.sha256((FIRMWARE / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def loadable(elf: Path) -> bytes:
    """Everything that goes into flash, from the lowest load address on, gaps as zeros."""
    with elf.open("rb") as file:
        segments = [
            (segment["p_paddr"], segment.data())
            for segment in ELFFile(file).iter_segments("PT_LOAD")
            if segment["p_filesz"]
        ]
    image, first = bytearray(), min(address for address, _ in segments)
    for address, data in sorted(segments):
        image += bytes(address - first - len(image)) + data
    return bytes(image)


def sizes(elf: Path) -> dict[str, int]:
    """Bytes: text (code and constants), data (in flash and in RAM), bss, stack."""
    with elf.open("rb") as file:
        sections = {section.name: section["sh_size"] for section in ELFFile(file).iter_sections()}
    ram = {"bss": sections[".bss"] + sections[".noinit"], "stack": sections[".stack"]}
    return {"text": sections[".text"], "data": sections.get(".data", 0), **ram}


def symbols(elf: Path) -> dict[str, int]:
    """Every symbol's address; a function's without its Thumb bit."""
    with elf.open("rb") as file:
        table = ELFFile(file).get_section_by_name(".symtab")
        found = [(symbol.name, symbol["st_value"], symbol["st_info"]["type"]) for symbol in table.iter_symbols()]
    return {name: value & ~1 if kind == "STT_FUNC" else value for name, value, kind in found if name}


if __name__ == "__main__":
    sys.exit(main())
