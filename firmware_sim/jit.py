"""Compiled board code: numba with a cache outside the package, in a directory that carries a hash of the sources.

numba notices an edit in the file of the compiled function only, not in the files it calls into; the hash makes any edit
of a firmware_sim source start an empty cache. The package directory may be read-only.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
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
    """Directory of the compiled code: $XDG_CACHE_HOME or ~/.cache, else the user's own place in the temp directory.

    Where none of these can be used, a temporary one for this process alone.
    """
    name = f"firmware_sim-{source_hash()}"
    for root in _roots():
        if root.is_absolute() and _usable(root) and _usable(root / name):
            return root / name
    last_resort = tempfile.mkdtemp(prefix="attitude-sil-")
    atexit.register(shutil.rmtree, last_resort, ignore_errors=True)
    return Path(last_resort)


@cache
def source_hash() -> str:
    """First 16 hex digits of the sha256 over name and content of every source of this package."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _roots() -> Iterator[Path]:
    """Where the cache may lie; a relative one is none, since it would lie in whatever is the working directory."""
    xdg = Path(os.environ.get("XDG_CACHE_HOME", ""))
    yield (xdg if xdg.is_absolute() else Path(os.path.expanduser("~")) / ".cache") / "attitude-sil"
    yield Path(tempfile.gettempdir()) / f"attitude-sil-{os.getuid()}"


def _usable(directory: Path) -> bool:
    """True if it exists or can be made, is ours (its content is executed), and can be written to."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=directory):
            return directory.stat().st_uid == os.getuid()
    except OSError:
        return False
