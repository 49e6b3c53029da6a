"""Runs every fuzzer, or those named; exit 1 on a finding."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from sil.pil.library import LibraryError
from tools.fuzz import IN_C, IN_PYTHON, REPO, native

TARGETS = (*IN_C, *IN_PYTHON)
WORKING = REPO / ".fuzz"  # corpora grow there from run to run; findings, too
SLACK_S = 120.0  # for a worker to import, compile, and try what it starts from


class Result(NamedTuple):
    """A line of the summary."""

    name: str
    engine: str
    executions: int
    seconds: float
    findings: tuple[str, ...]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}; default: all")
    parser.add_argument("--minutes", type=float, default=10.0, help="for each target")
    parser.add_argument("--jobs", type=int, default=1, help="targets at the same time")
    parser.add_argument("--folder", type=Path, default=WORKING, help="where corpora and findings are kept")
    parser.add_argument("--seed", type=int, default=1, help="of what is mutated in Python")
    parser.add_argument("--blind", action="store_true", help="no libFuzzer and no atheris, even where they are")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.targets if name not in TARGETS]
    if unknown:
        parser.error(f"expected targets of {', '.join(TARGETS)}, got {', '.join(unknown)}")
    names = given.targets or TARGETS
    (given.folder / "findings").mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(max(1, given.jobs)) as pool:
        results = list(pool.map(lambda name: _run(name, given), names))
    return summary(results, given.folder)


def _run(name: str, given: argparse.Namespace) -> Result:
    began = time.monotonic()
    corpus, findings = given.folder / "corpus" / name, given.folder / "findings" / name
    findings.mkdir(parents=True, exist_ok=True)
    try:
        one = _run_c if name in IN_C else _run_python
        engine, executions, found = one(name, given, corpus, findings)
    except LibraryError as error:
        engine, executions, found = "none", 0, [str(error)]
    result = Result(name, engine, executions, time.monotonic() - began, tuple(found))
    _say(name, f"{executions} executions, {len(found)} findings")
    return result


def _run_c(name: str, given: argparse.Namespace, corpus: Path, findings: Path) -> tuple[str, int, list[str]]:
    made = native.driver() if given.blind else native.engine()
    if made.name == "driver" and not given.blind:
        _say(name, "no clang with libFuzzer here: our own driver, which no coverage guides")
    ran = native.run(made, name, given.minutes * 60, corpus, findings, lambda line: _say(name, line))
    covered = f", {ran.covered} edges" if ran.covered else ""
    return made.name + covered, ran.executions, [str(path) for path in ran.findings]


def _run_python(name: str, given: argparse.Namespace, corpus: Path, findings: Path) -> tuple[str, int, list[str]]:
    """The worker says how it fares in a file; one that dies, or does not end, is a finding itself."""
    report = findings / f"{name}.json"
    report.unlink(missing_ok=True)
    options = ["--seconds", str(given.minutes * 60), "--seed", str(given.seed)]
    options += ["--corpus", str(corpus), "--findings", str(findings)]
    options += ["--engine", "mutation"] if given.blind else []
    command = [sys.executable, "-m", "tools.fuzz.worker", name, *options]
    log = findings / f"{name}.log"
    with open(log, "wb") as out:
        process = subprocess.Popen(command, cwd=REPO, stdout=out, stderr=subprocess.STDOUT)
        code = _watched(process, name, report, time.monotonic() + given.minutes * 60 + SLACK_S)
    state = json.loads(report.read_text()) if report.exists() else {"engine": "none", "executions": 0, "findings": []}
    found = [f"{each['what']}: {each['said']!r:.120} ({each['file']})" for each in state["findings"]]
    if code != 0:
        found.append(f"the worker ended with {code}: see {log}")
    return state["engine"], state["executions"], found


def _watched(process: subprocess.Popen[bytes], name: str, report: Path, until_s: float) -> int:
    try:
        while process.poll() is None and time.monotonic() < until_s:
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                if report.exists():
                    state = json.loads(report.read_text())
                    _say(name, f"{state['executions']} executions, {len(state['findings'])} findings")
        return process.returncode if process.poll() is not None else -1
    finally:
        process.kill()
        process.wait()


def summary(results: list[Result], folder: Path) -> int:
    """The table; returns the exit code."""
    print(f"\n{'target':<10}{'engine':<24}{'executions':>12}{'per s':>9}{'findings':>10}")
    for name, engine, executions, seconds, findings in results:
        print(f"{name:<10}{engine:<24}{executions:>12}{executions / seconds:>9.0f}{len(findings):>10}")
    for result in results:
        for finding in result.findings:
            print(f"{result.name}: {finding}")
    idle = [result.name for result in results if not result.executions]
    for name in idle:
        print(f"{name}: nothing was tried: see {folder / 'findings' / name}")
    found = sum(len(result.findings) for result in results) + len(idle)
    print(f"corpora and findings: {folder}")
    return 1 if found else 0


def _say(name: str, line: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {name}: {line}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
