"""From power-on to the first HELLO: vectors, floating point, what the board says of itself, and no more."""

from __future__ import annotations

import pytest
from powered import MACHINES, Powered

from protocol import frames
from protocol.frames import Hello, Type
from tools.firmware_image import manifest

PAINT = 0x5AC35AC3
CPACR, VTOR = 0xE000ED88, 0xE000ED08
OWN_TIMER = {"mps2-an386": False, "stm32f405": True}


@pytest.fixture(scope="module", params=MACHINES)
def board(request):
    with Powered(request.param) as powered:
        powered.chip = request.param
        powered.heard = powered.all_within(0.5)
        yield powered


def test_at_boot_it_sends_one_hello_and_nothing_else(board):
    """A laboratory that was there first learns of the restart, and of nothing that it has not asked for."""
    assert [packet.type for packet in board.heard] == [Type.HELLO]
    assert board.port.counters.discarded_bytes == 0


def test_hello_says_which_chip_and_which_sources(board):
    hello: Hello = board.heard[0].frame
    assert hello.build == f"fw {board.chip} {manifest()[board.chip]['sources_sha256'][:8]}"
    assert (hello.protocol_version, hello.layout_hash) == (frames.PROTOCOL_VERSION, frames.LAYOUT_HASH)
    assert (hello.role, hello.nonce) == (frames.ROLE_BOARD, 0)
    assert bool(hello.flags & frames.HELLO_OWN_TIMER) == OWN_TIMER[board.chip]


def test_floating_point_is_switched_on(board):
    """unicorn computes without; the processor faults (test_incidents.py)."""
    assert board.word(CPACR) >> 20 & 0xF == 0xF


def test_vectors_lead_into_the_code(board):
    """Stack and reset first; every other vector an odd address of a handler, none left empty."""
    names = board.symbols
    table, end = names["vectors"], min(address for address in names.values() if address > names["vectors"])
    stack, *handlers = board.qemu.words(table, (end - table) // 4)
    assert board.word(VTOR) == table
    assert (stack, handlers[0]) == (names["stack_top"], names["on_reset"] | 1)
    uart = "on_uart_rx" if board.chip == "mps2-an386" else "on_usart"
    known = {names[name] | 1 for name in ("on_fault", "on_systick", uart)}
    nmi = names["on_nmi_note" if board.chip == "mps2-an386" else "on_fault"] | 1
    assert handlers[1] == nmi
    assert set(handlers[2:]) == known


def test_the_stack_lies_at_the_bottom_of_ram_and_is_painted(board):
    """So an overflow leaves RAM, and the high water can be told."""
    names = board.symbols
    assert names["stack_bottom"] == 0x20000000
    size = names["stack_top"] - names["stack_bottom"]
    painted = board.qemu.words(names["stack_bottom"], size // 4)
    assert painted[: size // 8] == [PAINT] * (size // 8)
    assert painted[-1] != PAINT


def test_the_first_boot_is_the_first(board):
    record = board.boot_record()
    assert (record.boots, record.exception, record.pc, record.status) == (1, 0, 0, 0)
