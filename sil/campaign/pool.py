"""Worker processes that fly points: each has one point at a time, and one that dies costs that point only.

So does one that hangs or is stopped (SIGSTOP): a worker says about once a second that ticks go by. After QUIET_S
without a word there is a line, after GIVE_UP_S it is killed and its point has failed; another worker goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from sil.campaign.records import Record, broken
from sil.launched import child_environment
from sil.trouble import LinkFailure

STOP_S = 5.0
QUIET_S = 30.0  # a law that compiles is silent, too
SEAL_S = 1e-3  # more for each tick of a log that is sealed and read; a tenth of it is usual
GIVE_UP_S = 300.0  # as long as a board may take to be ready; nothing else takes so long
READY, ALIVE, SEALING = b'{"ready": true}', b'{"alive": true}', re.compile(rb'{"sealing": ([0-9]{1,12})}')
Order = dict[str, Any]  # point, sets, folder, keep


class Worker:
    """One process, and the point it is at (None: it waits)."""

    def __init__(self, setup: dict[str, Any], log: IO[bytes]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "sil.campaign.worker", str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            env={"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", **child_environment()},
            start_new_session=True,  # Ctrl-C in the terminal is the sweep's to handle
        )
        self.order: Order | None = None
        self.ready = False
        self.nonsense = ""
        self.heard_s = time.monotonic()  # when it last said something, or was given a point
        self.told = False  # that it is quiet
        self.granted_s = 0.0  # to be quiet for longer, while it seals
        self._rest = b""
        self._send(setup)

    @property
    def stdout(self) -> IO[bytes]:
        assert self.process.stdout is not None
        return self.process.stdout

    def fly(self, order: Order) -> None:
        """Give it a point."""
        self.order = order
        self.heard_s, self.told, self.granted_s = time.monotonic(), False, 0.0
        self._send(order)

    def records(self) -> list[Record] | None:
        """Records that came since, of the point it is at; None when it is gone. `nonsense` is set by anything else."""
        data = os.read(self.stdout.fileno(), 1 << 20)
        self.heard_s, self.told = time.monotonic(), False
        *whole, self._rest = (self._rest + data).split(b"\n")
        found = []
        for line in whole:
            if line == READY:
                self.ready = True
                continue
            if line == ALIVE:
                continue
            if sealing := SEALING.fullmatch(line):
                self.granted_s = SEAL_S * int(sealing[1])
                continue
            try:
                record = Record.read(line)
                if self.order is None or record.point != self.order["point"]:
                    raise ValueError(f"expected a record of the point it was given, got one of point {record.point}")
            except ValueError as error:
                self.nonsense = f"{error}"
                break
            self.order = None
            found.append(record)
        return found if data else None

    def is_stopped(self) -> bool:
        """By a signal: it computes nothing."""
        try:
            stat = Path(f"/proc/{self.process.pid}/stat").read_bytes()
        except OSError:
            return False
        return stat.rpartition(b")")[2].split()[:1] in ([b"T"], [b"t"])

    def end(self) -> str:
        """Wait for a process that closed its output; returns how it ended."""
        try:
            code = self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                _closed(pipe)
        return f"signal {-code} ({signal.Signals(-code).name})" if code < 0 else f"exit code {code}"

    def _send(self, content: dict[str, Any]) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(content).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass  # its output says so in a moment


class Pool:
    """`count` workers; orders go in by submit() while there are idle ones, records come out of poll().

    tell: for a line about a worker from which nothing comes.
    """

    def __init__(
        self, setup: dict[str, Any], count: int, log: Path, tell: Callable[[str], None] = lambda line: None
    ) -> None:
        self._tell = tell
        self._setup, self._log_file = setup, log
        self._log = open(log, "ab")  # noqa: SIM115
        self._selector = selectors.DefaultSelector()
        self._workers: list[Worker] = []
        self._count = count
        self._began = False  # one of them, once

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def submit(self, order: Order) -> bool:
        """Hand the point to an idle worker, or to a new one while there are fewer than `count`; False: all are busy."""
        worker = next((worker for worker in self._workers if worker.order is None), None)
        if worker is None:
            if len(self._workers) >= self._count:
                return False
            worker = Worker(self._setup, self._log)
            self._workers.append(worker)
            self._selector.register(worker.stdout, selectors.EVENT_READ, worker)
        worker.fly(order)
        return True

    def busy(self) -> list[Order]:
        """Points that are being flown."""
        return [worker.order for worker in self._workers if worker.order is not None]

    def poll(self, timeout_s: float) -> Iterator[Record]:
        """Records that came within `timeout_s`. Raises LinkFailure when a worker ends and none could ever begin."""
        for key, _ in self._selector.select(timeout_s):
            worker: Worker = key.data
            records = worker.records()
            self._began = self._began or worker.ready
            yield from records or ()
            if worker.nonsense:
                worker.process.kill()
                yield from self._gone(worker, f"the worker process was stopped for what it said: {worker.nonsense}")
            elif records is None:
                yield from self._gone(worker)
        for worker in list(self._workers):
            if worker.order is not None:
                yield from self._look_after(worker)

    def _look_after(self, worker: Worker) -> Iterator[Record]:
        """A worker that is at a point: is it quiet for too long?"""
        silent_s = time.monotonic() - worker.heard_s
        if silent_s < QUIET_S + worker.granted_s:
            return
        assert worker.order is not None
        stopped = worker.is_stopped()
        pid = worker.process.pid
        give_up_s = GIVE_UP_S + worker.granted_s
        if silent_s >= give_up_s:
            why = "stood still, stopped by a signal" if stopped else "hung: no tick went by"
            worker.process.kill()
            yield from self._gone(worker, f"the worker process was killed after {give_up_s:g} s in which it {why}")
        elif not worker.told:
            worker.told = True
            why = f"it is stopped (kill -CONT {pid} lets it go on)" if stopped else "no tick goes by"
            left = f"given up after {give_up_s:g} s"
            self._tell(f"point {worker.order['point']}: nothing from worker {pid} for {silent_s:.0f} s: {why}; {left}")

    def close(self) -> None:
        """End all: idle ones because nothing more comes, busy ones at their next tick; nobody is left behind."""
        for worker in self._workers:
            if worker.process.stdin is not None:
                _closed(worker.process.stdin)
            if worker.order is not None:
                worker.process.terminate()
        give_up = time.monotonic() + STOP_S
        for worker in self._workers:
            try:
                worker.process.wait(max(0.0, give_up - time.monotonic()))
            except subprocess.TimeoutExpired:
                worker.process.kill()
            worker.end()
        self._workers.clear()
        self._selector.close()
        self._log.close()

    def _gone(self, worker: Worker, why: str = "") -> Iterator[Record]:
        self._selector.unregister(worker.stdout)
        self._workers.remove(worker)
        how = worker.end()
        if not self._began:
            what = why.replace("the worker", "a worker", 1) or f"a worker process ended with {how}"
            raise LinkFailure(f"sweep: {what} before it began; see {self._log_file}")
        if worker.order is not None:
            yield broken(int(worker.order["point"]), why or f"the worker process ended with {how}")


def _closed(pipe: IO[bytes]) -> None:
    with contextlib.suppress(BrokenPipeError):
        pipe.close()
