"""The cache of compiled code lies outside the package, follows the sources, and survives a directory it cannot use."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sil
from sil import jit

PACKAGE = Path(sil.__file__).parent
COMPILES = re.compile(r"^\s*(import numba|from numba|from sil import .*\bjit\b|from sil.jit)", re.MULTILINE)
PRINT = "from sil import jit; print(jit.cache_directory())"


def directory_with(**environment: str) -> Path:
    everything = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    done = subprocess.run([sys.executable, "-c", PRINT], env=everything, capture_output=True, text=True, check=True)
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


def test_the_hash_follows_any_edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plants").mkdir()
    for name in ("jit.py", "plants/rigid.py"):
        (tmp_path / name).write_bytes((PACKAGE / name).read_bytes())
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit.py"))
    before = jit.source_hash.__wrapped__()
    (tmp_path / "plants" / "rigid.py").write_text("# edited")
    assert jit.source_hash.__wrapped__() != before
