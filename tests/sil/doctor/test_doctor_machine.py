"""The doctor's checks of a machine: each says what it must of the machine that a tree of files describes."""

from __future__ import annotations

import gzip
import os
import resource
import sys
import threading
import time
from errno import EPERM
from pathlib import Path

import pytest
from fake_machine import machine

from sil import doctor
from sil.doctor import CHECKS, NOTE, OK, PROBLEM, Finding, Surroundings, bounded, examine, tools
from sil.doctor import machine as checks
from sil.doctor.findings import size_text
from sil.plugins import UnknownPlugin, load

DYNAMIC = "Linux version 6.1.0 (somebody@host) #1 SMP PREEMPT_DYNAMIC"


# -- the registry -----------------------------------------------------------------------------------------------------


def test_every_check_loads_says_what_it_is_and_finds_something() -> None:
    """On the machine that runs the tests, whatever it is: every check comes back with a line of its own."""
    findings = list(examine(Surroundings()))
    assert [finding.check for finding in findings] == list(CHECKS)
    for finding in findings:
        assert load(CHECKS, "check", finding.check).__doc__
        assert finding.status in (OK, NOTE, PROBLEM)
        assert finding.found
        assert "\n" not in finding.found + finding.advice + "".join(finding.commands)
        assert "this check failed" not in finding.found, finding


def test_a_check_that_raises_is_a_finding_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CHECKS, "python", "sil.doctor.no_such_file:python")
    broken, whole = examine(Surroundings(), ("python", "disk"))
    assert (broken.status, broken.check) == (PROBLEM, "python")
    assert "ModuleNotFoundError" in broken.found
    assert whole.check == "disk"


def test_a_check_that_calls_exit_does_not_end_the_doctor() -> None:
    found = bounded("it", lambda: sys.exit("bye"), 1.0)
    assert (found.status, found.found) == (PROBLEM, "this check failed: SystemExit: bye")


def test_a_check_that_hangs_is_left_behind() -> None:
    let_go, told = threading.Event(), []
    began = time.monotonic()
    found = bounded("it", lambda: Finding(OK, str(let_go.wait(60))), 0.05, told.append)
    assert time.monotonic() - began < 30
    let_go.set()
    assert found.status == PROBLEM
    assert "did not come back within 0.05 s" in found.found
    assert told == ["checking it"]


def test_an_unknown_check_is_named() -> None:
    with pytest.raises(UnknownPlugin, match=r"^check: expected one of arm compiler, .* got 'pyhton'$"):
        list(examine(Surroundings(), ["pyhton"]))
    assert "pyhton" not in doctor.CHECKS


# -- processors, kernel, timers, hypervisor ---------------------------------------------------------------------------


def test_processors_that_keep_their_speed(tmp_path: Path) -> None:
    governors = {f"/sys/devices/system/cpu/cpu{n}/cpufreq/scaling_governor": "performance\n" for n in range(4)}
    found = checks.judge_processors(
        machine(tmp_path, {**governors, "/proc/loadavg": "0.10 0.2 0.3 1/2 3"}), [0, 1, 2, 3]
    )
    assert found.status == OK
    assert found.found == "4 CPUs, load 0.10, performance on 4"


@pytest.mark.parametrize(
    ("files", "cpus", "says"),
    [
        ({"/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "powersave"}, [0, 1], "powersave on 1"),
        ({"/sys/fs/cgroup/cpu.max": "150000 100000"}, [0, 1], "quota 1.5 CPUs"),
        ({"/proc/loadavg": "7.50 1 1 1/1 1"}, [0, 1], "load 7.50"),
        ({}, [0], "1 CPU,"),
    ],
)
def test_processors_that_are_worth_a_note(tmp_path: Path, files: dict[str, str], cpus: list[int], says: str) -> None:
    found = checks.judge_processors(machine(tmp_path, files), cpus)
    assert found.status == NOTE
    assert says in found.found
    assert found.advice


@pytest.mark.parametrize(
    ("files", "quota"),
    [
        ({"/proc/self/cgroup": "0::/user.slice/it", "/sys/fs/cgroup/user.slice/it/cpu.max": "50000 100000"}, 0.5),
        (
            {
                "/proc/self/cgroup": "0::/a/b",
                "/sys/fs/cgroup/a/cpu.max": "100000 100000",
                "/sys/fs/cgroup/a/b/cpu.max": "max 100000",
            },
            1.0,
        ),
        ({"/sys/fs/cgroup/cpu/cpu.cfs_quota_us": "150000", "/sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000"}, 1.5),
        (
            {
                "/proc/self/cgroup": "9:name=systemd:/x\n4:cpu,cpuacct:/docker/it\n0::/",
                "/sys/fs/cgroup/cpu/docker/it/cpu.cfs_quota_us": "25000",
                "/sys/fs/cgroup/cpu/docker/it/cpu.cfs_period_us": "100000",
            },
            0.25,
        ),
        ({"/sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1", "/sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000"}, None),
        ({"/proc/self/cgroup": "nonsense\n0::/a", "/sys/fs/cgroup/a/cpu.max": "max 100000"}, None),
    ],
)
def test_the_tightest_control_group_counts(tmp_path: Path, files: dict[str, str], quota: float | None) -> None:
    """Protects: a service or a container of either version of control groups that may not use what it sees."""
    assert checks.judge_processors(machine(tmp_path, files), [0, 1]).data["quota_cpus"] == quota


@pytest.mark.parametrize(
    ("runtime", "period", "says"),
    [
        ("-1", "1000000", "hangs stops its CPU for good"),
        ("1000000", "1000000", "hangs stops its CPU for good"),
        ("100000", "1000000", "are stopped when they had 0.1 of a CPU"),
        ("950000", "1000000", ""),
    ],
)
def test_an_unusual_limit_of_real_time_processes_is_a_note(
    tmp_path: Path, runtime: str, period: str, says: str
) -> None:
    files = {"/proc/sys/kernel/sched_rt_runtime_us": runtime, "/proc/sys/kernel/sched_rt_period_us": period}
    found = checks.kernel(machine(tmp_path, {**files, "/proc/version": "Linux version 6.1.0 #1 SMP PREEMPT Mon"}))
    assert found.status == (NOTE if says else OK)
    assert says in found.advice
    assert found.commands == (("sudo sysctl kernel.sched_rt_runtime_us=950000",) if says else ())
    assert (runtime in found.found) == bool(says)


@pytest.mark.parametrize(
    ("files", "status", "says"),
    [
        ({"/proc/version": "Linux version 6.1.0-rt #1 SMP PREEMPT_RT"}, OK, "full real time"),
        ({"/proc/version": "Linux version 6.1.0 #1 SMP", "/sys/kernel/realtime": "1\n"}, OK, "full real time"),
        ({"/proc/version": DYNAMIC, "/sys/kernel/debug/sched/preempt": "none (voluntary) full"}, NOTE, "voluntary"),
        ({"/proc/version": DYNAMIC, "/proc/cmdline": "quiet preempt=full"}, OK, "preemption: full"),
        ({"/proc/version": DYNAMIC, "/boot/config-6.1.0": "CONFIG_PREEMPT_NONE=y\n"}, NOTE, "none (as built)"),
        ({"/proc/version": DYNAMIC, "/boot/config-6.1.0": "CONFIG_PREEMPT=y\nCONFIG_PREEMPT_RCU=y\n"}, OK, "full (as"),
        ({"/proc/version": DYNAMIC}, OK, "chosen at boot"),
        ({"/proc/version": "Linux version 6.1.0 #1 SMP PREEMPT Mon"}, OK, "preemption: full"),
        ({"/proc/version": "Linux version 6.1.0 #1 SMP Mon"}, NOTE, "voluntary or none"),
        ({}, NOTE, "?"),
    ],
)
def test_kernel(tmp_path: Path, files: dict[str, str], status: str, says: str) -> None:
    found = checks.kernel(machine(tmp_path, files))
    assert found.status == status
    assert says in found.found


def test_kernel_configuration_may_be_packed(tmp_path: Path) -> None:
    around = machine(tmp_path, {"/proc/version": DYNAMIC})
    (tmp_path / "proc/config.gz").write_bytes(gzip.compress(b"CONFIG_PREEMPT_VOLUNTARY=y\n"))
    assert "voluntary (as built)" in checks.kernel(around).found
    (tmp_path / "proc/config.gz").write_bytes(b"\x1f\x8b garbage")
    assert "chosen at boot" in checks.kernel(around).found


def test_a_slow_clock_source_comes_with_the_command_for_a_better_one(tmp_path: Path) -> None:
    folder = "/sys/devices/system/clocksource/clocksource0"
    around = machine(
        tmp_path,
        {f"{folder}/current_clocksource": "hpet\n", f"{folder}/available_clocksource": "hpet tsc acpi_pm\n"},
    )
    found = checks.judge_timers(around, 50_000)
    assert found.status == NOTE
    assert found.commands == (f"echo tsc | sudo tee {folder}/current_clocksource",)


def test_timer_slack_is_told_in_microseconds(tmp_path: Path) -> None:
    around = machine(tmp_path, {"/sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc"})
    found = checks.judge_timers(around, 50_000)
    assert (found.status, found.found) == (OK, "clock source tsc, timer slack 50 us (realtime: 1 ns)")


def test_hypervisor_and_container_are_told_apart(tmp_path: Path) -> None:
    bare = machine(tmp_path / "bare", {"/proc/cpuinfo": "flags\t\t: fpu vme\n"})
    assert checks.hypervisor(bare).status == OK
    guest = {"/proc/cpuinfo": "flags\t\t: fpu hypervisor\n", "/sys/class/dmi/id/product_name": "KVM", "/.dockerenv": ""}
    found = checks.hypervisor(machine(tmp_path / "guest", guest))
    assert found.status == NOTE
    assert found.found.startswith("container on virtual machine (KVM)")


# -- permissions ------------------------------------------------------------------------------------------------------


def refuses(priority: int) -> OSError | None:
    return OSError(EPERM, "Operation not permitted")


def test_real_time_refused_comes_with_the_line_for_limits_conf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "user_name", lambda: "ada")
    found = checks.judge_real_time(machine(tmp_path), 0, refuses)
    assert found.status == NOTE
    assert "Operation not permitted; RLIMIT_RTPRIO 0" in found.found
    assert found.commands == ("echo 'ada - rtprio 99' | sudo tee -a /etc/security/limits.d/attitude-sil.conf",)


def test_in_a_container_its_owner_gives_the_permission(tmp_path: Path) -> None:
    found = checks.judge_real_time(machine(tmp_path, {"/run/.containerenv": ""}), 0, refuses)
    assert found.commands == ("docker run --cap-add=SYS_NICE --ulimit rtprio=99 ...",)


def test_real_time_granted_says_by_what(tmp_path: Path) -> None:
    by_limit = checks.judge_real_time(machine(tmp_path / "a"), 99, lambda priority: None)
    assert (by_limit.status, by_limit.found) == (OK, "SCHED_FIFO granted, clock.priority up to 99 (RLIMIT_RTPRIO 99)")
    files = {"/proc/self/status": "Name:\tsil\nCapEff:\t0000000000800000\n"}
    by_capability = checks.judge_real_time(machine(tmp_path / "b", files), 0, lambda priority: None)
    assert by_capability.found == "SCHED_FIFO granted, clock.priority up to 99 (CAP_SYS_NICE)"


@pytest.mark.parametrize(("limit", "tried"), [(20, 20), (50, 50), (99, 50), (resource.RLIM_INFINITY, 50), (0, 1)])
def test_a_low_limit_is_tried_as_it_is(tmp_path: Path, limit: int, tried: int) -> None:
    """Protects: `rtprio 20` permits a priority of 20, though not one of 50."""
    asked: list[int] = []
    found = checks.judge_real_time(machine(tmp_path), limit, asked.append)  # type: ignore[arg-type]
    assert asked == [tried]
    assert found.data["highest"] == (99 if limit < 0 else max(1, limit))


def test_the_priority_is_tried_as_a_run_asks_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: an ordinary user, who may set SCHED_RESET_ON_FORK and may never clear it again."""
    asked: list[int] = []
    monkeypatch.setattr(checks.os, "sched_setscheduler", lambda pid, policy, parameters: asked.append(policy))
    assert checks.try_fifo(20) is None
    before = os.sched_getscheduler(0)
    assert asked == [os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, before | os.SCHED_RESET_ON_FORK]


@pytest.mark.parametrize(
    ("limit", "capabilities", "tried", "status"),
    [
        (8 << 20, "0", False, NOTE),
        (64 << 30, "0", False, NOTE),
        (resource.RLIM_INFINITY, "0", True, OK),
        (8 << 20, "4000", True, OK),
        (8 << 20, "0", True, NOTE),
    ],
)
def test_locked_memory(tmp_path: Path, limit: int, capabilities: str, tried: bool, status: str) -> None:
    """A run locks all of its memory or none; root without the capability (a container) is told, too."""
    around = machine(tmp_path, {"/proc/self/status": f"CapEff:\t{capabilities}\n"})
    found = checks.judge_locked_memory(around, limit, tried)
    assert found.status == status
    assert bool(found.commands) == (status == NOTE)


# -- tools ------------------------------------------------------------------------------------------------------------


def test_a_program_that_is_missing_comes_with_its_package() -> None:
    found = tools.program("no-such-compiler", "--version", "only needed to", "sudo apt install it")
    assert (found.status, found.commands) == (NOTE, ("sudo apt install it",))


def test_a_program_that_is_there_says_its_version() -> None:
    found = tools.program("python3", "--version", "", "")
    assert found.status == OK
    assert found.data["version"].startswith("Python 3")


def test_a_program_that_hangs_is_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "stuck"
    script.write_text("#!/bin/sh\nexec sleep 60\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setattr(tools, "ASK_S", 0.1)
    found = tools.program("stuck", "--version", "optional", "sudo apt install it")
    assert found.status == NOTE
    assert "does not start" in found.found


@pytest.mark.parametrize(
    ("free", "writable", "status"),
    [(1 << 40, True, OK), (500 << 20, True, NOTE), (50 << 20, True, PROBLEM), (1 << 40, False, NOTE)],
)
def test_disk(tmp_path: Path, free: int, writable: bool, status: str) -> None:
    found = tools.judge_disk(machine(tmp_path), free, writable)
    assert found.status == status
    assert found.commands == (("du -sh runs/* | sort -h",) if writable and status != OK else ())


@pytest.mark.parametrize(
    ("width", "colours", "encoding", "environment", "status", "says"),
    [
        (100, "256", "utf-8", {}, OK, "100 columns, 256 colours, utf-8"),
        (100, None, "utf-8", {"NO_COLOR": "1"}, OK, "no colours (NO_COLOR is set)"),
        (60, "truecolor", "utf-8", {}, NOTE, "60 columns"),
        (100, "standard", "ascii", {}, NOTE, "ascii"),
    ],
)
def test_terminal(
    width: int, colours: str | None, encoding: str, environment: dict[str, str], status: str, says: str
) -> None:
    found = tools.judge_terminal(True, width, colours, encoding, environment)
    assert found.status == status
    assert says in found.found


@pytest.mark.parametrize(
    ("count", "text"),
    [(0, "0 bytes"), (1023, "1023 bytes"), (1536, "1.5 KiB"), (30 << 20, "30 MiB"), (5 << 40, "5.0 TiB")],
)
def test_size(count: int, text: str) -> None:
    assert size_text(count) == text
