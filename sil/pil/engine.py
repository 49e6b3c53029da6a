"""A thin layer over the C library of unicorn, which executes a Cortex-M4's instructions: memory, registers, run, stop.

Callbacks are handed to the library as they are, without the wrapper of unicorn's own Python package: a firmware touches
a UART register a few hundred times per answer, and each touch calls Python.

Only this file imports unicorn. The mode is THUMB and never MCLASS: with MCLASS unicorn takes a Cortex-M33, whatever
model it is asked for, and says nothing about it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

NEEDS = "needs unicorn: pip install 'attitude-sil[pil]'"
PAGE = 0x1000
NEVER = 0xFFFFFFFE  # an address at which no code lies: run() ends for other reasons only
EVERYWHERE = (1, 0)  # a hook's range that has no limits
CTL_TYPE_ARGUMENTS, CTL_TYPE_WAY = 26, 30  # bit positions in the first argument of uc_ctl

_Handle, _U64, _U32 = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32
_READ = ctypes.CFUNCTYPE(_U64, _Handle, _U64, ctypes.c_uint, _Handle)
_WRITE = ctypes.CFUNCTYPE(None, _Handle, _U64, ctypes.c_uint, _U64, _Handle)
_INTERRUPT = ctypes.CFUNCTYPE(None, _Handle, _U32, _Handle)
_CODE = ctypes.CFUNCTYPE(None, _Handle, _U64, _U32, _Handle)
_INVALID = ctypes.CFUNCTYPE(ctypes.c_bool, _Handle, ctypes.c_int, _U64, ctypes.c_int, ctypes.c_int64, _Handle)
_ACCESS = ctypes.CFUNCTYPE(None, _Handle, ctypes.c_int, _U64, ctypes.c_int, ctypes.c_int64, _Handle)

Read = Callable[[Any, int, int, Any], int]  # (handle, offset in the page, bytes, None) to the value read
Write = Callable[[Any, int, int, int, Any], None]  # (handle, offset in the page, bytes, value, None)


class EngineError(Exception):
    """unicorn is not there, is another one than expected, or refuses; one line."""


class Engine:
    """A Cortex-M4 without memory, interrupts or system registers. `registers` names what read/write_registers move."""

    REGISTERS = ("r0", "r1", "r2", "r3", "r12", "lr", "pc", "xpsr", "sp", "primask")

    def __init__(self) -> None:
        self._lib, self._const, numbers = _load()
        self._kept: list[Any] = []  # callbacks and memory that the library holds pointers to
        self._handle = _Handle()
        self._must(self._lib.uc_open(self._const.UC_ARCH_ARM, self._const.UC_MODE_THUMB, ctypes.byref(self._handle)))
        self._take_model(numbers.UC_CPU_ARM_CORTEX_M4)
        names = [getattr(numbers, f"UC_ARM_REG_{name.upper()}") for name in self.REGISTERS]
        self._values = (_U32 * len(names))()
        where = [ctypes.addressof(self._values) + 4 * place for place in range(len(names))]
        self._batch = ((ctypes.c_int * len(names))(*names), (_Handle * len(names))(*where), len(names))
        self._start, self._stop = self._lib.uc_emu_start, self._lib.uc_emu_stop

    def close(self) -> None:
        """Give its memory back; twice is as good as once."""
        handle, self._handle = self._handle, _Handle()
        if handle:
            self._lib.uc_close(handle)

    # -- memory ------------------------------------------------------------------------------------------------------

    def map_rom(self, address: int, size: int) -> None:
        """Read and execute; a write is a fault."""
        self._must(self._lib.uc_mem_map(self._handle, address, size, 1 | 4))

    def map_ram(self, address: int, size: int) -> None:
        """Read, write and execute, as the part has it."""
        self._must(self._lib.uc_mem_map(self._handle, address, size, 1 | 2 | 4))

    def map_registers(self, address: int, read: Read, write: Write) -> None:
        """A page of registers. What a callback raises is printed and lost: it must not raise."""
        kept = (_READ(read), _WRITE(write))
        self._kept.append(kept)
        pointers = [ctypes.cast(each, _Handle) for each in kept]
        self._must(self._lib.uc_mmio_map(self._handle, address, PAGE, pointers[0], None, pointers[1], None))

    def read(self, address: int, size: int) -> bytes:
        """Memory, not registers. Raises EngineError where there is none."""
        buffer = ctypes.create_string_buffer(size)
        self._must(self._lib.uc_mem_read(self._handle, address, buffer, size))
        return buffer.raw

    def write(self, address: int, data: bytes) -> None:
        """Memory, read-only or not. Raises EngineError where there is none."""
        self._must(self._lib.uc_mem_write(self._handle, address, data, len(data)))

    # -- the processor -----------------------------------------------------------------------------------------------

    def read_registers(self) -> list[int]:
        """In the order of REGISTERS."""
        self._lib.uc_reg_read_batch(self._handle, *self._batch)
        return list(self._values)

    def write_registers(self, values: Sequence[int]) -> None:
        """The first so many of REGISTERS."""
        words: list[ctypes.c_uint32 | int] = [*values]
        self._values[: len(words)] = words
        numbers, places, _ = self._batch
        self._must(self._lib.uc_reg_write_batch(self._handle, numbers, places, len(values)))

    def write_register(self, name: str, value: int) -> None:
        """Any register that unicorn knows by UC_ARM_REG_NAME, such as control."""
        cell = _U32(value)
        self._must(self._lib.uc_reg_write(self._handle, _register(name), ctypes.byref(cell)))

    def run(self, pc: int) -> int:
        """Execute from pc until WFI, stop(), or an error: unicorn's number of it, 0 for none."""
        return int(self._start(self._handle, pc | 1, NEVER, 0, 0))

    def stop(self) -> None:
        """End run() after the instruction or, from another thread, at the end of the piece of code under way."""
        self._stop(self._handle)

    def reason(self, error: int) -> str:
        """unicorn's words for what run() returned."""
        words: bytes = self._lib.uc_strerror(error)
        return words.decode().partition(" (")[0].lower()

    # -- hooks -------------------------------------------------------------------------------------------------------

    def on_exception(self, callback: Callable[[Any, int, Any], None]) -> None:
        """(handle, number, None): what QEMU's processor model calls an exception, numbers of its own."""
        self._hook(self._const.UC_HOOK_INTR, _INTERRUPT(callback), *EVERYWHERE)

    def on_bad_access(self, callback: Callable[[Any, int, int, int, int, Any], bool]) -> None:
        """(handle, kind, address, bytes, value, None): no such memory, or not for that; False: that is an error."""
        self._hook(self._const.UC_HOOK_MEM_INVALID, _INVALID(callback), *EVERYWHERE)

    def on_code(self, address: int, callback: Callable[[Any, int, int, Any], None]) -> None:
        """(handle, address, bytes, None) before the instruction at this address; no other is slowed down."""
        self._hook(self._const.UC_HOOK_CODE, _CODE(callback), address, address)

    def on_block(self, callback: Callable[[Any, int, int, Any], None]) -> None:
        """(handle, address, bytes, None) before every straight piece of code; ten times slower."""
        self._hook(self._const.UC_HOOK_BLOCK, _CODE(callback), *EVERYWHERE)

    def on_write(self, first: int, last: int, callback: Callable[[Any, int, int, int, int, Any], None]) -> None:
        """(handle, kind, address, bytes, value, None) before every write to these addresses."""
        self._hook(self._const.UC_HOOK_MEM_WRITE, _ACCESS(callback), first, last)

    def _hook(self, kind: int, callback: Any, first: int, last: int) -> None:
        self._kept.append(callback)
        pointer, number = ctypes.cast(callback, _Handle), ctypes.c_size_t()
        self._must(self._lib.uc_hook_add(self._handle, ctypes.byref(number), kind, pointer, None, first, last))

    # -- set-up ------------------------------------------------------------------------------------------------------

    def _take_model(self, model: int) -> None:
        """Ask for the model, and ask which one it became: unicorn may silently take another."""
        write = self._const.UC_CTL_CPU_MODEL | 1 << CTL_TYPE_ARGUMENTS | self._const.UC_CTL_IO_WRITE << CTL_TYPE_WAY
        read = self._const.UC_CTL_CPU_MODEL | 1 << CTL_TYPE_ARGUMENTS | self._const.UC_CTL_IO_READ << CTL_TYPE_WAY
        self._must(self._lib.uc_ctl(self._handle, ctypes.c_uint32(write), ctypes.c_int(model)))
        became = ctypes.c_int(-1)
        self._must(self._lib.uc_ctl(self._handle, ctypes.c_uint32(read), ctypes.byref(became)))
        refuse_other_model(model, became.value)

    def _must(self, status: int) -> None:
        if status:
            raise EngineError(f"unicorn: {self.reason(status)}")


def refuse_other_model(wanted: int, got: int) -> None:
    """Raises EngineError when the processor is not the one that was asked for."""
    if got != wanted:
        raise EngineError(f"unicorn: expected a Cortex-M4 (model {wanted}), got model {got}: {NEEDS.split(': ')[1]}")


def _register(name: str) -> int:
    from unicorn import arm_const

    return int(getattr(arm_const, f"UC_ARM_REG_{name.upper()}"))


def _load() -> tuple[ctypes.CDLL, Any, Any]:
    """(library with prototypes of our own, its constants, those of ARM). Raises EngineError when it is missing."""
    try:
        from unicorn import arm_const, unicorn_const
        from unicorn.unicorn_py3.unicorn import uclib
    except ImportError:
        raise EngineError(NEEDS) from None
    lib = ctypes.CDLL(uclib._name)
    size_t, integer, data = ctypes.c_size_t, ctypes.c_int, ctypes.c_char_p
    for name, arguments in {
        "uc_open": (integer, integer, _Handle),
        "uc_close": (_Handle,),
        "uc_mem_map": (_Handle, _U64, _U64, _U32),
        "uc_mmio_map": (_Handle, _U64, _U64, _Handle, _Handle, _Handle, _Handle),
        "uc_mem_read": (_Handle, _U64, data, _U64),
        "uc_mem_write": (_Handle, _U64, data, _U64),
        "uc_reg_write": (_Handle, integer, _Handle),
        "uc_reg_read_batch": (_Handle, _Handle, _Handle, integer),
        "uc_reg_write_batch": (_Handle, _Handle, _Handle, integer),
        "uc_emu_start": (_Handle, _U64, _U64, _U64, size_t),
        "uc_emu_stop": (_Handle,),
        "uc_hook_add": (_Handle, _Handle, integer, _Handle, _Handle, _U64, _U64),
        "uc_strerror": (integer,),
    }.items():
        getattr(lib, name).argtypes = arguments
    lib.uc_strerror.restype = data
    return lib, unicorn_const, arm_const
