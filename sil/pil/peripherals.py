"""What an mps2-an386 has around its processor, as far as the firmware uses it: UART0, the watchdog, the private bus.

Registers as in Arm's Cortex-M System Design Kit (APB UART, APB watchdog) and in the ARMv7-M Architecture Reference
Manual (B3, system control space). A register that is not modelled reads as it was written.

UART: no FIFO, no baud rate. Bytes wait here and step into DATA one after the other as the firmware reads it, so none is
ever lost: a line that overruns is tested with the host library and on hardware. TX is never full.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sil.pil.engine import Read, Write

UART, WATCHDOG, SYSTEM = 0x40004000, 0x40008000, 0xE000E000
UART_RX_IRQ = 0

DATA, STATE, CONTROL, INTERRUPT, DIVIDER = 0x0, 0x4, 0x8, 0xC, 0x10
RX_FULL = 2
RX_ENABLED, RX_INTERRUPT_ENABLED, RX_INTERRUPT = 2, 8, 2

LOAD, VALUE, WATCHDOG_CONTROL, CLEAR, LOCK = 0x0, 0x4, 0x8, 0xC, 0xC00
INTERRUPT_ENABLED, RESET_ENABLED = 1, 2

NVIC_SET, NVIC_CLEAR, VTOR, AIRCR = 0x100, 0x180, 0xD08, 0xD0C
AIRCR_KEY, AIRCR_RESET = 0x05FA, 4


class Uart:
    """UART0. `sent`: what the firmware has written since the last take_sent(). `on_sent`: called at every byte out."""

    def __init__(self, on_sent: Callable[[], object] | None = None) -> None:
        self.sent = bytearray()
        self._waiting: list[int] = []  # backwards: the next byte is the last
        self._control = self._divider = 0
        self._asks = False  # the byte in DATA has asked for an interrupt that was not yet cleared
        self.read, self.write = self._reader(), self._writer(on_sent)

    def reset(self) -> None:
        """Bytes that were on their way in are lost with it."""
        self._waiting.clear()
        self._control = self._divider = 0
        self._asks = False

    def receive(self, data: bytes) -> None:
        """Bytes on the line; the first of them steps into DATA. Without a receiver they are lost, as on the part."""
        if self._control & RX_ENABLED and data:
            self._waiting[:0] = data[::-1]
            self._asks = True

    def take_sent(self) -> bytes:
        sent = bytes(self.sent)
        self.sent.clear()
        return sent

    @property
    def holds_bytes(self) -> bool:
        """Bytes wait to be read."""
        return bool(self._waiting)

    @property
    def wants_interrupt(self) -> bool:
        return self._asks and self._control & RX_INTERRUPT_ENABLED != 0

    def _reader(self) -> Read:
        waiting = self._waiting

        def read(_handle: Any, offset: int, _size: int, _data: Any) -> int:
            if offset == STATE:
                return RX_FULL if waiting else 0
            if offset == DATA:
                if not waiting:
                    return 0
                byte = waiting.pop()
                self._asks = bool(waiting)
                return byte
            if offset == INTERRUPT:
                return RX_INTERRUPT if self._asks else 0
            return {CONTROL: self._control, DIVIDER: self._divider}.get(offset, 0)

        return read

    def _writer(self, on_sent: Callable[[], object] | None) -> Write:
        put = self.sent.append

        def write(_handle: Any, offset: int, _size: int, value: int, _data: Any) -> None:
            if offset == DATA:
                put(value & 0xFF)
                if on_sent is not None:
                    on_sent()
            elif offset == INTERRUPT:
                self._asks = self._asks and not value & RX_INTERRUPT
            elif offset == CONTROL:
                self._control = value
            elif offset == DIVIDER:
                self._divider = value

        return write


class Watchdog:
    """Resets when it is not cleared for two of its periods, which others measure. Its warning half-way is left out."""

    CLOCK_HZ = 25_000_000

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._registers: dict[int, int] = {}
        self.cleared = True  # since whoever measures has looked last

    @property
    def period_s(self) -> float | None:
        """From a clear to the reset, in s; None while it is switched off."""
        on = INTERRUPT_ENABLED | RESET_ENABLED
        if self._registers.get(WATCHDOG_CONTROL, 0) & on != on:
            return None
        return 2.0 * self._registers.get(LOAD, 0xFFFFFFFF) / self.CLOCK_HZ

    def read(self, _handle: Any, offset: int, _size: int, _data: Any) -> int:
        return self._registers.get(LOAD if offset == VALUE else offset, 0)

    def write(self, _handle: Any, offset: int, _size: int, value: int, _data: Any) -> None:
        if offset in (CLEAR, LOAD):
            self.cleared = True
        self._registers[offset] = value


class System:
    """The private bus: which interrupts are enabled, where the vectors lie, and the request for a reset."""

    def __init__(self, on_reset: Callable[[], None]) -> None:
        self._on_reset = on_reset
        self.reset()

    def reset(self) -> None:
        self._registers: dict[int, int] = {}
        self._enabled = 0  # of the first 32 interrupts, which are all there are

    @property
    def vectors(self) -> int:
        """Address of the vector table."""
        return self._registers.get(VTOR, 0) & ~0x7F

    def enables(self, irq: int) -> bool:
        return bool(self._enabled >> irq & 1)

    def read(self, _handle: Any, offset: int, _size: int, _data: Any) -> int:
        return self._enabled if offset in (NVIC_SET, NVIC_CLEAR) else self._registers.get(offset, 0)

    def write(self, _handle: Any, offset: int, _size: int, value: int, _data: Any) -> None:
        if offset == NVIC_SET:
            self._enabled |= value
        elif offset == NVIC_CLEAR:
            self._enabled &= ~value
        elif offset == AIRCR and value >> 16 == AIRCR_KEY and value & AIRCR_RESET:
            self._on_reset()
        else:
            self._registers[offset] = value


def pages(uart: Uart, watchdog: Watchdog, system: System) -> tuple[tuple[int, Read, Write], ...]:
    """(address, read, write) of every page of registers."""
    return (
        (UART, uart.read, uart.write),
        (WATCHDOG, watchdog.read, watchdog.write),
        (SYSTEM, system.read, system.write),
    )
