"""Compiled board code: numba with a cache outside the package, in a directory that carries a hash of the sources.

numba notices an edit in the file of the compiled function only, not in the files it calls into; the hash makes any edit
of a firmware_sim source start an empty cache. The package directory may be read-only.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def compile(function: Function) -> Function:
    """`function` compiled on its first call, or taken from the cache; no fast-math: the order of operations stands."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_directory())
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        config.CACHE_DIR = before


def callee(function: Function) -> Function:
    """`function` itself, a plain Python function, which compiled code may call."""
    return cast(Function, register_jitable(function))


@cache
def cache_directory() -> Path:
    """Directory of the compiled code: $XDG_CACHE_HOME or ~/.cache, else the user's own place in the temp directory."""
    name = f"firmware_sim-{source_hash()}"
    for root in (_xdg_root(), Path(tempfile.gettempdir()) / f"attitude-sil-{os.getuid()}"):
        if _usable(root) and _usable(root / name):
            return root / name
    return Path(tempfile.mkdtemp(prefix="attitude-sil-"))


@cache
def source_hash() -> str:
    """First 16 hex digits of the sha256 over name and content of every source of this package."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _xdg_root() -> Path:
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path(os.path.expanduser("~")) / ".cache") / "attitude-sil"


def _usable(directory: Path) -> bool:
    """True if it exists or can be made, is ours (its content is executed), and can be written to."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=directory):
            return directory.stat().st_uid == os.getuid()
    except OSError:
        return False
