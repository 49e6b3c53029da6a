"""One QEMU with one image on one serial line, from start to a certain end: what the board process and the tests share.

The laboratory holds the master of a pty and QEMU opens its other side as a serial port. So no byte is lost before
anybody listens, and QEMU's end is a hang-up to the laboratory.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import socket
import subprocess
from functools import partial
from pathlib import Path
from typing import NamedTuple

from sil.pil.hosting import PR_SET_PDEATHSIG
from sil.pil.qmp import Qmp, QmpError

PROGRAM = "qemu-system-arm"
REMEDY = f"{PROGRAM}: not found; Debian and Ubuntu: apt-get install --no-install-recommends qemu-system-arm"
BOOT_MAGIC = 0xB0A2D001
EXCEPTIONS = {1: "main() returned", 2: "its watchdog bit (NMI)", 3: "fault"}
VECTORS = 0x0  # of either machine, by address or by alias


class QemuError(Exception):
    """QEMU is not there or does not start; one line."""


class BootRecord(NamedTuple):
    """firmware/hal/cortex-m/start.h: struct boot_record."""

    magic: int
    boots: int
    exception: int
    pc: int
    status: int

    def incident(self) -> str:
        """What happened last, for people."""
        if self.magic != BOOT_MAGIC or self.exception == 0:
            return "nothing is known of the cause"
        what = EXCEPTIONS.get(self.exception, f"exception {self.exception}")
        return f"{what} at 0x{self.pc:08x}, CFSR 0x{self.status:08x}"


class Qemu:
    """A running machine. serial_path: the board's side of a pty. Raises QemuError when it does not start."""

    def __init__(self, image: Path, machine: str, serial_path: str) -> None:
        if shutil.which(PROGRAM) is None:
            raise QemuError(REMEDY)
        ours, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                _command(image, machine, serial_path, theirs.fileno()),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                pass_fds=[theirs.fileno()],
                preexec_fn=partial(_die_with, os.getpid()),
            )
        self.qmp = Qmp(ours)
        try:
            self.qmp.open()
        except QmpError as error:
            self.process.kill()
            raise QemuError(f"QEMU does not start: {self.last_words() or error}") from None

    def words(self, address: int, count: int) -> list[int]:
        """32-bit words of the machine's memory, read while it runs."""
        shown = self.qmp.run("human-monitor-command", **{"command-line": f"xp /{count}wx 0x{address:x}"})
        return [int(text, 16) for line in shown.splitlines() for text in line.partition(":")[2].split()]

    def boot_record(self) -> BootRecord:
        """Why the firmware last started: it lies just above the stack, whose top is the first of the vectors."""
        (stack_top,) = self.words(VECTORS, 1)
        return BootRecord(*self.words(stack_top, len(BootRecord._fields)))

    def last_words(self) -> str:
        """Its last complaint, "" without any. Waits for its end. A dump of registers may follow a complaint."""
        said = self.process.communicate()[1].decode(errors="replace")
        lines = [line for line in said.splitlines() if line.startswith("qemu") and "warning:" not in line]
        return lines[-1].partition(": ")[2].strip() if lines else ""

    def close(self) -> None:
        """Gone when this returns; it has nothing to save. Twice is as good as once."""
        self.process.kill()
        self.process.wait()
        self.qmp.close()
        if self.process.stderr is not None:
            self.process.stderr.close()


def _command(image: Path, machine: str, serial_path: str, qmp_fd: int) -> list[str]:
    quiet = ["-nodefaults", "-display", "none", "-monitor", "none"]
    control = ["-chardev", f"socket,id=qmp,fd={qmp_fd}", "-mon", "chardev=qmp,mode=control"]
    uart = ["-chardev", f"serial,id=uart,path={serial_path}", "-serial", "chardev:uart"]
    return [PROGRAM, "-M", machine, "-kernel", str(image), *quiet, *control, *uart]


def _die_with(parent: int) -> None:
    """Between fork and exec: whatever kills the parent kills QEMU, too. A parent may be process 1 of a container."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(0)
