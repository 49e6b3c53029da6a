"""The emulated mps2-an386: bytes through its UART, faults and resets as the part has them, and no hang that lasts.

The firmware under test is provoked.c on the real start-up and hal; see there for what each byte does.
"""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Iterator

import pytest
from provoked import Provoked

from sil.pil import engine
from sil.pil.engine import EngineError, refuse_other_model
from sil.pil.image import Image
from sil.pil.machine import MOST_RESETS, Machine, ResetStorm, places_that_permit
from sil.pil.peripherals import Watchdog
from sil.pil.supervisor import Supervisor

DIGITS = "0123456789"


@pytest.mark.parametrize("size", [1, 255, 256, 257, 2048, 5000])
def test_every_byte_comes_back_however_many_there_are(provoked: Provoked, size: int) -> None:
    """5000 bytes do not fit the firmware's ring: it leaves them in the UART, which must not drop or repeat one."""
    sent = (DIGITS * (size // 10 + 1))[:size]
    assert provoked.says(sent) == sent
    assert provoked.says("A") == "A"


def test_a_stop_while_it_waits_does_not_cut_the_next_answer(provoked: Provoked) -> None:
    provoked.machine.engine.stop()
    assert provoked.says("ABC") == "ABC"


@pytest.mark.parametrize(
    ("command", "fault"),
    [
        ("r", r"read of 4 bytes at 0x90000000, no memory there, at main\+0x\w+ \(0x\w+\)"),
        ("w", r"write of 4 bytes at 0x00000100, read-only memory there, at main\+.*"),
        ("u", r"invalid instruction, at main\+.*"),
        ("b", r"breakpoint, at main\+.*"),
        ("j", r"fetch of \d bytes at 0x30000000, no memory there, at 0x30000000, called from main\+.*"),
        ("o", r"write of \d bytes at 0x1fff\w{4}, no memory there, at dig\+.*"),
    ],
)
def test_a_fault_is_one_line_and_the_images_own_handler_resets(provoked: Provoked, command: str, fault: str) -> None:
    assert provoked.says(command) == "boot"
    first, second = provoked.told
    assert re.fullmatch(f"fault: {fault}", first)
    assert re.fullmatch(r"reset: software, at (?!main)\w+\+.*", second)
    assert provoked.says("A") == "A"


def test_what_a_reset_finds_in_ram_is_what_was_there(provoked: Provoked) -> None:
    """The boot record counts in memory that start-up leaves alone."""
    assert provoked.machine.exchange(b"n") == b"\x01"
    provoked.says("s")
    provoked.says("r")
    assert provoked.machine.exchange(b"n") == b"\x03"


def test_bytes_behind_a_reset_are_lost_and_the_next_ones_are_not(provoked: Provoked) -> None:
    assert provoked.says("AsB") == "Aboot"
    assert provoked.says("C") == "C"


def test_a_reset_storm_is_an_end(provoked: Provoked) -> None:
    for _ in range(MOST_RESETS):
        provoked.says("s")
    with pytest.raises(ResetStorm, match=f"{MOST_RESETS} resets within 10 s, the last one: software"):
        provoked.says("s")


def test_resets_that_are_far_apart_are_no_storm(provoked: Provoked, monkeypatch: pytest.MonkeyPatch) -> None:
    now = time.monotonic()
    for number in range(2 * MOST_RESETS):
        monkeypatch.setattr(time, "monotonic", lambda now=now, number=number: now + 2.0 * number)
        assert provoked.says("s") == "boot"


# -- the processor ---------------------------------------------------------------------------------------------------


def test_the_processor_is_an_m4_and_no_m33(provoked: Provoked) -> None:
    """TT is an instruction of the M33, which unicorn takes silently in the mode MCLASS; an M4 does not know it."""
    provoked.says("t")
    assert provoked.told[0].startswith("fault: invalid instruction, at main+")


def test_another_model_is_refused_with_the_remedy() -> None:
    with pytest.raises(EngineError, match=r"expected a Cortex-M4 \(model 9\), got model 12: pip install"):
        refuse_other_model(9, 12)


def test_without_unicorn_the_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "unicorn", None)
    with pytest.raises(EngineError, match=r"^needs unicorn: pip install 'attitude-sil\[pil\]'$"):
        engine.Engine()


def test_interrupts_are_taken_behind_what_permits_them(provoked_image: Image) -> None:
    """CPSIE I and MSR PRIMASK are found by their code; without them a firmware that waits with interrupts off hangs."""
    code = [0xB672, 0xBF30, 0xB662, 0xF381, 0x8810, 0xF381, 0x8811]
    made = Image(provoked_image.path, ((0x40, b"".join(each.to_bytes(2, "little") for each in code)),), {}, (), {})
    assert places_that_permit(made) == [0x46, 0x4A]
    assert places_that_permit(provoked_image)


# -- hangs -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def watched(provoked: Provoked, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provoked]:
    """Under a supervisor that bites after half a second of execution."""
    monkeypatch.setattr(Watchdog, "CLOCK_HZ", 100 * Watchdog.CLOCK_HZ)
    reader, writer = os.pipe()
    with Supervisor(provoked.machine, reader):
        yield provoked
    os.close(reader)
    os.close(writer)


def test_a_hang_is_reset_by_the_watchdog(watched: Provoked) -> None:
    assert watched.says("h") == "boot"
    assert re.fullmatch(r"reset: watchdog, 0.5 s of execution without a kick, at main\+.*", watched.told[0])
    assert watched.says("A") == "A"


def test_long_work_that_kicks_is_left_alone(watched: Provoked) -> None:
    began = time.process_time()
    assert watched.says("qA") == "A"
    assert time.process_time() - began > 0.5, "or this test shows nothing"
    assert watched.told == []


def test_time_in_which_it_does_not_execute_does_not_count(watched: Provoked) -> None:
    """A firmware that waits, and a machine that is asleep or busy with others, are no hang."""
    time.sleep(0.8)
    assert watched.says("A") == "A"
    watched.machine.executing = True  # executing, as far as anybody can see, yet the process does not get the processor
    time.sleep(0.8)
    watched.machine.executing = False
    assert watched.says("A") == "A"
    assert watched.told == []


def test_the_button_resets_also_a_firmware_that_hangs(watched: Provoked) -> None:
    pressed = threading.Timer(0.1, watched.machine.ask, ["the button"])
    pressed.start()
    assert watched.says("h") == "boot"
    assert watched.told[0].startswith("reset: the button, at main+")


def test_a_signal_brings_a_firmware_that_hangs_back(provoked: Provoked) -> None:
    """The signal's number stands in the wake pipe; whoever serves looks there when exchange() returns."""
    reader, writer = os.pipe()
    pressed = threading.Timer(0.1, os.write, [writer, bytes((signal.SIGTERM,))])
    with Supervisor(provoked.machine, reader):
        pressed.start()
        assert provoked.says("h") == ""
    assert provoked.told == []
    os.close(reader)
    os.close(writer)


def test_two_machines_do_not_know_of_each_other(provoked_image: Image, provoked: Provoked) -> None:
    other = Machine(provoked_image, lambda line: None)
    assert other.power_on() == b"boot"
    assert provoked.says("A") == "A"
    assert other.exchange(b"B") == b"B"
    other.close()
