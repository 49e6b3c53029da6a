"""The product as a wheel, outside the clone: nothing is written beside it, no namesake in the working directory."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from subprocesses import REPO

SHIPPED = ("protocol/", "firmware_sim/", "firmware/", "sil/", "pyproject.toml", "README.md", "LICENSE")
DECOYS = ("protocol", "firmware_sim", "sil", "numpy")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The wheel, unpacked into a directory of its own and made read-only; built from a copy of the tracked files."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=REPO, capture_output=True, check=True).stdout.decode()
    for name in filter(None, tracked.split("\0")):
        if name.startswith(SHIPPED):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPO / name, source / name)
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(source)]
    said = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "Deprecat" not in said.stdout + said.stderr
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for path in [*site.rglob("*"), site]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield site
    for path in [site, *site.rglob("*")]:
        path.chmod(0o755 if path.is_dir() else 0o644)


@pytest.fixture
def elsewhere(tmp_path):
    """A working directory full of packages with our names that must not be imported."""
    for name in DECOYS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('the working directory was imported')\n")
    return tmp_path


def listing(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_it_runs_and_replays_from_a_read_only_installation(site, elsewhere):
    before = listing(site)
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}

    def sil(*arguments):
        command = [sys.executable, "-P", "-m", "sil", *arguments]
        done = subprocess.run(command, cwd=elsewhere, env=environment, capture_output=True, text=True, timeout=240)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    where = [sys.executable, "-P", "-c", "import protocol, firmware_sim, sil; print(sil.__file__)"]
    found = subprocess.run(where, cwd=elsewhere, env=environment, capture_output=True, text=True, check=True).stdout
    assert found.startswith(str(site))
    summary = json.loads(sil("run", "appc-rs232", "--set", "duration_s=30", "--set", "require=[]", "--json"))
    assert summary["verdict"] == "passed"
    for board in ("process", "cortex-m"):
        assert sil("replay", summary["run_dir"], "--board", board).startswith("identical")
    assert "mrac-rs232" in sil("scenarios")
    assert listing(site) == before


def test_the_wheel_holds_the_three_packages_the_firmware_and_their_data(site):
    names = {path.relative_to(site).as_posix() for path in site.rglob("*") if path.is_file()}
    top = {name.split("/")[0] for name in names if ".dist-info" not in name}
    assert top == {"protocol", "firmware_sim", "firmware", "sil"}
    listed = subprocess.run(
        ["git", "ls-files", "firmware"], cwd=REPO, capture_output=True, text=True, check=True
    ).stdout
    assert {name for name in names if name.startswith("firmware/")} == set(listed.split()), "all of it, and no build/"
    assets = subprocess.run(
        ["git", "ls-files", "sil/report/page/assets"], cwd=REPO, capture_output=True, text=True, check=True
    ).stdout
    assert set(assets.split()) <= names, "the report's page is made of them"
    assert {"protocol/SPEC.md", "sil/scenarios/mrac-rs232.yaml", "sil/py.typed"} <= names


def test_every_package_directory_is_listed_in_pyproject():
    import tomllib

    listed = set(tomllib.loads((REPO / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    folders = {
        ".".join(path.parent.relative_to(REPO).parts)
        for name in ("protocol", "firmware_sim", "sil")
        for path in (REPO / name).rglob("__init__.py")
    }
    assert listed == folders | {"firmware"}, "the firmware is data: its folders are no packages"
