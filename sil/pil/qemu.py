"""The board in QEMU: python -m sil.pil.qemu --link serial:///dev/pts/N [--parent PID] [--chip NAME] [--image FILE].

It starts QEMU on the laboratory's pty and ends, with QEMU, when the pty hangs up. Standard error says what happens to
the firmware: faults, a watchdog that bit. SIGUSR1 is the reset button, and SIGTERM pulls the plug.
"""

from __future__ import annotations

import argparse
import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from protocol.link import LinkError
from protocol.links.serial import parse_url
from sil.pil.hosting import EXIT_LINK, EXIT_USAGE, die_with, fail, say_listening, take_stdout, wake_pipe
from sil.pil.qemu_machine import Qemu, QemuError
from sil.pil.qmp import QmpError

NAME = "qemu"
MACHINES = {"mps2-an386": "mps2-an386", "stm32f405": "netduinoplus2"}  # chip: what QEMU calls a board with it
IMAGES = Path(__file__).resolve().parents[2] / "firmware" / "images"
REMEDY = "build it with `make firmware`"
END_S = 2.0


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 the pty has hung up, or told to end; 2 bad arguments, no image or no QEMU; 3 no such link, or QEMU
    ended by itself."""
    options = _parser().parse_args(argv)
    if options.parent:
        die_with(options.parent)
    stdout = take_stdout()
    image = options.image or IMAGES / f"{options.chip}.elf"
    if (refusal := _refusal(image)) is not None:
        return fail(f"{NAME}: {image}: {refusal}: {REMEDY}", EXIT_USAGE)
    wake = wake_pipe(signal.SIGUSR1, signal.SIGTERM, signal.SIGINT)
    try:
        path, _ = parse_url(options.link)
        line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)  # to see the hang-up; QEMU alone reads it
        qemu = Qemu(image, MACHINES[options.chip], path)
    except (LinkError, OSError) as error:
        return fail(f"{NAME}: {error}", EXIT_LINK)
    except QemuError as error:
        return fail(f"{NAME}: {error}", EXIT_USAGE)
    try:
        say_listening(stdout, options.link)
        return _watch(qemu, line, wake)
    finally:
        qemu.close()


def _refusal(image: Path) -> str | None:
    """Why QEMU need not try: it would run any file there is."""
    try:
        with image.open("rb") as file:
            return None if file.read(4) == b"\x7fELF" else "expected an ELF image, got another file"
    except OSError as error:
        return "no such image" if isinstance(error, FileNotFoundError) else f"cannot read: {error.strerror}"


def _watch(qemu: Qemu, line: int, wake: int) -> int:
    """Until the pty hangs up, a signal says so, or QEMU ends."""
    poller = select.poll()
    poller.register(line, 0)  # a hang-up needs no asking
    poller.register(wake, select.POLLIN)
    poller.register(qemu.qmp.fileno(), select.POLLIN)
    try:
        while True:
            ready = [fd for fd, _ in poller.poll()]
            if line in ready or (wake in ready and _plug_pulled(qemu, wake)):
                return 0
            for event in qemu.qmp.take_events():
                _tell(qemu, event)
    except QmpError as error:
        return fail(f"{NAME}: {_why(qemu, error)}", EXIT_LINK)


def _why(qemu: Qemu, error: QmpError) -> str:
    """What became of QEMU: its end, which is a moment behind that of its channel; of one that lives on, the error."""
    try:
        code = qemu.process.wait(END_S)
    except subprocess.TimeoutExpired:
        return str(error)
    words = qemu.last_words()
    return f"it ended with {_describe(code)}{': ' if words else ''}{words}"


def _plug_pulled(qemu: Qemu, wake: int) -> bool:
    """Which signals have come: SIGUSR1 presses the reset button, any other ends this process."""
    numbers = os.read(wake, 64)
    if signal.SIGUSR1 in numbers:
        qemu.qmp.run("system_reset")
    return any(number != signal.SIGUSR1 for number in numbers)


def _tell(qemu: Qemu, event: dict[str, Any]) -> None:
    """One line for each reset, with what the firmware itself has kept of the incident."""
    if event["event"] != "RESET":
        return
    incident = qemu.boot_record().incident() if event["data"].get("guest") else "the button was pressed (SIGUSR1)"
    print(f"{NAME}: the firmware was reset: {incident}", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sil.pil.qemu",
        description="The firmware's image in QEMU; its UART is the link. For lockstep: its time is not yours.",
        epilog="examples: --link serial:///dev/pts/7   --link serial:///dev/pts/7 --chip stm32f405",
    )
    parser.add_argument("--link", required=True, metavar="URL", help="serial:///dev/pts/N, the board's side of a pty")
    parser.add_argument("--chip", choices=MACHINES, default="mps2-an386", help="default: %(default)s")
    parser.add_argument("--image", type=Path, metavar="FILE", help="an image of your own; default: the one that ships")
    parser.add_argument("--once", action="store_true", help="no difference: it ends with its link in any case")
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    return parser


def _describe(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


if __name__ == "__main__":
    sys.exit(main())
