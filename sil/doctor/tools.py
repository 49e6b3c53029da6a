"""Checks of what lies around: compilers, emulator, cyclictest, disk space, terminal."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

from sil.doctor.findings import NOTE, OK, PROBLEM, Finding, Surroundings, size_text

ASK_S = 5.0
FULL_BYTES, LOW_BYTES = 100 << 20, 1 << 30
NARROW = 80
LARGEST = ("du -sh runs/* | sort -h",)


def c_compiler(around: Surroundings) -> Finding:
    """The workstation's C compiler."""
    return program("cc", "--version", "only needed to build the board's C firmware", "sudo apt install gcc")


def arm_compiler(around: Surroundings) -> Finding:
    """The Cortex-M's C compiler."""
    install = "sudo apt install gcc-arm-none-eabi"
    return program("arm-none-eabi-gcc", "--version", "only needed to build firmware for a Cortex-M", install)


def emulator(around: Surroundings) -> Finding:
    """The emulator of a Cortex-M."""
    install = "sudo apt install qemu-system-arm"
    return program("qemu-system-arm", "--version", "only needed to run firmware without a board", install)


def cyclictest(around: Surroundings) -> Finding:
    """The usual measure of a machine's wake-ups, beside which sil bench puts its own."""
    return program("cyclictest", "--help", "optional: sil bench compares with it", "sudo apt install rt-tests")


def program(name: str, option: str, purpose: str, install: str) -> Finding:
    """Where a program is and the first line of what it says of itself; a note that it is missing."""
    path = shutil.which(name)
    if path is None:
        return Finding(NOTE, f"{name} not found", purpose, (install,), data={"path": None})
    try:
        done = subprocess.run([path, option], capture_output=True, text=True, errors="replace", timeout=ASK_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        return Finding(NOTE, f"{path} does not start: {error}", purpose, (install,), data={"path": path})
    said = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    version = said[0] if said else "says nothing of itself"
    return Finding(OK, f"{version} ({path})", data={"path": path, "version": version})


def disk(around: Surroundings) -> Finding:
    """Room for runs in the working directory."""
    return judge_disk(around, shutil.disk_usage(around.folder).free, os.access(around.folder, os.W_OK))


def judge_disk(around: Surroundings, free: int, writable: bool) -> Finding:
    """free: bytes."""
    found = f"{size_text(free)} free in {around.folder}"
    data = {"free_bytes": free, "folder": str(around.folder), "writable": writable}
    if not writable:
        advice = "runs go to ./runs: change to a directory of yours, or name one with --out"
        return Finding(NOTE, f"{around.folder} may not be written to", advice, data=data)
    if free < FULL_BYTES:
        return Finding(PROBLEM, found, "a run would fill it; what takes the room:", LARGEST, data=data)
    if free < LOW_BYTES:
        return Finding(NOTE, found, "enough for short runs; what takes the room:", LARGEST, data=data)
    return Finding(OK, found, data=data)


def terminal(around: Surroundings) -> Finding:
    """Colours, width and characters, which decide what `sil run` draws."""
    from rich.console import Console

    console = Console()
    encoding = getattr(sys.stdout, "encoding", None) or "ascii"
    return judge_terminal(console.is_terminal, console.width, console.color_system, encoding, dict(os.environ))


def judge_terminal(
    is_terminal: bool, width: int, colours: str | None, encoding: str, environment: dict[str, str]
) -> Finding:
    data = {"terminal": is_terminal, "width": width, "colours": colours, "encoding": encoding}
    if not is_terminal:
        return Finding(OK, f"none, output is plain lines ({encoding})", data=data)
    shades = {"standard": "16", "256": "256", "truecolor": "16 million"}.get(colours or "", "no")
    because = " (NO_COLOR is set)" if not colours and environment.get("NO_COLOR") else ""
    found = f"{width} columns, {shades} colours{because}, {encoding}"
    if width < NARROW:
        return Finding(NOTE, found, f"the live view wants {NARROW} columns or more", data=data)
    if "utf" not in encoding.lower():
        return Finding(
            NOTE, found, "bars and axes are drawn with plain characters", ("export LC_ALL=C.UTF-8",), data=data
        )
    return Finding(OK, found, data=data)
