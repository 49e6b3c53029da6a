"""The fuzzers themselves: each starts, tries something, finds nothing; and what one found once stays found.

The corpus holds inputs that led to a finding, or to a place that is hard to reach. Long runs: `python -m tools.fuzz`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tools.fuzz import CORPUS, IN_C, IN_PYTHON, REPO, load, native
from tools.fuzz import __main__ as main

SECONDS = 1.0


def kept(name: str) -> list[Path]:
    return sorted((CORPUS / name).glob("*"))


@pytest.fixture(scope="module")
def driver() -> native.Engine:
    return native.driver()


@pytest.mark.parametrize("name", IN_C)
def test_what_was_found_in_c_stays_found(driver: native.Engine, name: str) -> None:
    assert native.run_files(driver, name, kept(name)) == ""


@pytest.mark.parametrize("name", IN_PYTHON)
def test_what_was_found_in_python_stays_found(name: str) -> None:
    target = load(name)
    for path in kept(name):
        target.check(path.read_bytes())


def test_every_target_runs(tmp_path: Path) -> None:
    """A second each, blind, so that it is the same wherever it runs."""
    command = [sys.executable, "-m", "tools.fuzz", "--minutes", str(SECONDS / 60), "--blind", "--folder", str(tmp_path)]
    done = subprocess.run([*command, "--jobs", "2"], cwd=REPO, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    lines = done.stdout.partition("\ntarget ")[2].splitlines()[1:-1]
    tried = {line.split()[0]: int(line.split()[2]) for line in lines}
    assert set(tried) == {*IN_C, *IN_PYTHON}
    assert all(count > 10 for count in tried.values()), tried


def test_a_finding_is_kept(tmp_path: Path) -> None:
    """A target whose check always fails, in the place of a real one."""
    broken = (
        "import sys, tools.fuzz, tools.fuzz.worker as worker\n"
        "class Broken:\n"
        "    about = 'always a finding'\n"
        "    def seeds(self): return [b'seed']\n"
        "    def mutate(self, data, random): return data + b'x'\n"
        "    def check(self, data): tools.fuzz.expect(False, 'as it should be')\n"
        "worker.load = lambda name: Broken()\n"
        "sys.exit(worker.main())\n"
    )
    options = ["stream", "--seconds", "0.1", "--corpus", str(tmp_path), "--findings", str(tmp_path)]
    subprocess.run([sys.executable, "-c", broken, *options, "--engine", "mutation"], cwd=REPO, check=True, timeout=120)
    (found,) = tmp_path.glob("stream-????????????")
    assert found.read_bytes() == b"seed"
    assert "as it should be" in found.with_suffix(".txt").read_text()


@pytest.mark.parametrize(
    ("script", "said"), [("exit 77", "exit code 77"), ("echo no sanitizer here >&2; exit 1", "no sanitizer here")]
)
@pytest.mark.parametrize("engine", ["libFuzzer", "driver"])
def test_a_program_that_only_fails_is_a_finding(tmp_path: Path, engine: str, script: str, said: str) -> None:
    """A fuzzer that could not even start must not pass for ten minutes without a finding."""
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    ran = native.run(native.Engine(engine, program), "decoder", 1.0, tmp_path / "corpus", tmp_path, lambda line: None)
    (found,) = ran.findings
    assert said in found.with_suffix(".txt").read_text()
    assert main.summary([main.Result("decoder", engine, 1, 1.0, (str(found),))], tmp_path) == 1


def test_a_target_that_hangs_in_our_driver_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "SLACK_S", 0.0)
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\nexec sleep 600\n")
    program.chmod(0o755)
    ran = native.run(native.Engine("driver", program), "decoder", 0.2, tmp_path / "corpus", tmp_path, lambda line: None)
    assert len(ran.findings) == 1


def test_an_artifact_of_an_earlier_run_is_not_told_again(tmp_path: Path) -> None:
    (tmp_path / "decoder-crash-0123").write_bytes(b"long mended")
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\nexit 0\n")
    program.chmod(0o755)
    made = native.Engine("libFuzzer", program)
    assert native.run(made, "decoder", 1.0, tmp_path / "corpus", tmp_path, lambda line: None).findings == []


def test_exit_code_0_is_for_targets_that_tried_something_and_found_nothing(tmp_path: Path) -> None:
    assert main.summary([main.Result("decoder", "driver", 5, 1.0, ())], tmp_path) == 0
    assert main.summary([main.Result("decoder", "driver", 0, 1.0, ())], tmp_path) == 1
