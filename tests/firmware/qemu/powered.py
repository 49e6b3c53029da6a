"""A board in QEMU as these tests hold it: its frames, its memory, and an end that is certain."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

from protocol import frames
from protocol.frames import Hello, Packet, Type
from protocol.links import open_link
from protocol.port import Port
from sil.pil.qemu_machine import PROGRAM, REMEDY, BootRecord, Qemu
from tools.firmware_image import IMAGES, symbols

MACHINES = {"mps2-an386": "mps2-an386", "stm32f405": "netduinoplus2"}
BOOT_S = 5.0


def need_qemu() -> None:
    """These tests run or say why not; where CI is set they run."""
    if shutil.which(PROGRAM) is None:
        assert "CI" not in os.environ, f"CI has to have it: {REMEDY}"
        pytest.skip(REMEDY)


class Powered:
    """A machine that runs an image; `with` ends it."""

    def __init__(self, chip: str, image: Path | None = None) -> None:
        self.image = image or IMAGES / f"{chip}.elf"
        self.link = open_link("pty", listen=False)
        self.qemu = Qemu(self.image, MACHINES[chip], self.link.peer_url.removeprefix("serial://"))
        self.port = Port(self.link)
        self.symbols = symbols(self.image)

    def __enter__(self) -> Powered:
        return self

    def __exit__(self, *_: object) -> None:
        self.qemu.close()
        self.port.close()

    def next(self, within_s: float = BOOT_S) -> Packet:
        packet = self.port.receive(within_s)
        assert packet is not None, f"no frame within {within_s} s"
        return packet

    def all_within(self, seconds: float) -> list[Packet]:
        """What comes until then."""
        found, until = [], time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if (packet := self.port.receive(left)) is not None:
                found.append(packet)
        return found

    def boot_hello(self, within_s: float = BOOT_S) -> Hello:
        """The HELLO of a board that has just started, and knows of no session."""
        packet = self.next(within_s)
        hello: Hello = packet.frame
        assert packet.type == Type.HELLO
        assert (hello.nonce, hello.flags & frames.HELLO_ECHO) == (0, 0)
        return hello

    def boot_record(self) -> BootRecord:
        return self.qemu.boot_record()

    def word(self, address: int) -> int:
        """As the processor sees it: its private bus, too."""
        shown = self.qemu.qmp.run("human-monitor-command", **{"command-line": f"x /1wx 0x{address:x}"})
        return int(shown.partition(":")[2], 16)

    def function_at(self, address: int) -> str:
        """Which function this instruction is in."""
        before = {value: name for name, value in self.symbols.items() if value <= address and not name.startswith("$")}
        return before[max(before)]

    def events(self, name: str) -> list[dict[str, Any]]:
        """QMP's, since the last call."""
        return [event for event in self.qemu.qmp.take_events() if event["event"] == name]
