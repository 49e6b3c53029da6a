"""What can be known of a serial device without opening it: is it there, may we, who has it open, what drives it."""

from __future__ import annotations

import grp
import os
import stat
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from protocol.links.serial import PTY_MAJORS
from sil.doctor.findings import NOTE, OK, PROBLEM, Finding, Surroundings, user_name

RULES = "/etc/udev/rules.d/99-attitude-sil.rules"
LOW_LATENCY_RULE = 'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"'
RELOAD = "sudo udevadm control --reload-rules"
USUAL_PORTS = ("serial/by-id/*", "ttyUSB*", "ttyACM*", "ttyAMA*")
# Programs that open every new serial port to see what it is, and what keeps them from it.
CURIOUS = {"ModemManager": "sudo systemctl disable --now ModemManager", "brltty": "sudo apt remove brltty"}
OURS = ("sil", "firmware_sim")  # programs that a command may end
SHOWN_PORTS = 6
SHOWN_COMMAND = 70  # characters

Status = Callable[[Path], os.stat_result]
Access = Callable[[str, int], bool]


@dataclass(frozen=True)
class Device:
    """A device node. `named`: as the user wrote it; `real`: without symbolic links; both without the root."""

    named: str
    real: str
    status: os.stat_result

    @property
    def is_pty(self) -> bool:
        return stat.S_ISCHR(self.status.st_mode) and os.major(self.status.st_rdev) in PTY_MAJORS


class Opener(NamedTuple):
    """A process that has the device open: its name, the command it was started with, and whether it is a `sil` of
    this user's.
    """

    pid: int
    name: str
    command: str
    ours: bool


def find(around: Surroundings, path: str, status: Status = os.stat) -> Device | None:
    """The device at `path`, or None when nothing is there."""
    place = around.at(path)
    try:
        found = status(place)
        real = place.resolve()
    except (OSError, ValueError):
        return None
    root = around.root.resolve()
    return Device(path, f"/{real.relative_to(root)}" if real.is_relative_to(root) else str(real), found)


def presence(around: Surroundings, path: str, device: Device | None) -> Finding:
    """Whether it is there and a terminal device; where not, which ports are."""
    ports = ports_here(around)
    known = f"ports here: {', '.join(ports)}" if ports else "there is no USB serial port here at all"
    data = {"path": path, "ports": list(ports)}
    if device is None:
        advice = f"{known}; plug it in, and see what the kernel says"
        return Finding(PROBLEM, f"{path} does not exist", advice, ("sudo dmesg --follow",), data=data)
    if not stat.S_ISCHR(device.status.st_mode):
        return Finding(PROBLEM, f"{path} is no serial device but {_kind(device.status.st_mode)}", known, data=data)
    if not _is_terminal(around, device.status.st_rdev):
        found = f"{path} is no serial device but one that the kernel lists under no terminal driver"
        return Finding(PROBLEM, found, known, data=data)
    also = f" -> {device.real}" if device.real != path else ""
    return Finding(
        OK, f"{path}{also}{', a pseudo-terminal' if device.is_pty else ''}", data={**data, "real": device.real}
    )


def _is_terminal(around: Surroundings, rdev: int) -> bool:
    """By the kernel's table of drivers: opening it to ask would raise DTR, which resets many a board.

    True where there is no such table.
    """
    table = around.text("/proc/tty/drivers").splitlines()
    for row in table:
        major, minors = row.split()[2:4]
        first, _, last = minors.partition("-")
        if os.major(rdev) == int(major) and int(first) <= os.minor(rdev) <= int(last or first):
            return True
    return not table


def ports_here(around: Surroundings) -> tuple[str, ...]:
    """The serial ports that a board is usually on; by-id names first, since they stay when others are plugged in."""
    folder = around.at("/dev")
    paths = [path for pattern in USUAL_PORTS for path in sorted(folder.glob(pattern))]
    return tuple(f"/dev/{path.relative_to(folder)}" for path in paths[:SHOWN_PORTS])


def ports(around: Surroundings) -> Finding:
    """The serial ports that a board may be on, and whether we may use them."""
    return judge_ports(around, user_name(), os.access)


def judge_ports(around: Surroundings, user: str, access: Access) -> Finding:
    here = ports_here(around)
    if not here:
        return Finding(OK, "none of ttyUSB, ttyACM, ttyAMA", data={"ports": []})
    closed = [port for port in here if not access(str(around.at(port)), os.R_OK | os.W_OK)]
    data = {"ports": list(here), "not_permitted": closed}
    if closed:
        found = f"{', '.join(here)}; {user} may not use {', '.join(closed)}"
        return Finding(NOTE, found, "what to do about it:", (f"sil doctor --link {closed[0]}",), data=data)
    return Finding(OK, ", ".join(here), data=data)


def _kind(mode: int) -> str:
    kinds = {stat.S_IFREG: "a file", stat.S_IFDIR: "a directory", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    return kinds.get(stat.S_IFMT(mode), "something else")


# -- permission -------------------------------------------------------------------------------------------------------


def permission(around: Surroundings, device: Device, access: Access = os.access) -> Finding:
    """Whether we may read and write it; where not, which group may."""
    status, user = device.status, user_name()
    group, members = _group(status.st_gid)
    mode = f"{stat.filemode(status.st_mode)}, group {group}"
    data = {"mode": stat.filemode(status.st_mode), "group": group, "user": user}
    if access(str(around.at(device.real)), os.R_OK | os.W_OK):
        return Finding(OK, f"{user} may read and write ({mode})", data=data)
    found = f"{user} may not read and write it ({mode})"
    if not status.st_mode & stat.S_IWGRP or group == "root":
        rule = f'SUBSYSTEM=="tty", KERNEL=="{Path(device.real).name}", MODE="0660", GROUP="dialout"'
        commands = (f"echo '{rule}' | sudo tee -a {RULES}", RELOAD, f"sudo usermod -aG dialout {user}")
        return Finding(PROBLEM, found, "no group may: give it one, then plug in and log in again", commands, data=data)
    if user in members:
        advice = f"you are in group {group}, but this login began before that: log in again, or"
        return Finding(PROBLEM, found, advice, (f"newgrp {group}",), data=data)
    advice = f"join group {group}, then log in again"
    return Finding(PROBLEM, found, advice, (f"sudo usermod -aG {group} {user}",), data=data)


def _group(gid: int) -> tuple[str, list[str]]:
    try:
        entry = grp.getgrgid(gid)
    except KeyError:
        return str(gid), []
    return entry.gr_name, entry.gr_mem


# -- who has it open --------------------------------------------------------------------------------------------------


def openers(around: Surroundings, device: Device, me: int) -> Finding:
    """Other processes that have it open: two readers share the bytes between them, and neither gets a whole frame."""
    others, unseen = who_has(around, device.real, me)
    data = {"openers": [other._asdict() for other in others], "unseen_processes": unseen}
    if others:
        named = ", ".join(f"{other.command or other.name} (pid {other.pid})" for other in others)
        cures = tuple(dict.fromkeys(CURIOUS[other.name] for other in others if other.name in CURIOUS))
        ends = tuple(f"kill {other.pid}" for other in others if other.ours)
        advice = "not talking to the board: two readers would share its bytes, and HELLO would end the other's session"
        if any("firmware_sim" in other.command for other in others):
            advice, ends = "that is a board on this very end of the cable: the doctor needs the other end", ()
        return Finding(PROBLEM, f"open in {named}", advice, (*cures, *ends), data=data)
    if unseen:
        found = f"nobody of ours; {unseen} processes of other users do not let us look"
        return Finding(OK, found, "", (), data=data)
    return Finding(OK, "nobody else has it open", data=data)


def who_has(around: Surroundings, real: str, me: int) -> tuple[list[Opener], int]:
    """(processes other than `me` with `real` open, how many did not let us look)."""
    found, unseen = [], 0
    for process in sorted(around.at("/proc").glob("[0-9]*"), key=lambda path: int(path.name)):
        if int(process.name) == me:
            continue
        try:
            handles = list((process / "fd").iterdir())
        except PermissionError:
            unseen += 1
            continue
        except OSError:  # it ended meanwhile
            continue
        if any(_target(handle) == real for handle in handles):
            name = around.text(f"/proc/{process.name}/comm") or "?"
            words = around.text(f"/proc/{process.name}/cmdline").rstrip("\0").split("\0")
            ours = _owner(process) == os.getuid() and _is_sil(words)
            found.append(Opener(int(process.name), name, _shortened(" ".join(words)), ours))
    return found, unseen


def _owner(process: Path) -> int | None:
    try:
        return process.stat().st_uid
    except OSError:  # it ended meanwhile
        return None


def _is_sil(words: Sequence[str]) -> bool:
    """Whether this command is the laboratory or its board: `sil ...`, `python .../sil ...`, `python -m sil ...`."""
    started = [*words, ""]
    if not Path(started[0]).name.startswith("python"):
        return Path(started[0]).name in OURS
    if "-m" in started:
        return started[started.index("-m") + 1] in OURS
    script = next((word for word in started[1:] if not word.startswith("-")), "")
    return Path(script).name in OURS


def _shortened(command: str) -> str:
    return command if len(command) <= SHOWN_COMMAND else f"{command[: SHOWN_COMMAND - 3]}..."


def _target(handle: Path) -> str:
    try:
        return os.readlink(handle)
    except OSError:
        return ""


# -- driver -----------------------------------------------------------------------------------------------------------


def driver(around: Surroundings, device: Device) -> Finding:
    """What drives it: USB adapter and its chip, or a UART of this machine."""
    if device.is_pty:
        return Finding(OK, "none: a pseudo-terminal has no baud rate, no modem lines and no line errors")
    name = Path(device.real).name
    entry = around.at(f"/sys/class/tty/{name}/device")
    link = entry / "driver"
    driven_by = link.resolve().name if link.exists() else ""
    usb = _usb(entry.resolve(), around.at("/sys").resolve())
    data: dict[str, Any] = {"driver": driven_by, **usb}
    kind = around.text(f"/sys/class/tty/{name}/type")
    if not usb and kind == "0":
        advice = "the kernel keeps a place for a port that the machine does not have: choose another one"
        return Finding(PROBLEM, f"{driven_by or 'serial'}: no UART behind {device.real}", advice, data=data)
    said = " ".join(filter(None, (usb.get("manufacturer"), usb.get("product"), usb.get("id"), usb.get("serial"))))
    found = ", ".join(filter(None, (driven_by or "driver not ours to see", said and f"USB {said}")))
    return Finding(OK, found, data=data)


def _usb(place: Path, top: Path) -> dict[str, str]:
    """What the USB device above `place` says of itself; empty when there is none."""
    for folder in (place, *place.parents):
        if folder == top:
            break
        if (folder / "idVendor").is_file():
            said = {name: _said(folder / name) for name in ("manufacturer", "product", "serial")}
            return {**said, "id": f"{_said(folder / 'idVendor')}:{_said(folder / 'idProduct')}"}
    return {}


def _said(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""


def latency(around: Surroundings, device: Device) -> Finding | None:
    """How long a USB adapter keeps bytes back; None where there is no such timer."""
    name = Path(device.real).name
    timer = f"/sys/class/tty/{name}/device/latency_timer"
    value_ms = around.number(timer)
    if value_ms is None:
        return None
    found = f"{value_ms} ms: the adapter keeps what it received for so long, unless its buffer fills"
    data = {"latency_timer_ms": value_ms}
    if value_ms <= 1:
        return Finding(OK, f"{value_ms} ms", data=data)
    commands = (f"echo 1 | sudo tee {timer}", f"echo '{LOW_LATENCY_RULE}' | sudo tee -a {RULES}", RELOAD)
    advice = "every answer comes up to that much later. Now, and for ever after (then plug it in again):"
    return Finding(NOTE, found, advice, commands, data=data)
