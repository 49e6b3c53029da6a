"""One Python target in a process of its own: `python -m tools.fuzz.worker NAME --seconds N --corpus ... --findings D`.

Guided by atheris where it is there, else blind. A finding does not end it: the input is kept in the folder of findings,
and the next one is tried. A check that takes longer than CHECK_S is a finding, and so is one that wants more than
MEMORY_BYTES. Progress stands in NAME.json there, renewed about once a second.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import resource
import signal
import sys
import time
import traceback
from pathlib import Path
from random import Random
from typing import Any

from tools.fuzz import CORPUS, GUIDED_BY, IN_PYTHON, Target, load

CHECK_S = 45.0  # a board that does not answer is given up after 10 s, and coverage makes Python ten times slower
MEMORY_BYTES = 3 << 30  # beyond what was there at the start
KEPT = 400  # inputs that blind mutation starts from
MOST_INPUT = 1 << 20


class TooLong(Exception):
    """A check that hangs."""


class Work:
    """Counts what is tried and keeps what is found."""

    def __init__(self, name: str, target: Target, findings: Path, engine: str) -> None:
        self._name, self._target, self._findings = name, target, findings
        self._state: dict[str, Any] = {"engine": engine, "executions": 0, "findings": []}
        self._told_s = 0.0

    def one(self, data: bytes, within_s: float = CHECK_S) -> None:
        """One input; never raises but for what is asked from outside. within_s 0: it takes what it takes."""
        self._state["executions"] += 1
        signal.setitimer(signal.ITIMER_REAL, within_s)
        try:
            self._target.check(data)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self._found(data, error)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        if time.monotonic() - self._told_s > 1.0:
            self.tell()

    def tell(self) -> None:
        self._told_s = time.monotonic()
        partial = self._findings / f"{self._name}.json.partial"
        partial.write_text(json.dumps(self._state))
        partial.replace(self._findings / f"{self._name}.json")

    def _found(self, data: bytes, error: BaseException) -> None:
        """The first input for each exception and place it was raised at."""
        frames = traceback.extract_tb(error.__traceback__)
        ours = [frame for frame in frames if frame.name not in ("late", "expect", "expect_lines")]
        where = f"{type(error).__name__} at {Path(ours[-1].filename).name}:{ours[-1].lineno}"
        if isinstance(error, RecursionError | TooLong | MemoryError):
            where = type(error).__name__
        if any(found["what"] == where for found in self._state["findings"]):
            return
        file = self._findings / f"{self._name}-{hashlib.sha256(data).hexdigest()[:12]}"
        file.write_bytes(data)
        text = "".join(traceback.format_exception(error)[-12:])
        file.with_suffix(".txt").write_text(text)
        self._state["findings"].append({"what": where, "file": str(file), "said": str(error)[:200]})
        self.tell()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.fuzz.worker")
    parser.add_argument("name", choices=IN_PYTHON)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--corpus", type=Path, required=True, help="grows")
    parser.add_argument("--findings", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", choices=("auto", "atheris", "mutation"), default="auto")
    given = parser.parse_args()
    atheris = _atheris() if given.engine != "mutation" else None
    if given.engine == "atheris" and atheris is None:
        parser.error("atheris is not installed: pip install atheris")
    target = _instrumented(given.name, atheris) if atheris is not None else load(given.name)
    _limit()
    work = Work(given.name, target, given.findings, "atheris" if atheris is not None else "mutation")
    for data in _start(given.name, target):
        work.one(data, within_s=0.0)  # laws are compiled here
    work.tell()
    if atheris is not None:
        _guided(atheris, work, target, given)
    else:
        _blind(work, target, given)
    work.tell()
    return 0


def _atheris() -> Any:
    try:
        import atheris
    except ImportError:
        return None
    return atheris


def _instrumented(name: str, atheris: Any) -> Target:
    """The target, after its modules were imported such that their coverage is seen."""
    with atheris.instrument_imports(include=list(GUIDED_BY[name])):
        for module in GUIDED_BY[name]:
            importlib.import_module(module)
    return load(name)


def _start(name: str, target: Target) -> list[bytes]:
    return [path.read_bytes() for path in sorted((CORPUS / name).glob("*"))] + target.seeds()


def _limit() -> None:
    def late(*_: object) -> None:
        raise TooLong(f"no end within {CHECK_S:g} s")

    signal.signal(signal.SIGALRM, late)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES, resource.RLIM_INFINITY))


def _blind(work: Work, target: Target, given: argparse.Namespace) -> None:
    """Mutates the seeds and, of what it made, a number that is replaced at random."""
    random = Random(given.seed)
    pool = _start(given.name, target)
    fixed = len(pool)
    end = time.monotonic() + given.seconds
    while time.monotonic() < end:
        data = target.mutate(random.choice(pool), random)[:MOST_INPUT]
        work.one(data)
        if len(pool) < KEPT:
            pool.append(data)
        elif random.random() < 0.2:
            pool[random.randrange(min(fixed, KEPT - 1), KEPT)] = data


def _guided(atheris: Any, work: Work, target: Target, given: argparse.Namespace) -> None:
    random = Random(given.seed)

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        random.seed(seed)
        return target.mutate(data, random)[:most]

    given.corpus.mkdir(parents=True, exist_ok=True)
    for data in _start(given.name, target):
        (given.corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    options = [f"-max_total_time={int(given.seconds) or 1}", f"-seed={given.seed}", f"-max_len={MOST_INPUT}"]
    options += [f"-artifact_prefix={given.findings}/atheris-", "-rss_limit_mb=4096", "-verbosity=0"]
    atheris.Setup([sys.argv[0], *options, str(given.corpus)], work.one, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
