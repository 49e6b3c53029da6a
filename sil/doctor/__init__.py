"""The doctor: checks of this machine and installation, by name. A new check is a function and one line in CHECKS.

Each runs in a thread of its own for at most LIMIT_S, and whatever it raises is a finding: no check ends the doctor.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator

from sil.doctor.findings import NOTE, OK, PROBLEM, Finding, Surroundings
from sil.plugins import UnknownPlugin, load

__all__ = ["CHECKS", "NOTE", "OK", "PROBLEM", "Finding", "Surroundings", "bounded", "examine"]

LIMIT_S = 20.0  # the first import of numba on a slow disk takes ten
TELL_EVERY_S = 0.25

CHECKS = {
    "python": "sil.doctor.installation:python",
    "packages": "sil.doctor.installation:packages",
    "dependencies": "sil.doctor.installation:dependencies",
    "compiled code": "sil.doctor.installation:compiled_code",
    "processors": "sil.doctor.machine:processors",
    "kernel": "sil.doctor.machine:kernel",
    "timers": "sil.doctor.machine:timers",
    "hypervisor": "sil.doctor.machine:hypervisor",
    "real time": "sil.doctor.machine:real_time",
    "locked memory": "sil.doctor.machine:locked_memory",
    "pty": "sil.doctor.cables:pty",
    "udp": "sil.doctor.cables:udp",
    "serial ports": "sil.doctor.device:ports",
    "c compiler": "sil.doctor.tools:c_compiler",
    "arm compiler": "sil.doctor.tools:arm_compiler",
    "emulator": "sil.doctor.tools:emulator",
    "cyclictest": "sil.doctor.tools:cyclictest",
    "disk": "sil.doctor.tools:disk",
    "terminal": "sil.doctor.tools:terminal",
}


def examine(
    around: Surroundings,
    names: Iterable[str] = tuple(CHECKS),
    limit_s: float = LIMIT_S,
    tell: Callable[[str], object] = lambda text: None,
) -> Iterator[Finding]:
    """What each check finds, in order, as it is found. tell(text) is called while one takes. Raises UnknownPlugin."""
    for name in names:
        if name not in CHECKS:
            raise UnknownPlugin("check", name, CHECKS)
        yield bounded(name, lambda name=name: load(CHECKS, "check", name)(around), limit_s, tell)  # type: ignore[misc]


def bounded(
    name: str, check: Callable[[], Finding], limit_s: float, tell: Callable[[str], object] = lambda text: None
) -> Finding:
    """What `check` finds, or that it raised, or that it did not come back within `limit_s`."""
    found: list[Finding] = []
    thread = threading.Thread(target=lambda: found.append(_caught(check)), name=f"doctor {name}", daemon=True)
    thread.start()
    give_up = time.monotonic() + limit_s
    while thread.is_alive() and (left_s := give_up - time.monotonic()) > 0.0:
        thread.join(min(TELL_EVERY_S, left_s))
        tell(f"checking {name}")
    if not found:
        found.append(Finding(PROBLEM, f"this check did not come back within {limit_s:g} s: something it asked hangs"))
    return found[0]._replace(check=name)


def _caught(check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except BaseException as error:  # an import may raise anything, SystemExit too
        said = " ".join(str(error).split())[:300]
        return Finding(PROBLEM, f"this check failed: {type(error).__name__}: {said}")
