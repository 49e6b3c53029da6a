"""A processor with memory and no machine around it: for one function of an image, or for all of it among registers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from elftools.elf.elffile import ELFFile
from unicorn import UC_ARCH_ARM, UC_MODE_THUMB, Uc
from unicorn.arm_const import (
    UC_ARM_REG_LR,
    UC_ARM_REG_PC,
    UC_ARM_REG_R0,
    UC_ARM_REG_R1,
    UC_ARM_REG_R2,
    UC_ARM_REG_R3,
    UC_ARM_REG_SP,
    UC_CPU_ARM_CORTEX_M4,
)

from tools.firmware_image import symbols

FLASH_SIZE, RAM, RAM_SIZE = 0x40000, 0x20000000, 0x20000
DONE = 0x10000000  # where a called function returns to
ARGUMENTS = (UC_ARM_REG_R0, UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3)


class Bare:
    """`flash`: where the image's chip has it."""

    def __init__(self, elf: Path, flash: int = 0) -> None:
        self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB)
        self.uc.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M4)
        assert self.uc.ctl_get_cpu_model() == UC_CPU_ARM_CORTEX_M4
        self.uc.mem_map(flash, FLASH_SIZE)
        self.uc.mem_map(RAM, RAM_SIZE)
        self.uc.mem_map(DONE, 0x1000)
        self.symbols = symbols(elf)
        with elf.open("rb") as file:
            for segment in ELFFile(file).iter_segments("PT_LOAD"):
                self.uc.mem_write(segment["p_paddr"], segment.data())

    def call(self, address: int, *words: int) -> tuple[int, int, int, int]:
        """r0 to r3 after the function returns; words: at most four, into r0 to r3."""
        for register, word in zip(ARGUMENTS, words, strict=False):
            self.uc.reg_write(register, word)
        self.uc.reg_write(UC_ARM_REG_SP, self.symbols["stack_top"])
        self.uc.reg_write(UC_ARM_REG_LR, DONE | 1)
        self.uc.emu_start(address | 1, DONE)
        assert self.uc.reg_read(UC_ARM_REG_SP) == self.symbols["stack_top"]
        r0, r1, r2, r3 = (self.uc.reg_read(register) for register in ARGUMENTS)
        return r0, r1, r2, r3

    def registers(self, start: int, size: int, read: Callable[[int], int], write: Callable[[int, int], None]) -> None:
        """Device memory: read(address) and write(address, value)."""
        self.uc.mmio_map(
            start,
            size,
            lambda _uc, offset, _size, _data: read(start + offset), None,
            lambda _uc, offset, _size, value, _data: write(start + offset, value), None,
        )  # fmt: skip

    def word(self, address: int) -> int:
        return int.from_bytes(self.uc.mem_read(address, 4), "little")

    def run_until_it_waits(self, address: int | None = None) -> None:
        """From reset, or on from the last WFI."""
        if address is not None:
            self.uc.reg_write(UC_ARM_REG_SP, self.symbols["stack_top"])
        self.uc.emu_start((address or self.uc.reg_read(UC_ARM_REG_PC)) | 1, DONE)
