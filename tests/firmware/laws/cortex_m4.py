"""An image's own law code run on an emulated Cortex-M4: episode.c beside it in RAM calls the laws by their address."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

import c_build
import numpy as np
from episodes import Episode

from protocol.law_tables import law_by_name
from sil.pil.engine import Engine
from sil.pil.image import FLASH, FLASH_SIZE, RAM, RAM_SIZE, Image

HARNESS, BUFFERS = RAM + 0x100000, RAM + 0x140000  # unused by the image: its stack and the_board come first
STACK = RAM + 0x100000
MOST = RAM + RAM_SIZE - BUFFERS
OPTIONS = ["-target", "thumb-freestanding-eabi", "-mcpu=cortex_m4", "-fno-sanitize=all", "-std=c11", "-O2"]
OPTIONS += ["-ffreestanding", "-fno-builtin", "-fno-unwind-tables", "-nostdlib", "-Wl,-e,run_episode"]
SCRIPT = f"""SECTIONS {{
    . = {HARNESS:#x};
    .text : {{ *(.text.run_episode) *(.text*) *(.rodata*) *(.data*) }}
    .bss : {{ *(.bss*) }}
    /DISCARD/ : {{ *(.ARM*) *(.comment*) }}
}}
"""
UNDER_TEST = ("law_find", "reference_init", "reference_advance", "reference_words")


class CortexM4:
    """The image's memory, and episode.c compiled to stand beside it."""

    def __init__(self, image: Image, directory: Path) -> None:
        self.engine, self._image = Engine(), image
        self.engine.map_rom(FLASH, FLASH_SIZE)
        self.engine.map_ram(RAM, RAM_SIZE)
        for address, data in (*image.segments, *_harness(directory)):
            self.engine.write(address, data)

    def run(self, episodes: Sequence[Episode]) -> Iterator[bytes]:
        """What it recorded of each; as comparison.run()."""
        for episode in episodes:
            yield self._run(episode)

    def _run(self, episode: Episode) -> bytes:
        table, at = law_by_name(episode.law), BUFFERS
        places = []
        for array in (episode.common, episode.params, episode.inp):
            self.engine.write(at, array.tobytes())
            places.append(at)
            at += array.nbytes
        at += -at % 8
        functions = [self._image.symbols[name][0] | 1 for name in UNDER_TEST]
        call = struct.pack("<11I", *functions, table.law_id, table.version, *places, len(episode.inp), at)
        self.engine.write(HARNESS - len(call), call)
        size = self._call(HARNESS - len(call))
        assert size <= MOST - (at - BUFFERS)
        return self.engine.read(at, size) if size else b""

    def _call(self, argument: int) -> int:
        """run_episode(argument), which returns to an address where a WFI ends the run."""
        end = HARNESS - 0x100
        self.engine.write(end, b"\x30\xbf")  # WFI
        self.engine.write_registers([argument, 0, 0, 0, 0, end | 1, 0, 1 << 24, STACK - 0x200])
        error = self.engine.run(HARNESS)
        registers = self.engine.read_registers()
        where = registers[Engine.REGISTERS.index("pc")]
        assert error == 0 and where == end + 2, f"{self.engine.reason(error)} at {self._image.place(where)}"
        return registers[0]


def _harness(directory: Path) -> list[tuple[int, bytes]]:
    """episode.c as loadable pieces."""
    from elftools.elf.elffile import ELFFile

    script, out = directory / "episode.ld", directory / "episode.elf"
    script.write_text(SCRIPT)
    chip = c_build.CORE.parent / "hal" / "cortex-m"
    command = [*c_build.zig(), *OPTIONS, f"-I{c_build.CORE}", f"-I{chip}", f"-I{c_build.HERE}"]
    command += [str(c_build.HERE / "episode.c"), str(chip / "memory.c"), f"-Wl,-T,{script}", "-o", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with out.open("rb") as stream:
        elf = ELFFile(stream)
        assert elf.header["e_entry"] == HARNESS | 1
        return [(s["p_paddr"], s.data()) for s in elf.iter_segments() if s["p_type"] == "PT_LOAD" and s["p_filesz"]]


def count_instructions(code: bytes) -> int:
    """Thumb instructions of a straight piece of code."""
    halves = np.frombuffer(code, "<u2")
    count = at = 0
    while at < len(halves):
        at += 2 if halves[at] >> 11 in (0b11101, 0b11110, 0b11111) else 1
        count += 1
    return count
