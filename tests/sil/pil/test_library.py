"""The host library: whichever compiler there is; built once, whole or not at all, anew after an edit; else one line."""

from __future__ import annotations

import ctypes
import shutil
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from sil.pil import library
from sil.pil.library import LibraryError

ONE = "int host_serve(void *link, _Bool once) { return %d + (link != 0) + once; }\n"
ZIG_CACHE = Path.home() / ".cache" / "zig"  # where it is when nobody says: other tests build with it, too
REPO = Path(library.FIRMWARE).parent
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror")


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty cache, and no compiler named."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    library.cache_directory.cache_clear()
    library.source_hash.cache_clear()
    yield
    library.cache_directory.cache_clear()
    library.source_hash.cache_clear()


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A firmware of one function, which compiles in no time."""
    folder = tmp_path / "firmware"
    for name in library.FOLDERS:
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "core" / "one.c").write_text(ONE % 1)
    monkeypatch.setattr(library, "FIRMWARE", folder)
    return folder


def what_it_says() -> int:
    """The number that the small firmware returns."""
    return int(library.load().host_serve(None, False))


def compiler(folder: Path, name: str, script: str) -> Path:
    """A program in a PATH of its own; what it is called with goes to `name`.log."""
    path = folder / "bin" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'#!/bin/sh\necho "$@" >> {folder}/{name}.log\n{script}\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def the_real_one() -> str:
    """A C compiler of this machine, as shell words."""
    return " ".join(next(library.compilers()))


def test_it_is_built_once_and_then_found(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = the_real_one()
    cc = compiler(tmp_path, "cc", f'exec {real} "$@"')
    monkeypatch.setenv("CC", str(cc))
    assert library.library() == library.library()
    assert len((tmp_path / "cc.log").read_text().splitlines()) == 1
    assert what_it_says() == 1
    assert [path.name for path in library.cache_directory().iterdir()] == [library.library().name]


def test_an_edit_makes_another(small: Path) -> None:
    before = library.library()
    (small / "core" / "one.c").write_text(ONE % 2)
    library.source_hash.cache_clear()
    assert library.library() != before
    assert what_it_says() == 2
    assert ctypes.CDLL(str(before)).host_serve(None, False) == 1


def test_another_compiler_makes_another(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real, before = the_real_one(), library.library()
    monkeypatch.setenv("CC", str(compiler(tmp_path, "mine", f'exec {real} "$@"')))
    assert library.library() != before


def test_another_kind_of_machine_makes_another(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A home may be mounted on both."""
    before = library.library()
    monkeypatch.setattr(library.platform, "machine", lambda: "riscv64")
    assert library.library() != before


def test_builds_at_the_same_time_do_not_clash(small: Path) -> None:
    with ThreadPoolExecutor(4) as pool:
        paths = {future.result() for future in [pool.submit(library.library) for _ in range(4)]}
    assert len(paths) == 1
    assert [path.name for path in library.cache_directory().iterdir()] == [paths.pop().name]


def test_a_compiler_that_fails_is_passed_over(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = the_real_one()
    compiler(tmp_path, "cc", "exit 1")
    compiler(tmp_path, "gcc", f'exec {real} "$@"')
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:/usr/bin:/bin")
    assert what_it_says() == 1
    assert (tmp_path / "cc.log").exists()


def test_where_none_works_the_first_one_says_why(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = "one.c:1: error: stdint.h not found"
    cc = compiler(tmp_path, "mine", f"echo one.c: In function f: >&2; echo '{said}' >&2; exit 1")
    monkeypatch.setenv("CC", str(cc))
    with pytest.raises(LibraryError) as caught:
        library.library()
    assert str(caught.value) == f"native: {cc} failed: {said}; install gcc, or pip install ziglang"
    assert list(library.cache_directory().iterdir()) == []


def test_where_there_is_none(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(library.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(LibraryError, match=r"^native: no C compiler: install gcc, or pip install ziglang$"):
        library.library()


def test_an_installation_without_sources_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "FIRMWARE", tmp_path)
    with pytest.raises(LibraryError, match="sources are not in"):
        library.library()


def test_a_cache_that_cannot_be_used_is_no_matter(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cache").write_text("a file")
    monkeypatch.setattr(library.tempfile, "gettempdir", lambda: str(tmp_path / "other"))
    assert what_it_says() == 1
    assert library.cache_directory().is_relative_to(tmp_path / "other")


def test_ziglang_alone_is_enough(small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither cc nor gcc nor clang."""
    pytest.importorskip("ziglang")
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(ZIG_CACHE))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert list(library.compilers()) == [(sys.executable, "-m", "ziglang", "cc")]
    assert what_it_says() == 1


def test_no_compiler_has_anything_to_remark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """-Wall -Wextra -Wconversion -Werror over the whole library, by each compiler that is here."""
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(ZIG_CACHE))
    different = {Path(shutil.which(compiler[0]) or "").resolve(): compiler for compiler in library.compilers()}
    for compiler in different.values():
        path, arguments = tmp_path / "library.so", [*library.FLAGS, *library.SHARED, *WARNINGS, *library.c_files()]
        library.build(path, compiler, arguments)
        assert ctypes.CDLL(str(path)).host_board_size() > 4 * 18240


def test_the_generated_headers_are_fresh() -> None:
    command = [sys.executable, "-m", "tools.firmware_headers", "--check"]
    done = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
