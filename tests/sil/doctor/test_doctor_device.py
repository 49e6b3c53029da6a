"""What the doctor says of a serial device before it opens it: there or not, whose, open elsewhere, driver, latency."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from fake_machine import character_device, machine

from sil.doctor import NOTE, OK, PROBLEM, Surroundings, device
from sil.doctor.device import Device

USB0 = "/dev/ttyUSB0"
USB_PLACE = "sys/devices/pci0/usb1/1-2/1-2:1.0/ttyUSB0"


def usb_adapter(root: Path, **more: str) -> Surroundings:
    """An FTDI adapter as /sys shows it."""
    files = {
        f"/{USB_PLACE}/latency_timer": "16\n",
        "/sys/devices/pci0/usb1/1-2/idVendor": "0403\n",
        "/sys/devices/pci0/usb1/1-2/idProduct": "6001\n",
        "/sys/devices/pci0/usb1/1-2/manufacturer": "FTDI\n",
        "/sys/devices/pci0/usb1/1-2/product": "FT232R USB UART\n",
        "/sys/devices/pci0/usb1/1-2/serial": "A50285BI\n",
        "/sys/bus/usb-serial/drivers/ftdi_sio/uevent": "",
        "/sys/class/tty/ttyUSB0/uevent": "",
        USB0: "",
        **more,
    }
    around = machine(root, files)
    (root / "sys/class/tty/ttyUSB0/device").symlink_to(root / USB_PLACE)
    (root / USB_PLACE / "driver").symlink_to(root / "sys/bus/usb-serial/drivers/ftdi_sio")
    return around


def usb(mode: int = 0o660, gid: int = 0) -> Device:
    return Device(USB0, USB0, character_device(mode, gid))


# -- there? -----------------------------------------------------------------------------------------------------------


def test_a_path_that_is_not_there_names_the_ports_that_are(tmp_path: Path) -> None:
    around = machine(tmp_path, {"/dev/ttyACM0": "", "/dev/serial/by-id/usb-FTDI_A5-if00-port0": ""})
    found = device.presence(around, "/dev/ttyUSB9", device.find(around, "/dev/ttyUSB9"))
    assert found.status == PROBLEM
    assert found.found == "/dev/ttyUSB9 does not exist"
    assert "/dev/serial/by-id/usb-FTDI_A5-if00-port0, /dev/ttyACM0" in found.advice


def test_a_file_is_no_serial_device(tmp_path: Path) -> None:
    around = machine(tmp_path, {USB0: ""})
    found = device.presence(around, USB0, device.find(around, USB0))
    assert (found.status, found.found) == (PROBLEM, "/dev/ttyUSB0 is no serial device but a file")


def test_a_device_that_is_no_terminal_is_a_problem_before_anybody_asks_who_has_it_open(tmp_path: Path) -> None:
    """Protects: `--link /dev/null`, which half of all processes have open."""
    drivers = "pty_slave /dev/pts 136 0-1048575 pty:slave\n/dev/tty /dev/tty 5 0 system:/dev/tty\n"
    around = machine(tmp_path, {"/proc/tty/drivers": drivers})

    def status(rdev: int) -> str:
        return device.presence(around, "/dev/x", Device("/dev/x", "/dev/x", character_device(rdev=rdev))).status

    assert status(os.makedev(1, 3)) == PROBLEM
    assert status(os.makedev(5, 1)) == PROBLEM
    assert status(os.makedev(5, 0)) == status(os.makedev(136, 77)) == OK


def test_a_name_by_id_leads_to_the_device(tmp_path: Path) -> None:
    around = machine(tmp_path, {USB0: ""})
    by_id = tmp_path / "dev/serial/by-id/usb-FTDI"
    by_id.parent.mkdir(parents=True)
    by_id.symlink_to("../../ttyUSB0")
    known = device.find(around, "/dev/serial/by-id/usb-FTDI", lambda path: character_device())
    assert known is not None
    assert (known.real, known.is_pty) == (USB0, False)
    found = device.presence(around, known.named, known)
    assert (found.status, found.found) == (OK, "/dev/serial/by-id/usb-FTDI -> /dev/ttyUSB0")


def test_ports_that_may_not_be_used_are_a_note(tmp_path: Path) -> None:
    around = machine(tmp_path, {USB0: "", "/dev/ttyACM0": ""})
    assert device.judge_ports(around, "ada", lambda path, mode: True).status == OK
    found = device.judge_ports(around, "ada", lambda path, mode: "ACM" in path)
    assert (found.status, found.commands) == (NOTE, ("sil doctor --link /dev/ttyUSB0",))
    assert device.judge_ports(machine(tmp_path / "empty"), "ada", os.access).status == OK


# -- permission -------------------------------------------------------------------------------------------------------


@pytest.fixture
def ada(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "user_name", lambda: "ada")
    groups = {20: ("dialout", ["bob"]), 21: ("uucp", ["ada"]), 0: ("root", [])}
    monkeypatch.setattr(device, "_group", lambda gid: groups[gid])


def no(path: str, mode: int) -> bool:
    return False


@pytest.mark.usefixtures("ada")
def test_permission_granted(tmp_path: Path) -> None:
    found = device.permission(machine(tmp_path), usb(gid=20), lambda path, mode: path.endswith(USB0))
    assert (found.status, found.found) == (OK, "ada may read and write (crw-rw----, group dialout)")


@pytest.mark.usefixtures("ada")
def test_permission_denied_names_the_group_to_join_and_the_command(tmp_path: Path) -> None:
    found = device.permission(machine(tmp_path), usb(gid=20), no)
    assert found.status == PROBLEM
    assert found.found == "ada may not read and write it (crw-rw----, group dialout)"
    assert found.commands == ("sudo usermod -aG dialout ada",)


@pytest.mark.usefixtures("ada")
def test_a_group_joined_after_the_login_needs_no_second_joining(tmp_path: Path) -> None:
    found = device.permission(machine(tmp_path), usb(gid=21), no)
    assert (found.status, found.commands) == (PROBLEM, ("newgrp uucp",))


@pytest.mark.usefixtures("ada")
@pytest.mark.parametrize(("mode", "gid"), [(0o600, 20), (0o660, 0)])
def test_a_device_of_no_useful_group_gets_a_rule(tmp_path: Path, mode: int, gid: int) -> None:
    found = device.permission(machine(tmp_path), usb(mode, gid), no)
    assert found.status == PROBLEM
    assert 'KERNEL=="ttyUSB0", MODE="0660", GROUP="dialout"' in found.commands[0]
    assert found.commands[-1] == "sudo usermod -aG dialout ada"


# -- openers ----------------------------------------------------------------------------------------------------------


def process(root: Path, pid: int, name: str, command: str, *targets: str) -> None:
    folder = root / "proc" / str(pid)
    (folder / "fd").mkdir(parents=True)
    (folder / "comm").write_text(name + "\n")
    (folder / "cmdline").write_text(command.replace(" ", "\0") + "\0")
    for number, target in enumerate(targets):
        (folder / "fd" / str(number)).symlink_to(target)


def test_who_has_it_open_is_named_with_pid_and_command(tmp_path: Path) -> None:
    around = machine(tmp_path)
    process(tmp_path, 7, "screen", "screen /dev/ttyUSB0 115200", "/dev/null", USB0)
    process(tmp_path, 8, "bash", "bash", "/dev/null")
    process(tmp_path, 99, "sil", "sil doctor", USB0)
    found = device.openers(around, usb(), me=99)
    assert found.status == PROBLEM
    assert found.found == "open in screen /dev/ttyUSB0 115200 (pid 7)"
    assert found.commands == (), "somebody else's work: named, never ended"


@pytest.mark.parametrize(
    ("command", "commands"),
    [
        ("/venv/bin/python -P -m sil run it", ("kill 7",)),
        ("/venv/bin/python3.12 /venv/bin/sil run it", ("kill 7",)),
        ("sil doctor --link /dev/ttyUSB0", ("kill 7",)),
        ("vim sil", ()),
        ("python -m serial.tools.miniterm sil", ()),
        ("python", ()),
        ("", ()),
    ],
)
def test_only_our_own_programs_come_with_a_kill(tmp_path: Path, command: str, commands: tuple[str, ...]) -> None:
    """Protects: a command that is pasted without a thought ends nobody else's work."""
    process(tmp_path, 7, "it", command, USB0)
    assert device.openers(machine(tmp_path), usb(), me=99).commands == commands


def test_a_laboratory_of_another_user_is_only_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: a bench that several people share."""
    process(tmp_path, 7, "sil", "sil run it", USB0)
    monkeypatch.setattr(device.os, "getuid", lambda: tmp_path.stat().st_uid + 1)
    found = device.openers(machine(tmp_path), usb(), me=99)
    assert (found.found, found.commands) == ("open in sil run it (pid 7)", ())


def test_a_program_that_probes_ports_is_switched_off_not_killed(tmp_path: Path) -> None:
    process(tmp_path, 7, "ModemManager", "/usr/sbin/ModemManager", USB0)
    found = device.openers(machine(tmp_path), usb(), me=99)
    assert found.commands == ("sudo systemctl disable --now ModemManager",)


def test_a_board_on_the_same_end_is_told_apart(tmp_path: Path) -> None:
    process(tmp_path, 7, "python", f"python -m firmware_sim --link serial://{USB0}", USB0)
    found = device.openers(machine(tmp_path), usb(), me=99)
    assert found.status == PROBLEM
    assert "needs the other end" in found.advice
    assert found.commands == ()


def test_nobody_has_it_open(tmp_path: Path) -> None:
    process(tmp_path, 8, "bash", "bash", "/dev/null")
    assert device.openers(machine(tmp_path), usb(), me=99).status == OK


def test_a_process_that_does_not_let_us_look_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process(tmp_path, 8, "secret", "secret", USB0)
    whole = Path.iterdir

    def iterdir(self: Path) -> object:
        if self.name == "fd":
            raise PermissionError
        return whole(self)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    found = device.openers(machine(tmp_path), usb(), me=99)
    assert (found.status, found.data["unseen_processes"]) == (OK, 1)


# -- driver and latency -----------------------------------------------------------------------------------------------


def test_usb_adapter_is_named_with_its_driver(tmp_path: Path) -> None:
    found = device.driver(usb_adapter(tmp_path), usb())
    assert (found.status, found.found) == (OK, "ftdi_sio, USB FTDI FT232R USB UART 0403:6001 A50285BI")


def test_a_port_without_a_uart_is_a_problem(tmp_path: Path) -> None:
    around = machine(tmp_path, {"/sys/class/tty/ttyS3/type": "0\n"})
    found = device.driver(around, Device("/dev/ttyS3", "/dev/ttyS3", character_device()))
    assert found.status == PROBLEM
    assert "no UART behind /dev/ttyS3" in found.found


def test_a_pty_has_no_driver(tmp_path: Path) -> None:
    known = Device("/dev/pts/3", "/dev/pts/3", character_device(rdev=os.makedev(136, 3)))
    assert known.is_pty
    assert stat.S_ISCHR(known.status.st_mode)
    assert device.driver(machine(tmp_path), known).found.startswith("none: a pseudo-terminal")


def test_a_long_latency_timer_comes_with_the_udev_line(tmp_path: Path) -> None:
    found = device.latency(usb_adapter(tmp_path), usb())
    assert found is not None
    assert found.status == NOTE
    assert found.found.startswith("16 ms")
    assert found.commands[0] == "echo 1 | sudo tee /sys/class/tty/ttyUSB0/device/latency_timer"
    assert 'DRIVER=="ftdi_sio", ATTR{latency_timer}="1"' in found.commands[1]


def test_a_short_latency_timer_is_fine_and_others_have_none(tmp_path: Path) -> None:
    around = usb_adapter(tmp_path, **{f"/{USB_PLACE}/latency_timer": "1\n"})
    found = device.latency(around, usb())
    assert found is not None
    assert (found.status, found.found) == (OK, "1 ms")
    assert device.latency(machine(tmp_path / "other"), usb()) is None
