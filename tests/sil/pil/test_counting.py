"""Instructions are counted as the processor executes them: IT blocks, loops, calls; and the same number every time."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from sil.pil.counting import Counter, instructions
from sil.pil.image import Image
from sil.pil.machine import Machine

# on_reset: r0 = 5; each round: called(), r0 -= 1. Then wait for ever.
PROGRAM = [
    0x2005,  # 08 movs r0, #5
    0xF000, 0xF803,  # 0a bl 0x14
    0x3801,  # 0e subs r0, #1
    0xD1FB,  # 10 bne 0x0a
    0xBF30,  # 12 wfi
    0x2803,  # 14 called: cmp r0, #3
    0xBF08,  # 16 it eq
    0x2107,  # 18 moveq r1, #7: executed once, skipped four times
    0xF04F, 0x0201,  # 1a mov.w r2, #1
    0x4770,  # 1e bx lr
]  # fmt: skip
ROUND = 3 + 5  # bl subs bne, and the five of called()


def machine_with(program: list[int]) -> Machine:
    vectors = struct.pack("<II", 0x2000_1000, 9)
    code = struct.pack(f"<{len(program)}H", *program)
    return Machine(Image(Path("made"), ((0, vectors + code),), {"called": (0x14, 12)}, (), {}), pytest.fail)


def test_a_known_program_has_its_known_number() -> None:
    machine = machine_with(PROGRAM)
    counter = Counter(machine)
    calls = counter.watch("called")
    machine.power_on()
    assert calls == [5] * 5
    assert counter.total == 1 + 5 * ROUND + 1


def test_a_hook_on_every_instruction_would_miss_what_it_skips() -> None:
    """Why pieces of code are counted. If this fails, unicorn has changed, and counting could be simpler."""
    machine = machine_with(PROGRAM)
    seen: list[int] = []
    for address in range(8, 0x20, 2):
        machine.engine.on_code(address, lambda _handle, at, _size, _data: seen.append(at))
    machine.power_on()
    assert len(seen) == 1 + 5 * ROUND + 1 - 4


def test_lengths_of_thumb_instructions() -> None:
    halfwords = [0x2005, 0xF000, 0xF803, 0xE7FE, 0xE840, 0xF000, 0xF8D8, 0x6000, 0xFB00, 0xF000]
    assert instructions(struct.pack("<10H", *halfwords)) == 6
