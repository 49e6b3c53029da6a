"""The hardware watchdog of the emulated board, and the hand that reaches a firmware which hangs: one helper thread.

It measures the processor time that this process spends executing firmware since the firmware last cleared its watchdog.
Time in which the firmware waits, or in which this machine does something else, does not count: a slow or a suspended
machine resets nothing. It decides no byte of a run; a firmware that answers is never touched.
"""

from __future__ import annotations

import select
import threading
import time

from sil.pil.machine import Machine

LOOK_EVERY_S = 0.05
UNWATCHED_S = 2.0  # of a firmware that has not switched its watchdog on
SHORTEST_S = 0.5  # a firmware's clock and this processor's are different things


class Supervisor:
    """Watches `machine`, which the thread that makes this object executes, from `with` to its end.

    `wake_fd` becomes readable when a signal has come: Python's own handlers wait until the executing thread is back in
    Python, which a firmware that hangs would keep it from.
    """

    def __init__(self, machine: Machine, wake_fd: int) -> None:
        self._machine, self._wake_fd = machine, wake_fd
        self._clock = time.pthread_getcpuclockid(threading.get_ident())
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="supervisor", daemon=True)
        self._since_s = 0.0

    def __enter__(self) -> Supervisor:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(LOOK_EVERY_S):
            self._look(time.clock_gettime(self._clock))

    def _look(self, now_s: float) -> None:
        machine, watchdog = self._machine, self._machine.watchdog
        if not machine.executing or watchdog.cleared:
            watchdog.cleared = False
            self._since_s = now_s
            return
        limit_s = max(watchdog.period_s or UNWATCHED_S, SHORTEST_S)
        if now_s - self._since_s > limit_s:
            machine.ask(f"watchdog, {limit_s:g} s of execution without a kick")
            self._since_s = now_s
        elif machine.asked or select.select([self._wake_fd], (), (), 0)[0]:
            machine.engine.stop()  # it was asked just before it began to run, or a signal wants to be heard
