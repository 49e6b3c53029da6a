"""The board process of QEMU: python -m sil.pil.qemu --link serial:///dev/pts/N [--parent PID]. The mps2-an386 image.

It starts QEMU on the laboratory's pty, tells on standard error what QEMU tells of resets, and ends, with QEMU, when the
pty hangs up or its parent is gone.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import select
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from protocol.link import LinkError
from protocol.links.serial import parse_url
from sil.pil.qemu_machine import PR_SET_PDEATHSIG, Qemu, QemuError
from sil.pil.qmp import QmpError

MACHINE = "mps2-an386"
IMAGES = Path(__file__).parents[2] / "firmware" / "images"
EXIT_LINK = 3


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 the pty has hung up, 2 bad arguments, no image or no QEMU, 3 QEMU ended by itself."""
    options = _parser().parse_args(argv)
    if options.parent:
        _die_with(options.parent)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        path, _ = parse_url(options.link)
        record = _boot_record_address()
        line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)  # to see the hang-up; QEMU alone reads it
        qemu = Qemu(IMAGES / f"{MACHINE}.elf", MACHINE, path)
    except (LinkError, QemuError, OSError) as error:
        return _fail(str(error), 2)
    try:
        print(f"listening {options.link}", flush=True)
        sys.stdout.close()
        return _watch(qemu, line, record)
    except KeyboardInterrupt:
        return 0
    finally:
        qemu.close()


def _watch(qemu: Qemu, line: int, record: int) -> int:
    """Until the pty hangs up, or QEMU ends."""
    poller = select.poll()
    poller.register(line, 0)  # a hang-up needs no asking
    poller.register(qemu.qmp.fileno(), select.POLLIN)
    try:
        while True:
            if any(fd == line for fd, _ in poller.poll()):
                return 0
            for event in qemu.qmp.take_events():
                _tell(qemu, event, record)
    except QmpError:
        code = qemu.process.wait()
        words = qemu.last_words()
        return _fail(f"QEMU ended with {_describe(code)}{': ' if words else ''}{words}", EXIT_LINK)


def _tell(qemu: Qemu, event: dict[str, Any], record: int) -> None:
    """One line for each reset the firmware caused: by its watchdog, or by a fault."""
    if event["event"] == "WATCHDOG":
        print("the firmware hung and its watchdog bit", file=sys.stderr, flush=True)
    if event["event"] == "RESET" and event["data"].get("guest"):
        incident = qemu.boot_record(record).incident()
        print(f"the firmware was reset{': ' if incident else ''}{incident}", file=sys.stderr, flush=True)


def _boot_record_address() -> int:
    """From the manifest beside the image. Raises QemuError."""
    try:
        manifest = json.loads((IMAGES / "manifest.json").read_text(encoding="utf-8"))
        return int(manifest[MACHINE]["symbols"]["boot_record"], 16)
    except (OSError, ValueError, KeyError):
        raise QemuError(
            f"image {MACHINE}: firmware/images/manifest.json is missing or broken; renew with `make firmware`"
        ) from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="sil.pil.qemu", description="The firmware's mps2-an386 image in QEMU.")
    parser.add_argument("--link", required=True, metavar="URL", help="serial:///dev/pts/N, the board's side of a pty")
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    parser.add_argument("--once", action="store_true", help="no difference: the link's end is the end in any case")
    return parser


def _die_with(parent: int) -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        sys.exit(0)


def _describe(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _fail(line: str, code: int) -> int:
    print(line, file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
