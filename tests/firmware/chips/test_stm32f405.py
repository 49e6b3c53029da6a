"""The STM32F405 among registers that a test answers for: clocks with and without crystal, UART errors, watchdog.

QEMU's machine has neither clock controller nor watchdog. What is written, and in which order, is held against ST's
reference manual (RM0090); whether the silicon agrees, only silicon can tell.
"""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from bare import Bare

from protocol.codec import StreamDecoder
from protocol.frames import Type, unpack
from tools.firmware_image import IMAGES, build

FLASH = 0x08000000
RCC_CR, RCC_PLL, RCC_CFGR = 0x40023800, 0x40023804, 0x40023808
RCC_RESETS, BY_IWDG, BY_SOFTWARE, FORGET = 0x40023874, 1 << 29, 1 << 28, 1 << 24
FLASH_ACR = 0x40023C00
USART_STATUS, USART_DATA, USART_DIVIDER = 0x40011000, 0x40011004, 0x40011008
IWDG_KEY, IWDG_PRESCALER, IWDG_RELOAD = 0x40003000, 0x40003004, 0x40003008
SYSTICK_RELOAD, DEBUG_FREEZE = 0xE000E014, 0xE0042008
TX_EMPTY, RX_FULL, OVERRUN, NOISE, FRAMING = 1 << 7, 1 << 5, 1 << 3, 1 << 2, 1 << 1
START, UNLOCK, KICK = 0xCCCC, 0x5555, 0xAAAA


class Chip:
    """Registers that keep what is written, but for a clock controller that answers as far as it is told to."""

    def __init__(
        self, crystal: bool = True, pll: bool = True, silent: bool = False, image: Path = IMAGES / "stm32f405.elf"
    ) -> None:
        self.crystal, self.pll, self.silent = crystal, pll, silent
        self.values: dict[int, int] = {}
        self.written: list[tuple[int, int]] = []
        self.incoming: list[tuple[int, int]] = []  # (status, byte)
        self.reads: list[int] = []
        self.sent = bytearray()
        self.bare = Bare(image, FLASH)
        self.bare.registers(0x40000000, 0x30000, self.read, self.write)
        self.bare.uc.mem_map(0xE0000000, 0x100000)

    def read(self, address: int) -> int:
        self.reads.append(address)
        value = self.values.get(address, 0)
        if address in (RCC_CR, RCC_CFGR, RCC_PLL) and self.silent:
            return 0
        if address == RCC_CR:
            return value | (value << 1 & 1 << 17 if self.crystal else 0) | (value << 1 & 1 << 25 if self.pll else 0)
        if address == RCC_CFGR:
            return value | (value & 3) << 2
        if address == USART_STATUS:
            return TX_EMPTY | (self.incoming[0][0] if self.incoming else 0)
        if address == USART_DATA and self.incoming:
            return self.incoming.pop(0)[1]
        return value

    def write(self, address: int, value: int) -> None:
        self.written.append((address, value))
        self.values[address] = value
        if address == USART_DATA:
            self.sent.append(value)

    def boot(self) -> Chip:
        self.bare.run_until_it_waits(self.bare.symbols["on_reset"])
        return self

    def interrupt(self) -> None:
        self.bare.call(self.bare.symbols["on_usart"])

    def last(self, address: int) -> int:
        return self.values[address]

    def rx_errors(self) -> int:
        return self.bare.word(self.bare.symbols["health"] + 4)


def test_with_its_crystal_it_runs_at_168_MHz():
    """8 MHz / 8 * 336 / 2; USART1 hangs on half of it: 84 MHz / 729 = 115226 baud."""
    chip = Chip().boot()
    pll = chip.last(RCC_PLL)
    m, n, p = pll & 0x3F, pll >> 6 & 0x1FF, 2 * ((pll >> 16 & 3) + 1)
    assert 8 / m * n / p == 168
    assert pll & 1 << 22
    assert chip.last(RCC_CFGR) & 3 == 2
    assert (chip.last(RCC_CFGR) >> 10 & 7, chip.last(RCC_CFGR) >> 13 & 7) == (5, 4)  # 42 and 84 MHz
    assert chip.last(USART_DIVIDER) == 729
    assert chip.bare.word(SYSTICK_RELOAD) == 167_999


def test_another_crystal_is_a_setting_of_the_build(tmp_path):
    pll = Chip(image=build("stm32f405", tmp_path, "HSE_MHZ=25")).boot().last(RCC_PLL)
    assert (pll & 0x3F, pll >> 6 & 0x1FF) == (25, 336)


def test_the_flash_waits_before_the_clock_is_fast():
    """Five wait states at 168 MHz: a switch before that fetches rubbish."""
    order = [write for write in Chip().boot().written if write[0] in (FLASH_ACR, RCC_CFGR)]
    assert order[0][0] == FLASH_ACR
    assert order[0][1] & 7 == 5
    assert order[-1] == (RCC_CFGR, order[-1][1])
    assert order[-1][1] & 3 == 2


@pytest.mark.parametrize("missing", [{"crystal": False}, {"pll": False}, {"silent": True}], ids=str)
def test_without_crystal_pll_or_clock_controller_it_runs_at_16_MHz(missing):
    """And the baud rate is computed for that: 16 MHz / 139 = 115108."""
    chip = Chip(**missing).boot()
    assert chip.values.get(RCC_CFGR, 0) & 3 == 0
    assert chip.last(USART_DIVIDER) == 139
    assert chip.bare.word(SYSTICK_RELOAD) == 15_999


def test_at_boot_it_sends_one_hello():
    packets = StreamDecoder().feed(bytes(Chip().boot().sent))
    assert [unpack(packet).type for packet in packets] == [Type.HELLO]


def test_the_watchdog_runs_before_anything_can_hang_and_is_kicked_every_round():
    """32 kHz / 32 * 1000 counts: a second. A debugger that holds the core holds it, too."""
    chip = Chip().boot()
    first = [write for write in chip.written if write[0] in (IWDG_KEY, IWDG_PRESCALER, IWDG_RELOAD)][:5]
    expected = [(IWDG_KEY, START), (IWDG_KEY, UNLOCK), (IWDG_PRESCALER, 3), (IWDG_RELOAD, 1000), (IWDG_KEY, KICK)]
    assert first == expected
    assert chip.written[0] == (IWDG_KEY, START)
    assert chip.bare.word(DEBUG_FREEZE) & 1 << 12
    kicks = chip.written.count((IWDG_KEY, KICK))
    for rounds in range(1, 4):
        chip.bare.run_until_it_waits()
        assert chip.written.count((IWDG_KEY, KICK)) == kicks + rounds


@pytest.mark.parametrize(
    ("resets", "incident"), [(BY_IWDG, (2, 0, 0)), (BY_SOFTWARE, (3, 0x800, 7)), (0, (3, 0x800, 7))]
)
def test_that_the_watchdog_has_bitten_is_kept(resets, incident):
    """It gives no warning (RM0090, 7.3.21): an incident that the firmware noted by itself stays, unless it was this."""
    chip = Chip()
    record = chip.bare.symbols["boot_record"]
    chip.bare.uc.mem_write(record, struct.pack("<5I", 0xB0A2D001, 4, 3, 0x800, 7))
    chip.values[RCC_RESETS] = resets
    chip.boot()
    assert struct.unpack("<5I", chip.bare.uc.mem_read(record, 20)) == (0xB0A2D001, 5, *incident)
    assert chip.last(RCC_RESETS) & FORGET


@pytest.mark.parametrize("error", [OVERRUN, NOISE, FRAMING])
def test_a_receiver_error_is_counted_cleared_and_costs_no_byte_that_came(error):
    """Cleared by a read of the status and then of the data (RM0090, 30.6.1); the byte is for the CRC to judge."""
    chip = Chip().boot()
    chip.incoming = [(RX_FULL | error, 0x5A)]
    chip.reads.clear()
    chip.interrupt()
    assert chip.reads == [USART_STATUS, USART_DATA]
    assert chip.rx_errors() == 1
    received = chip.bare.symbols["received"]
    assert (chip.bare.word(received), chip.bare.uc.mem_read(received + 8, 1)) == (1, b"\x5a")


def test_an_overrun_alone_is_cleared_too():
    """Else its interrupt would come for ever."""
    chip = Chip().boot()
    chip.incoming = [(OVERRUN, 0)]
    chip.interrupt()
    assert (chip.rx_errors(), chip.incoming) == (1, [])
    assert chip.bare.word(chip.bare.symbols["received"]) == 0


def test_more_bytes_than_the_ring_holds_are_counted_and_overwrite_none():
    chip = Chip().boot()
    for number in range(2048 + 3):
        chip.incoming = [(RX_FULL, number & 0xFF)]
        chip.interrupt()
    assert chip.rx_errors() == 3
    received = chip.bare.symbols["received"]
    assert chip.bare.word(received) == 2048
    assert bytes(chip.bare.uc.mem_read(received + 8, 4)) == bytes(range(4))
