"""The firmware as a library of this machine: its sources found, compiled into the cache once, loaded.

The cache is keyed by a hash of the sources, the machine, the compiler and its arguments: an edit of any of them makes a
new library, and what is there is never changed. (A home may be shared between machines of different kinds.)
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
FOLDERS = ("core", "core/generated", "hal/host")
FLAGS = ("-O2", "-std=c11", "-fwrapv", "-fPIC")
# Its functions call each other, whatever else in the process has the same names.
SHARED = ("-shared", "-Wl,-Bsymbolic")
COMPILERS = ("cc", "gcc", "clang")
REMEDY = "install gcc, or pip install ziglang"
BUILD_S = 300.0


class LibraryError(Exception):
    """The library cannot be made or loaded; one line, with the remedy."""


class HostLink(ctypes.Structure):
    """`host_link` of firmware/hal/host/host.h."""

    READ = ctypes.CFUNCTYPE(ctypes.c_size_t, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
    WRITE = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
    _fields_ = [
        ("fd", ctypes.c_int),
        ("stop_fd", ctypes.c_int),
        ("datagram", ctypes.c_bool),
        ("build", ctypes.c_char_p),
        ("link_self", ctypes.c_void_p),
        ("read", READ),
        ("write", WRITE),
        ("why", ctypes.c_int),
        ("error", ctypes.c_int),
        ("had_session", ctypes.c_bool),
        ("readable", ctypes.c_bool),
    ]


def load() -> ctypes.CDLL:
    """The library, compiled if need be. Raises LibraryError."""
    path = library()
    try:
        loaded = ctypes.CDLL(str(path))
    except OSError as error:
        raise LibraryError(f"native: cannot load {path}: {error}") from None
    loaded.host_serve.argtypes = [ctypes.POINTER(HostLink), ctypes.c_bool]
    loaded.host_serve.restype = ctypes.c_int
    return loaded


def library() -> Path:
    """The file of the library; compiled when this cache does not have it. Raises LibraryError."""
    failures = []
    for compiler in compilers():
        name = f"firmware-{_key(compiler)}.so"
        path = cache_directory() / name
        if path.exists():
            return path
        try:
            return build(path, compiler, [*FLAGS, *SHARED, *c_files()])
        except LibraryError as error:
            failures.append(str(error))
    raise LibraryError(failures[0] if failures else f"native: no C compiler: {REMEDY}")


def build(path: Path, compiler: Sequence[str], arguments: Sequence[str]) -> Path:
    """Run the compiler for `path`, which is there whole or not at all. Raises LibraryError with its first error."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".build-") as folder:
        made = Path(folder) / path.name
        command = [*compiler, *arguments, "-o", str(made)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_S, env=_environment(folder))
        except (OSError, subprocess.TimeoutExpired) as error:
            raise LibraryError(f"native: {compiler[0]}: {error}; {REMEDY}") from None
        if done.returncode != 0 or not made.exists():
            raise LibraryError(f"native: {shlex.join(compiler)} failed: {_first_error(done.stderr)}; {REMEDY}")
        os.replace(made, path)
    return path


def compilers() -> Iterator[tuple[str, ...]]:
    """The compilers that there are, best first: $CC alone if it is set, else cc, gcc, clang, and ziglang's clang."""
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        yield tuple(named)
        return
    for name in COMPILERS:
        if found := shutil.which(name):
            yield (found,)
    if importlib.util.find_spec("ziglang") is not None:
        yield (sys.executable, "-m", "ziglang", "cc")


def c_files(folders: Sequence[str] = FOLDERS) -> list[str]:
    """The C files of these folders. Raises LibraryError when the installation has none."""
    return [str(path) for path in sources(folders) if path.suffix == ".c"]


def sources(folders: Sequence[str] = FOLDERS) -> list[Path]:
    """Everything the library is made of, in a fixed order. Raises LibraryError when the installation has nothing."""
    found = [path for folder in folders for path in sorted((FIRMWARE / folder).glob("*.[ch]"))]
    if not found:
        raise LibraryError(f"native: the firmware's sources are not in {FIRMWARE}: install attitude-sil anew")
    return found


@cache
def source_hash() -> str:
    """First 16 hex digits of the sha256 over name and content of every source."""
    digest = hashlib.sha256()
    for path in sources():
        digest.update(path.relative_to(FIRMWARE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def cache_directory() -> Path:
    """Directory of the compiled code: $XDG_CACHE_HOME or ~/.cache, else the user's own place in the temp directory.

    Where none of these can be used, a temporary one for this process alone.
    """
    for root in _roots():
        if root.is_absolute() and _usable(root):
            return root
    last_resort = tempfile.mkdtemp(prefix="attitude-sil-")
    atexit.register(shutil.rmtree, last_resort, ignore_errors=True)
    return Path(last_resort)


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


def _key(compiler: Sequence[str]) -> str:
    """Sources, machine, arguments, and which compiler: by size and time of its file, ziglang by its version."""
    digest = hashlib.sha256(source_hash().encode())
    if "ziglang" in compiler:
        identity = metadata.version("ziglang")
    else:
        try:
            status = os.stat(shutil.which(compiler[0]) or compiler[0])
            identity = f"{status.st_size} {status.st_mtime_ns}"
        except OSError:
            identity = ""
    digest.update("\0".join([platform.machine(), *compiler, identity, *FLAGS, *SHARED]).encode())
    return digest.hexdigest()[:16]


def _environment(folder: str) -> dict[str, str]:
    """ziglang's own cache goes with the build, so that a home that cannot be written to is no matter."""
    return {"ZIG_GLOBAL_CACHE_DIR": folder, "ZIG_LOCAL_CACHE_DIR": folder, **os.environ}


def _first_error(text: str) -> str:
    """The line of a compiler's output that says what is wrong."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if "error" in line), lines[-1] if lines else "it said nothing")
