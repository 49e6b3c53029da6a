"""An mps2-an386 that executes an unmodified firmware image: bytes in at its UART, bytes out, faults and resets as the
part has them.

Time stands still: SysTick never ticks and the firmware's clock does not go on, for this board steps by SAMPLE and TICK.
WFI gives control back, and so the firmware runs from the bytes that come until it waits for more. Interrupts are taken
where it waits, or where it permits them again after it has waited; never in the middle of a computation.

What unicorn leaves out of an ARMv7-M stands here: entry into an exception and return from it. A handler runs in thread
mode (IPSR reads 0), one exception deep but for a fault inside of a handler. Left out: priorities, NMI, SysTick, lazy
stacking of the FPU, the other stack pointer.

A fault (no memory there, an undefined instruction) is reported in one line and enters the image's HardFault handler,
as on the part; a fault in that handler is a lockup and resets. What a reset finds in RAM is what was there before.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from sil.pil.engine import Engine
from sil.pil.image import FLASH, FLASH_SIZE, RAM, RAM_SIZE, Image
from sil.pil.peripherals import UART_RX_IRQ, System, Uart, Watchdog, pages

R0, R1, R2, R3, R12, LR, PC, XPSR, SP, PRIMASK = range(10)  # as Engine.REGISTERS
FRAME_BYTES = 32
THUMB_BIT, FRAME_WAS_ODD, IT_STATE = 1 << 24, 1 << 9, 0x0600FC00  # of xPSR
TO_THREAD, TO_HANDLER = 0xFFFFFFF9, 0xFFFFFFF1  # EXC_RETURN, in LR
HARD_FAULT, FIRST_IRQ = 3, 16
BURST = 256  # bytes that are on the line at once; the firmware has worked them off when it waits again
PERMITS = ((0xB662, 2), (0xB663, 2))  # CPSIE i, CPSIE if: (halfword, bytes)
MSR, MSR_PRIMASK = 0xF380, 0x8810  # MSR PRIMASK, Rn: 0xF38n 0x8810
EXCEPTIONS = {1: "undefined instruction", 2: "SVC", 3: "prefetch abort", 4: "data abort", 7: "breakpoint"}
MOST_RESETS, WITHIN_S = 10, 10.0


class ResetStorm(Exception):
    """The image resets again and again; one line that says why it did so the last time."""


class Machine:
    """One board. tell(line): what a person should know, such as a fault; it is the board's only word but frames.

    on_sent(): called at every byte the firmware sends, which a measurement may want to know.
    """

    def __init__(self, image: Image, tell: Callable[[str], None], on_sent: Callable[[], object] | None = None) -> None:
        self.image, self._tell = image, tell
        self.engine = Engine()
        self.uart, self.watchdog, self.system = Uart(on_sent), Watchdog(), System(lambda: self.ask("software"))
        self.permits = places_that_permit(image)
        self.executing = False  # from bytes that come until the firmware waits: what a hang is measured by
        self.asked = ""  # why the machine is to reset, until it does
        self._registers: list[int] = [0] * len(Engine.REGISTERS)
        self._active: list[int] = []  # exceptions under way, the innermost last
        self._exception = 0  # what the engine reported while it ran
        self._may_interrupt = False  # it stopped where interrupts are permitted again
        self._bad_access = ""
        self._resets: deque[float] = deque(maxlen=MOST_RESETS)
        self._build()

    def _build(self) -> None:
        engine, image = self.engine, self.image
        engine.map_rom(FLASH, FLASH_SIZE)
        engine.map_ram(RAM, RAM_SIZE)
        for address, data in image.segments:
            engine.write(address, data)
        for page in pages(self.uart, self.watchdog, self.system):
            engine.map_registers(*page)
        engine.on_exception(self._on_exception)
        engine.on_bad_access(self._on_bad_access)
        for address in self.permits:
            engine.on_code(address, self._on_permit)

    # -- for whoever has plugged it in -------------------------------------------------------------------------------

    def power_on(self) -> bytes:
        """Out of reset until the firmware waits; returns what it sent. Raises ResetStorm."""
        self._begin()
        return self._until_idle()

    def exchange(self, data: bytes) -> bytes:
        """Bytes on the line, and the firmware until it waits for more; returns what it sent. Raises ResetStorm.

        A byte that comes while the firmware resets is lost, as on the part.
        """
        for start in range(0, len(data), BURST):
            self.uart.receive(data[start : start + BURST])
            self._run()
        return self.uart.take_sent()

    def ask(self, why: str) -> None:
        """Reset as soon as it is possible; from any thread. Reported with this reason."""
        self.asked = why
        self.engine.stop()

    def reset_if_asked(self) -> bytes:
        """For an idle machine: the reset that was asked for, and what the firmware says at its start."""
        return self._until_idle() if self.asked else b""

    def link_register(self) -> int:
        """Where the function under way returns to; for who hooks its first instruction."""
        return self.engine.read_registers()[LR]

    def close(self) -> None:
        self.engine.close()

    # -- running -----------------------------------------------------------------------------------------------------

    def _until_idle(self) -> bytes:
        self._run()
        return self.uart.take_sent()

    def _run(self) -> None:
        self.executing = True
        try:
            self._steps()
        finally:
            self.executing = False

    def _steps(self) -> None:
        """Piece after piece, until the firmware waits and nothing is there to wake it."""
        engine = self.engine
        while True:
            if self.asked:
                self._reset()
            elif self._interrupt_is_due():
                self._enter(FIRST_IRQ + UART_RX_IRQ)
            self._exception, self._may_interrupt, self._bad_access = 0, False, ""
            error = engine.run(self._registers[PC])
            self._registers = engine.read_registers()
            if self.asked or self._may_interrupt:
                continue
            if error or self._exception:
                self._exceptional(error)
            elif not self._wakes():
                return

    @property
    def interrupt_waits(self) -> bool:
        """One is pending that can be taken as soon as the firmware permits it."""
        return self._wakes() and not self._active

    def _wakes(self) -> bool:
        """WFI goes on at once when an interrupt is pending, permitted or not."""
        return self.uart.wants_interrupt and self.system.enables(UART_RX_IRQ)

    def _interrupt_is_due(self) -> bool:
        return self.interrupt_waits and not self._registers[PRIMASK] & 1

    def _exceptional(self, error: int) -> None:
        pc = self._registers[PC]
        if self._exception and self._active and pc == self._way_back() & ~1:
            self._leave()
        else:
            self._fault(error)

    # -- what the engine calls while it runs: note it and stop ---------------------------------------------------------

    def _on_exception(self, _handle: Any, number: int, _data: Any) -> None:
        self._exception = number or -1
        self.engine.stop()

    def _on_bad_access(self, _handle: Any, kind: int, address: int, size: int, _value: int, _data: Any) -> bool:
        way = {16: "read", 17: "write", 18: "fetch", 19: "read", 20: "write", 21: "fetch", 22: "write", 23: "read"}
        why = "read-only memory" if kind == 22 else "no memory"
        self._bad_access = f"{way.get(kind, 'fetch')} of {size} bytes at {address:#010x}, {why} there"
        return False

    def _on_permit(self, _handle: Any, _address: int, _size: int, _data: Any) -> None:
        """Interrupts were permitted one instruction ago."""
        if self.interrupt_waits:
            self._may_interrupt = True
            self.engine.stop()

    # -- exceptions --------------------------------------------------------------------------------------------------

    def _enter(self, number: int) -> None:
        """Push the frame, aligned to eight bytes, and go to the handler. Where there is no room, nothing is pushed."""
        registers = self._registers
        sp = registers[SP] - FRAME_BYTES & 0xFFFFFFFF
        odd = sp & 4
        frame = [*registers[:XPSR], registers[XPSR] | THUMB_BIT | (FRAME_WAS_ODD if odd else 0)]
        sp -= odd
        if RAM <= sp <= RAM + RAM_SIZE - FRAME_BYTES:
            self.engine.write(sp, b"".join(word.to_bytes(4, "little") for word in frame))
        registers[LR] = self._way_back(len(self._active) + 1)
        registers[SP] = sp
        registers[XPSR] = registers[XPSR] & ~IT_STATE | THUMB_BIT
        registers[PC] = self._vector(number)
        self._active.append(number)
        self.engine.write_registers(registers)

    def _leave(self) -> None:
        """Pop the frame of the innermost exception."""
        sp = self._registers[SP]
        frame = self.engine.read(sp, FRAME_BYTES)
        words = [int.from_bytes(frame[at : at + 4], "little") for at in range(0, FRAME_BYTES, 4)]
        sp += FRAME_BYTES + (4 if words[XPSR] & FRAME_WAS_ODD else 0)
        self._registers = [*words[:XPSR], words[XPSR] & ~FRAME_WAS_ODD, sp, self._registers[PRIMASK]]
        self._active.pop()
        self.engine.write_registers(self._registers)

    def _way_back(self, depth: int | None = None) -> int:
        """EXC_RETURN of the innermost exception."""
        return TO_HANDLER if (depth or len(self._active)) > 1 else TO_THREAD

    def _vector(self, number: int) -> int:
        return int.from_bytes(self.engine.read(self.system.vectors + 4 * number, 4), "little") & ~1

    def _fault(self, error: int) -> None:
        """Say what happened and where; the image's own handler has the word, unless it is the one that fails."""
        what = self._bad_access or EXCEPTIONS.get(self._exception) or self.engine.reason(error)
        place = self.image.place
        called = f", called from {place(self._registers[LR] & ~1)}" if "fetch" in what else ""
        self._tell(f"fault: {what}, at {place(self._registers[PC])}{called}")
        if HARD_FAULT in self._active:
            self.asked = "lockup, a fault in the fault handler"
        else:
            self._enter(HARD_FAULT)

    # -- reset -------------------------------------------------------------------------------------------------------

    def _reset(self) -> None:
        """Registers and peripherals as after power-on; memory as it is. Raises ResetStorm."""
        why, self.asked = self.asked, ""
        self._tell(f"reset: {why}, at {self.image.place(self._registers[PC])}")
        now = time.monotonic()
        if len(self._resets) == MOST_RESETS and now - self._resets[0] < WITHIN_S:
            raise ResetStorm(f"{MOST_RESETS} resets within {WITHIN_S:g} s, the last one: {why}")
        self._resets.append(now)
        self._begin()

    def _begin(self) -> None:
        for part in (self.uart, self.watchdog, self.system):
            part.reset()
        self._active.clear()
        sp, start = self.image.vectors
        self._registers = [0, 0, 0, 0, 0, 0xFFFFFFFF, start & ~1, THUMB_BIT, sp & ~3, 0]
        self.engine.write_registers(self._registers)
        self.engine.write_register("control", 0)


def places_that_permit(image: Image) -> list[int]:
    """Addresses behind the instructions that may permit interrupts: CPSIE, and MSR to PRIMASK."""
    found = []
    for base, data in image.segments:
        halfwords = [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data) - 1, 2)]
        for number, (half, after) in enumerate(zip(halfwords, [*halfwords[1:], 0], strict=True)):
            size = next((size for code, size in PERMITS if half == code), 0)
            if half & 0xFFF0 == MSR and after == MSR_PRIMASK:
                size = 4
            if size:
                found.append(base + 2 * number + size)
    return found
