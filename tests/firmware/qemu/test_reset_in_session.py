"""A reset in the middle of a session: HELLO unasked, HELLO to every frame, and a new session like the first."""

from __future__ import annotations

import pytest
from powered import MACHINES, Powered

from protocol import frames
from protocol.frames import NO_TICK, Packet, Reading, Sample, Timing, Type
from protocol.law_tables import config_words, law_by_name, table_hash
from sil.session import Session

TABLE = law_by_name("mrac")
WORDS = config_words(TABLE, {}, ((0, 2**28, 0, 0),))
TICKS = 40
STACK_BYTES = 2048


def sample(tick: int) -> Sample:
    zero = (0, 0, 0)
    source, ack = (frames.FRESH, tick - 1) if tick else (frames.ZERO, NO_TICK)
    return Sample(tick, zero, zero, zero, ack, 0, source, 1, (Reading(0, (2**20, 0, 0)), None, None))


def session(board: Powered, ticks: int, words: tuple[int, ...] = WORDS) -> list[Packet]:
    """From HELLO to the answers to these ticks, TIMING and all."""
    Session(board.port, 0, lambda: None).open(words, table_hash(TABLE, words), 5.0, lambda _: None)
    heard: list[Packet] = []
    for tick in range(ticks):
        board.port.send(sample(tick))
        command = board.next()
        heard += [command, *(board.next() for _ in range(command.frame.follows))]
        assert (command.type, command.tick) == (Type.COMMAND, tick)
        if (tick + 1) % 16 == 0:
            heard.append(board.next())
    return heard


def deterministic(heard: list[Packet]) -> list[Packet]:
    return [packet for packet in heard if packet.type != Type.TIMING]


@pytest.mark.parametrize("chip", MACHINES)
def test_after_a_reset_it_says_hello_knows_nothing_and_begins_anew(chip):
    """SPEC, 6.1 and 6.2; all that a session leaves in memory is gone with it, so the next one has the same packets."""
    with Powered(chip) as board:
        board.boot_hello()
        first = session(board, TICKS)
        board.qemu.qmp.run("system_reset")
        board.boot_hello()
        board.port.send(sample(TICKS))
        board.boot_hello()
        assert deterministic(session(board, TICKS)) == deterministic(first)
        assert board.boot_record().boots == 2


@pytest.mark.parametrize("chip", MACHINES)
def test_it_reports_its_stack_and_no_errors(chip):
    """TIMING: of 2 KiB of stack, mrac's step and the interrupts on top of it leave room."""
    with Powered(chip) as board:
        board.boot_hello()
        timings: list[Timing] = [packet.frame for packet in session(board, TICKS) if packet.type == Type.TIMING]
        assert [(timing.rx_errors, timing.discarded_bytes) for timing in timings] == [(0, 0)] * (TICKS // 16)
        assert 256 < timings[-1].stack_bytes <= STACK_BYTES - 256
        bottom = board.qemu.words(board.symbols["stack_bottom"], STACK_BYTES // 4)
        untouched = next(index for index, word in enumerate(bottom) if word != bottom[0])
        assert STACK_BYTES - 4 * untouched == timings[-1].stack_bytes


@pytest.mark.parametrize("chip", MACHINES)
def test_a_burst_longer_than_its_ring_loses_no_byte(chip):
    """CONFIG with 600 guidance rows comes in one write of 11 kB; the ring holds 2 kB, and the line is held up."""
    rows = tuple((tick, 2**20, 0, 0) for tick in range(600))
    with Powered(chip) as board:
        board.boot_hello()
        heard = session(board, 16, config_words(TABLE, {}, rows))
        assert (heard[-1].type, heard[-1].frame.rx_errors, heard[-1].frame.discarded_bytes) == (Type.TIMING, 0, 0)
        assert board.port.counters.discarded_bytes == 0
