"""The cache of compiled code lies outside the package, follows the sources, and survives a directory it cannot use."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import firmware_sim.jit
import sil
from sil import jit

PACKAGE = Path(sil.__file__).parent
COMPILES = re.compile(r"^\s*(import numba|from numba|from sil import .*\bjit\b|from sil.jit)", re.MULTILINE)
PRINT = "from {} import jit; print(jit.cache_directory())"


def directory_with(package: str = "sil", cwd: Path | None = None, **environment: str) -> Path:
    everything = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    command = [sys.executable, "-P", "-c", PRINT.format(package)]
    done = subprocess.run(command, env=everything, cwd=cwd, capture_output=True, text=True, check=True)
    return Path(done.stdout.strip())


def test_only_the_hashed_sources_compile_anything() -> None:
    """Code compiled elsewhere would keep running from the cache after an edit."""
    hashed = {path for pattern in jit.COMPILED for path in PACKAGE.glob(pattern)}
    using = {path for path in PACKAGE.rglob("*.py") if COMPILES.search(path.read_text())}
    assert using - hashed == set()


def test_cache_lies_in_the_xdg_directory_under_the_hash(tmp_path: Path) -> None:
    directory = directory_with(XDG_CACHE_HOME=str(tmp_path))
    assert directory == tmp_path / "attitude-sil" / f"sil-{jit.source_hash()}"
    assert PACKAGE not in directory.parents


def test_an_unusable_cache_home_falls_back_to_the_temp_directory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a directory")
    temp = tmp_path / "temp"
    temp.mkdir()
    directory = directory_with(XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(temp))
    assert directory.parent == temp / f"attitude-sil-{os.getuid()}"
    assert directory.is_dir()


@pytest.mark.parametrize("package", ["sil", "firmware_sim"])
@pytest.mark.parametrize("home", ["relative", "."])
def test_nothing_is_cached_in_the_working_directory(tmp_path: Path, package: str, home: str) -> None:
    """A HOME that is no absolute path."""
    work, temp = tmp_path / "work", tmp_path / "temp"
    work.mkdir()
    temp.mkdir()
    directory = directory_with(package, work, HOME=home, XDG_CACHE_HOME="also/relative", TMPDIR=str(temp))
    assert directory.parent == temp / f"attitude-sil-{os.getuid()}"
    assert list(work.iterdir()) == []


@pytest.mark.parametrize("package", ["sil", "firmware_sim"])
def test_the_directory_of_last_resort_is_gone_with_its_process(tmp_path: Path, package: str) -> None:
    (tmp_path / "file").write_text("not a directory")
    temp = tmp_path / "temp"
    temp.mkdir()
    (temp / f"attitude-sil-{os.getuid()}").write_text("in the way")
    directory = directory_with(package, XDG_CACHE_HOME=str(tmp_path / "file"), TMPDIR=str(temp))
    assert directory.parent == temp
    assert not directory.exists()


def test_both_packages_choose_alike() -> None:
    """sil may not import firmware_sim, so there are two files; what they share is the same text."""
    for name in ("compile", "_roots", "_usable"):
        assert inspect.getsource(getattr(jit, name)) == inspect.getsource(getattr(firmware_sim.jit, name))
    ours, theirs = (inspect.getsource(each.cache_directory) for each in (jit, firmware_sim.jit))
    assert theirs == ours.replace("sil-{source", "firmware_sim-{source")


def test_the_hash_follows_any_edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plants").mkdir()
    for name in ("jit.py", "plants/rigid.py"):
        (tmp_path / name).write_bytes((PACKAGE / name).read_bytes())
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit.py"))
    before = jit.source_hash.__wrapped__()
    (tmp_path / "plants" / "rigid.py").write_text("# edited")
    assert jit.source_hash.__wrapped__() != before
