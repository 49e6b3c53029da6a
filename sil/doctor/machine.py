"""Checks of the machine: processors, kernel, timers, hypervisor, and what it permits (real-time priority, locking)."""

from __future__ import annotations

import ctypes
import gzip
import os
import re
import resource
import zlib
from collections import Counter
from collections.abc import Callable, Iterator

from sil.doctor.findings import NOTE, OK, Finding, Surroundings, size_text, user_name

PR_GET_TIMERSLACK = 30
CAP_IPC_LOCK, CAP_SYS_NICE = 14, 23
GOOD_CLOCKS = ("tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "riscv_clocksource")
TRIED_PRIORITY, HIGHEST_PRIORITY = 50, 99
CGROUPS = "/sys/fs/cgroup"
USUAL_RUNTIME_US, USUAL_PERIOD_US = 950_000, 1_000_000  # the kernel's own
LIMITS = "/etc/security/limits.d/attitude-sil.conf"
Tries = Callable[[int], OSError | None]


def processors(around: Surroundings) -> Finding:
    """How many there are for us, what else runs, and whether they change their speed."""
    return judge_processors(around, sorted(os.sched_getaffinity(0)))


def judge_processors(around: Surroundings, ours: list[int]) -> Finding:
    governors = Counter(_governors(around))
    load = (around.text("/proc/loadavg").split() or ["?"])[0]
    isolated = around.text("/sys/devices/system/cpu/isolated")
    quota = _quota(around)
    data = {"cpus": ours, "governors": dict(governors), "load": load, "isolated": isolated, "quota_cpus": quota}
    speed = ", ".join(f"{name} on {count}" for name, count in governors.items()) or "frequency not ours to see"
    isolation = f", isolated {isolated}" if isolated else ""
    found = f"{len(ours)} CPU{'s' * (len(ours) != 1)}, load {load}, {speed}{isolation}"
    if quota is not None and quota < len(ours):
        advice = "the container is stopped for a while whenever it has used that up: real time needs a larger quota"
        return Finding(NOTE, f"{found}; quota {quota:g} CPUs", advice, data=data)
    if len(ours) == 1:
        return Finding(NOTE, found, "laboratory and board share it: expect late answers in real time", data=data)
    if set(governors) - {"performance"}:
        advice = "a CPU that slows down when idle wakes late; for real time"
        return Finding(NOTE, found, advice, ("sudo cpupower frequency-set -g performance",), data=data)
    if load.replace(".", "").isdigit() and float(load) > len(ours):
        return Finding(NOTE, found, "the machine is busy: expect late ticks in real time", ("top",), data=data)
    return Finding(OK, found, data=data)


def _governors(around: Surroundings) -> list[str]:
    folder = around.at("/sys/devices/system/cpu")
    paths = sorted(folder.glob("cpu[0-9]*/cpufreq/scaling_governor"))
    return [text for path in paths if (text := path.read_text().strip())]


def _quota(around: Surroundings) -> float | None:
    """CPUs that the control groups allow us, the tightest of those we are in; None for all."""
    allowed = []
    for folder in _control_groups(around):
        words = around.text(f"{folder}/cpu.max").split()  # version 2
        words = words or [around.text(f"{folder}/cpu.cfs_{name}_us") for name in ("quota", "period")]
        if len(words) == 2 and words[0].isdigit() and words[1].isdigit() and int(words[1]) > 0:
            allowed.append(int(words[0]) / int(words[1]))
    return min(allowed, default=None)


def _control_groups(around: Surroundings) -> Iterator[str]:
    """Folders of our group and all above it, of both versions; a container may see only the top."""
    yield from (CGROUPS, f"{CGROUPS}/cpu")
    for line in around.text("/proc/self/cgroup").splitlines():
        _, controllers, path = [*line.split(":", 2), "", ""][:3]
        if controllers and "cpu" not in controllers.split(","):
            continue
        top = f"{CGROUPS}/cpu" if controllers else CGROUPS
        while path.strip("/"):
            yield top + path
            path = path.rpartition("/")[0]


def kernel(around: Surroundings) -> Finding:
    """How readily the kernel lets a woken process run."""
    version = around.text("/proc/version")
    release = (version.split() + ["?"] * 3)[2]
    model = _preemption(around, version)
    runtime = around.number("/proc/sys/kernel/sched_rt_runtime_us")
    data = {"release": release, "preemption": model, "sched_rt_runtime_us": runtime}
    found = f"{release}, preemption: {model}"
    advices: list[str] = []
    commands: tuple[str, ...] = ()
    if model.startswith(("none", "voluntary")):
        advices.append(
            "a long system call delays wake-ups by milliseconds; for real time boot with preempt=full, or PREEMPT_RT"
        )
    if runtime is not None and runtime != USUAL_RUNTIME_US:
        found += f", sched_rt_runtime_us {runtime}"
        advices.append(_runtime_advice(around, runtime))
        commands = (f"sudo sysctl kernel.sched_rt_runtime_us={USUAL_RUNTIME_US}",)
    return Finding(NOTE if advices else OK, found, "; ".join(advices), commands, data=data)


def _runtime_advice(around: Surroundings, runtime_us: int) -> str:
    """What it means that real-time processes may take so much of each period; -1: all of it."""
    period_us = around.number("/proc/sys/kernel/sched_rt_period_us") or USUAL_PERIOD_US
    if not 0 <= runtime_us < period_us:
        return "a real-time process that hangs stops its CPU for good; the kernel's own limit is"
    share = f"{runtime_us / period_us:.3g} of a CPU"
    return f"real-time processes are stopped when they had {share}; the kernel's own limit is"


def _preemption(around: Surroundings, version: str) -> str:
    """Model in force; a kernel that chooses it at boot says which in debugfs, to root, or in its command line."""
    if around.text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return "full real time (PREEMPT_RT)"
    chosen = re.search(r"\((\w+)\)", around.text("/sys/kernel/debug/sched/preempt"))
    asked = re.search(r"\bpreempt=(\w+)", around.text("/proc/cmdline"))
    if chosen or asked:
        return (chosen or asked)[1]  # type: ignore[index]
    if "PREEMPT_DYNAMIC" in version:
        return _built_with(around, version) or "chosen at boot (PREEMPT_DYNAMIC), and not ours to see"
    return "full" if "PREEMPT" in version else "voluntary or none"


def _built_with(around: Surroundings, version: str) -> str:
    """The model that the kernel was built to begin with, from its configuration; "" when that is not to be had."""
    release = (version.split() + ["?"] * 3)[2]
    text = around.text(f"/boot/config-{release}")
    try:
        text = text or gzip.decompress(around.at("/proc/config.gz").read_bytes()).decode(errors="replace")
    except (OSError, EOFError, zlib.error):
        return ""
    models = {"NONE": "none", "VOLUNTARY": "voluntary", "LAZY": "lazy", "": "full"}
    known = re.findall(r"^CONFIG_PREEMPT_?(NONE|VOLUNTARY|LAZY|)=y$", text, re.MULTILINE)
    return f"{models[known[0]]} (as built)" if known else ""


def timers(around: Surroundings) -> Finding:
    """The kernel's clock source, and how far it may put off our wake-ups."""
    return judge_timers(around, ctypes.CDLL(None).prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0))


def judge_timers(around: Surroundings, slack: int) -> Finding:
    """slack: of this thread, ns; the kernel's file of it is for others, and asks for a capability."""
    source = around.text("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    others = around.text("/sys/devices/system/clocksource/clocksource0/available_clocksource").split()
    data = {"clocksource": source, "available": others, "timerslack_ns": slack}
    said = f", timer slack {slack / 1000:g} us (realtime: 1 ns)" if slack > 0 else ""
    found = f"clock source {source or 'not ours to see'}{said}"
    if source and source not in GOOD_CLOCKS:
        better = next((name for name in GOOD_CLOCKS if name in others), "")
        command = f"echo {better} | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
        advice = "reading it takes a microsecond or more" + ("" if better else "; this machine offers no better one")
        return Finding(NOTE, found, advice, (command,) if better else (), data=data)
    return Finding(OK, found, data=data)


def hypervisor(around: Surroundings) -> Finding:
    """Whether another machine's scheduler stands above this one's."""
    product = " ".join(
        filter(None, (around.text(f"/sys/class/dmi/id/{name}") for name in ("sys_vendor", "product_name")))
    )
    guest = re.search(r"^flags\s*:.*\bhypervisor\b", around.text("/proc/cpuinfo"), re.MULTILINE) is not None
    guest = guest or bool(around.text("/sys/hypervisor/type"))
    stolen_s = _stolen_s(around)
    data = {"virtual": guest, "product": product, "container": around.in_container(), "stolen_s": stolen_s}
    where = "container on " if around.in_container() else ""
    if not guest:
        return Finding(OK, f"{where}bare metal{f' ({product})' if product else ''}", data=data)
    found = f"{where}virtual machine{f' ({product})' if product else ''}, {stolen_s:.0f} s stolen since boot"
    advice = "the host decides when we run: wake-ups may be late by milliseconds whatever is set here"
    return Finding(NOTE, found, advice, data=data)


def _stolen_s(around: Surroundings) -> float:
    """CPU time that the host gave to others while we wanted it; seconds, all CPUs."""
    words = around.text("/proc/stat").partition("\n")[0].split()
    return int(words[8]) / os.sysconf("SC_CLK_TCK") if len(words) > 8 and words[8].isdigit() else 0.0


# -- permissions ------------------------------------------------------------------------------------------------------


def real_time(around: Surroundings) -> Finding:
    """Whether `clock.priority` would be granted: tried in this thread, and taken back."""
    return judge_real_time(around, resource.getrlimit(resource.RLIMIT_RTPRIO)[0], try_fifo)


def try_fifo(priority: int) -> OSError | None:
    """SCHED_FIFO for this thread for a moment, as a run asks for it; the kernel's refusal, or None."""
    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        return error
    os.sched_setscheduler(0, before | os.SCHED_RESET_ON_FORK, parameters)  # an ordinary user may not clear that flag
    return None


def judge_real_time(around: Surroundings, limit: int, tries: Tries) -> Finding:
    """limit: RLIMIT_RTPRIO. tries(priority): the kernel's refusal or None."""
    capable, unlimited = _capable(around, CAP_SYS_NICE), limit == resource.RLIM_INFINITY
    highest = HIGHEST_PRIORITY if capable or unlimited else max(1, min(limit, HIGHEST_PRIORITY))
    refusal = tries(min(TRIED_PRIORITY, highest))
    named = "unlimited" if unlimited else str(limit)
    data = {
        "granted": refusal is None,
        "highest": highest if refusal is None else None,
        "rtprio": named,
        "capability": capable,
    }
    if refusal is None:
        why = "CAP_SYS_NICE" if capable else f"RLIMIT_RTPRIO {named}"
        return Finding(OK, f"SCHED_FIFO granted, clock.priority up to {highest} ({why})", data=data)
    found = f"SCHED_FIFO refused ({refusal.strerror}; RLIMIT_RTPRIO {named}): clock.priority has no effect"
    advice, commands = _permit(around, "rtprio 99", "--cap-add=SYS_NICE --ulimit rtprio=99")
    return Finding(NOTE, found, advice, commands, data=data)


def locked_memory(around: Surroundings) -> Finding:
    """Whether `clock.lock_memory` would be granted: by the rule that a run goes by."""
    from sil.realtime import may_lock_memory

    return judge_locked_memory(around, resource.getrlimit(resource.RLIMIT_MEMLOCK)[0], may_lock_memory())


def judge_locked_memory(around: Surroundings, limit: int, tried: bool) -> Finding:
    """limit: RLIMIT_MEMLOCK in bytes. tried: whether a run would try at all; any limit may stop a later allocation."""
    unlimited, capable = limit == resource.RLIM_INFINITY, _capable(around, CAP_IPC_LOCK)
    named = "unlimited" if unlimited else size_text(limit)
    data = {"limit_bytes": None if unlimited else limit, "capability": capable}
    if tried and (capable or unlimited):
        return Finding(OK, f"may be locked ({'CAP_IPC_LOCK' if capable else f'RLIMIT_MEMLOCK {named}'})", data=data)
    found = f"RLIMIT_MEMLOCK {named}: clock.lock_memory has no effect, for a run locks all of its memory or none"
    advice, commands = _permit(around, "memlock unlimited", "--ulimit memlock=-1")
    return Finding(NOTE, found, advice, commands, data=data)


def _capable(around: Surroundings, bit: int) -> bool:
    match = re.search(r"^CapEff:\s*([0-9a-f]+)$", around.text("/proc/self/status"), re.MULTILINE)
    return match is not None and bool(int(match[1], 16) >> bit & 1)


def _permit(around: Surroundings, limit: str, container: str) -> tuple[str, tuple[str, ...]]:
    """How to get the permission: (advice, commands)."""
    if around.in_container():
        return "only needed for real time; in a container, its owner gives it", (f"docker run {container} ...",)
    line = f"{user_name()} - {limit}"
    return "only needed for real time; then log in again", (f"echo '{line}' | sudo tee -a {LIMITS}",)
