"""Builds of firmware/core for the tests of the laws: as the sources stand, mutated, or with a sanitizer."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from sil.pil.library import compilers
from tools.check_c_operations import law_files

HERE = Path(__file__).parent
CORE = HERE.parents[2] / "firmware" / "core"
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]


def compiler() -> list[str]:
    """What the host library is compiled with here."""
    return [*next(compilers())]


def zig() -> list[str]:
    """The pip-installed compiler."""
    return [sys.executable, "-m", "ziglang", "cc"]


def law_sources(core: Path = CORE) -> list[Path]:
    """What the laws are made of: all of core but the board."""
    return [core / "fixed.c", *(path for path in law_files(core) if path.suffix == ".c")]


def build(
    out: Path,
    extra: Sequence[Path],
    options: Sequence[str],
    core: Path = CORE,
    laws: bool = True,
) -> Path:
    """`out` from the laws' sources in `core`, if `laws`, and the files `extra`; fails with the compiler's words."""
    command = [*compiler(), "-std=c11", *WARNINGS, f"-I{core}", f"-I{HERE}", *options]
    command += [str(path) for path in (*(law_sources(core) if laws else ()), *extra)]
    done = subprocess.run([*command, "-o", str(out)], capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"
    return out


def program(directory: Path, options: Sequence[str] = ("-O2",), core: Path = CORE) -> Path:
    """program.c with the laws."""
    directory.mkdir(parents=True, exist_ok=True)
    return build(directory / "program", [HERE / "episode.c", HERE / "program.c"], options, core)


def sanitized() -> list[str]:
    """Options of a build that ends at the first undefined behaviour or, but for zig, access out of bounds."""
    checks = "undefined" if "ziglang" in compiler() else "undefined,address"
    return ["-g", "-O1", f"-fsanitize={checks}", "-fno-sanitize-recover=all"]


def mutated(directory: Path, file: str, before: str, after: str) -> Path:
    """A copy of firmware/core in which `before`, which stands once in that file, became `after`."""
    core = directory / "core"
    shutil.copytree(CORE, core)
    text = (core / file).read_text()
    assert text.count(before) == 1, f"{file}: expected {before!r} once, found {text.count(before)}"
    (core / file).write_text(text.replace(before, after))
    return core
