"""What goes wrong in a firmware ends in a reset and a HELLO, and its cause outlives it: an image that has accidents."""

from __future__ import annotations

import time
from typing import NamedTuple

import pytest
from powered import MACHINES, Powered

from protocol import frames
from protocol.frames import Hello

ASK = b"\x00!?!"  # incidents.c


class Fault(NamedTuple):
    """letter asks for it; exception and status (CFSR bits, all of them set) are kept, as is where: a function."""

    letter: bytes
    exception: int
    status: int
    where: str


FAULTS = {
    "undefined instruction": Fault(b"u", 3, 1 << 16, "undefined"),
    "read where nothing is": Fault(b"w", 3, 1 << 15 | 1 << 9, "wild_read"),
    "an interrupt nobody expects": Fault(b"s", 16 + 5, 0, "stray_interrupt"),
    "floating point switched off": Fault(b"n", 3, 1 << 19, "use_fpu"),
}


@pytest.mark.parametrize("chip", MACHINES)
@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_fault_resets_and_its_cause_is_kept(accident_image, chip, fault):
    with Powered(chip, accident_image[chip]) as board:
        board.boot_hello()
        board.link.send(ASK + fault.letter)
        board.boot_hello()
        record = board.boot_record()
        assert (record.boots, record.exception) == (2, fault.exception)
        assert record.status & fault.status == fault.status
        assert board.function_at(record.pc) == fault.where


@pytest.mark.parametrize("chip", MACHINES)
def test_a_stack_that_overflows_resets(accident_image, chip):
    """There is no frame to tell where. QEMU lets an mps2 write below its RAM, so there it ends at the first return."""
    with Powered(chip, accident_image[chip]) as board:
        board.boot_hello()
        before = board.qemu.words(board.symbols["stack_top"] + 64, 64)
        board.link.send(ASK + b"o")
        board.boot_hello()
        record = board.boot_record()
        assert (record.boots, record.exception, record.pc) == (2, 3, 0)
        assert board.qemu.words(board.symbols["stack_top"] + 64, 64) == before


@pytest.mark.parametrize("chip", MACHINES)
def test_floating_point_computes_where_it_is_switched_on(accident_image, chip):
    """The other half of "floating point switched off"."""
    with Powered(chip, accident_image[chip]) as board:
        board.boot_hello()
        board.link.send(ASK + b"f" + ASK + b"l")  # and then main() returns, which is an incident, too
        board.boot_hello()
        record = board.boot_record()
        assert (record.boots, record.exception, record.status) == (2, 1, 0)


@pytest.mark.parametrize(("letter", "where"), [(b"h", "hang"), (b"d", "hang_deaf")])
def test_the_watchdog_resets_a_firmware_that_hangs(accident_image, letter, where):
    """With interrupts on and off; after two of its seconds, the NMI at the first having noted where."""
    with Powered("mps2-an386", accident_image["mps2-an386"]) as board:
        board.boot_hello()
        began = time.monotonic()
        board.link.send(ASK + letter)
        board.boot_hello(within_s=20.0)
        assert time.monotonic() - began > 1.5
        record = board.boot_record()
        assert (record.boots, record.exception) == (2, 2)
        assert board.function_at(record.pc) == where
        assert len(board.events("WATCHDOG")) == 1


def test_a_firmware_that_waits_is_not_reset(accident_image):
    """Main loop and kick go on without a byte on the line: SysTick wakes it."""
    with Powered("mps2-an386", accident_image["mps2-an386"]) as board:
        board.boot_hello()
        assert board.all_within(2.5) == []
        assert board.boot_record().boots == 1


def test_a_firmware_that_only_stood_still_is_not_reset(accident_image):
    """The NMI alone is a warning: QEMU's clock runs on while the processor stands, and a kick in time is enough."""
    with Powered("mps2-an386", accident_image["mps2-an386"]) as board:
        board.boot_hello()
        board.link.send(ASK + b"p")
        assert board.all_within(3.0) == []
        record = board.boot_record()
        assert (record.boots, record.exception) == (1, 2)


def hellos(first: int, count: int) -> list[Hello]:
    return [Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, nonce, 0, "test") for nonce in range(first, first + count)]


def rx_errors(board: Powered) -> int:
    return board.qemu.words(board.symbols["health"] + 4, 1)[0]


def busy_while_80_hellos_come(board: Powered, letter: bytes) -> set[int]:
    """4.6 kB for a ring of 2 kB; the nonces of the answers."""
    board.boot_hello()
    board.link.send(ASK + letter)
    board.port.send(*hellos(1, 80))
    return {packet.frame.nonce for packet in board.all_within(2.5)}


def test_what_a_full_ring_cannot_take_stays_in_the_uart(accident_image):
    """So a sender that can be held up, as QEMU and the emulator can, loses nothing."""
    with Powered("mps2-an386", accident_image["mps2-an386"]) as board:
        assert busy_while_80_hellos_come(board, b"p") == set(range(1, 81))
        assert (rx_errors(board), board.boot_record().boots) == (0, 1)


def test_what_a_full_ring_cannot_take_is_counted_and_the_next_frame_is_answered(accident_image):
    """The STM32's interrupt has to take a byte to come to an end."""
    with Powered("stm32f405", accident_image["stm32f405"]) as board:
        answered = busy_while_80_hellos_come(board, b"q")
        assert 30 < len(answered) < 80
        assert rx_errors(board) > 0
        board.port.send(*hellos(100, 1))
        assert board.next().frame.nonce == 100
