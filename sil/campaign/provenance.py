"""What the numbers of a sweep depend on beside its plan: versions, our sources, files the scenario names."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from protocol import frames
from sil.scenario import Scenario
from sil.trouble import UsageError

PACKAGES = ("attitude-sil", "numpy", "numba")
FILE_KEYS = ("law.name", "plant.kind", "schedule")
# Show, plan or compare, but do not decide a number of a run.
_APART = ("sil/verbs/", "sil/screen", "sil/campaign/", "sil/report/", "sil/bench/", "sil/doctor/", "sil/cli.py")


def of(scenario: Scenario) -> dict[str, Any]:
    """Versions, hash of our sources, and the files with their sha256."""
    files = {key: file for key in FILE_KEYS if (file := scenario.file_of(key)) is not None}
    return {
        "versions": {name: version(name) for name in PACKAGES},
        "layout_hash": f"{frames.LAYOUT_HASH:08x}",
        "sources": _sources_hash(),
        "files": {str(file.resolve()): _sha256(file) for file in files.values()},
    }


def refuse_changed(planned: dict[str, Any], scenario: Scenario, where: str) -> None:
    """UsageError where results made now would not fit those made under `planned`; names everything that changed."""
    now = of(scenario)
    changes = [
        f"{name} {planned['versions'].get(name)} -> {now['versions'][name]}"
        for name in PACKAGES
        if planned["versions"].get(name) != now["versions"][name]
    ]
    changes += [
        f"{what} {planned[what]} -> {now[what]}" for what in ("layout_hash", "sources") if planned[what] != now[what]
    ]
    for file in sorted({*planned["files"], *now["files"]}):
        if planned["files"].get(file) != now["files"].get(file):
            changes.append(f"{file} (another content)")
    if changes:
        raise UsageError(f"{where}: expected what the sweep began with, got {', '.join(changes)}; start a new sweep")


def directory_of(scenario: Scenario) -> str:
    """Where the relative file names of this scenario start; "" if it names none."""
    named = (("law.name", scenario.law.name.rpartition(":")[0]), ("plant.kind", scenario.plant.kind.rpartition(":")[0]))
    for key, text in (*named, ("schedule", scenario.schedule)):
        file = scenario.file_of(key)
        if file is not None and text and not Path(text).is_absolute():
            return str(file.absolute().parents[len(Path(text).parts) - 1])
    return ""


@cache
def _sources_hash() -> str:
    """First 16 hex digits of the sha256 over every source of ours that decides a number of a run."""
    home = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for package in ("protocol", "firmware_sim", "sil"):
        for file in sorted((home / package).rglob("*.py")):
            name = file.relative_to(home).as_posix()
            if not name.startswith(_APART):
                digest.update(name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
