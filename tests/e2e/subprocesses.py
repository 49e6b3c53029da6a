"""End to end: the command line as a user runs it, in a directory of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

REPO = Path(__file__).resolve().parents[2]


@dataclass
class Cli:
    """`sil` as a subprocess, in `folder`."""

    folder: Path

    def start(self, *arguments: str, **options: Any) -> subprocess.Popen[str]:
        # -P: not the clone's sources because they happen to lie in the working directory, but what is installed.
        command = [sys.executable, "-P", "-m", "sil", *arguments]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        return subprocess.Popen(command, cwd=self.folder, **{**pipes, **options})

    def __call__(self, *arguments: str, code: int | None = 0) -> tuple[str, str]:
        """(stdout, stderr); asserts the exit code."""
        process = self.start(*arguments)
        out, err = process.communicate(timeout=240)
        assert code is None or process.returncode == code, f"exit {process.returncode}\n{out}\n{err}"
        return out, err

    def json(self, *arguments: str, code: int = 0) -> Any:
        return json.loads(self(*arguments, "--json", code=code)[0])


def children_of(pid: int) -> list[int]:
    """Living processes whose parent is `pid`."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == pid and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def alive(pid: int) -> bool:
    """The process exists and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def all_gone(pids: Iterable[int], within_s: float = 5.0) -> bool:
    """None of these processes is there any more; one whose parent has died needs a moment to notice."""
    give_up = time.monotonic() + within_s
    left = [pid for pid in pids if alive(pid)]
    while left and time.monotonic() < give_up:
        time.sleep(0.02)
        left = [pid for pid in left if alive(pid)]
    return not left


def quiet(pid: int) -> None:
    """Kill it if it is still there, so that a failing test leaves nothing behind."""
    try:
        os.kill(pid, 9)
    except ProcessLookupError:
        return
