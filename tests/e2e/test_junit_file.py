"""--junit through the command line: CI reads the file and not the terminal, so it has to be right whatever happens."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

SHORT = ("run", "appc-rs232", "--set", "duration_s=30", "--clock", "lockstep", "--junit", "ci.xml")
MET = "require=[{metric: missed, below: 1}]"
NOT_MET = "require=[{metric: missed, below: 1}, {metric: peak_error_deg.max, below: 1e-9}]"


def cases(file: Path) -> dict[str, str]:
    """Name of each case to what became of it: passed, failure, error, skipped."""
    root = ElementTree.fromstring(file.read_bytes())
    found = {str(case.get("name")): [child.tag for child in case if child.tag != "properties"] for case in root}
    return {name: (tags or ["passed"])[0] for name, tags in found.items() if name != "None"}


def test_a_run_that_passes(cli):
    summary = cli.json(*SHORT, "--set", MET, "--link", "inproc")
    assert set(cases(cli.folder / "ci.xml").values()) == {"passed"}
    text = (cli.folder / "ci.xml").read_text()
    assert summary["sha256"] in text
    assert f"{summary['run_dir']}/run.mcap" in text
    cli("replay", summary["run_dir"], "--junit", "replay.xml")
    assert cases(cli.folder / "replay.xml") == {"replay is identical": "passed"}
    cli("replay", summary["run_dir"], "--set", "law.params.controller_pole=0.6", "--junit", "replay.xml", code=1)
    assert cases(cli.folder / "replay.xml") == {"replay is identical": "failure"}
    cli("replay", "nowhere", "--junit", "replay.xml", code=2)
    assert cases(cli.folder / "replay.xml") == {"replay is identical": "error"}


def test_a_run_that_does_not_pass_or_does_not_start_replaces_a_green_file(cli):
    cli(*SHORT, "--set", NOT_MET, "--link", "inproc", "-q", code=1)
    found = cases(cli.folder / "ci.xml")
    assert (found["missed < 1"], found["peak_error_deg.max < 1e-09"]) == ("passed", "failure")
    cli(*SHORT, "--set", "law.nmae=appc", code=2)
    assert cases(cli.folder / "ci.xml") == {"the run itself": "error"}
    cli(*SHORT, "--set", MET, "--board", "serial:///dev/not-there", code=3)
    assert cases(cli.folder / "ci.xml") == {"the run itself": "error", "missed < 1": "skipped"}


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 130), (signal.SIGKILL, -9)])
def test_a_run_that_is_stopped_or_killed(cli, number, code):
    """Killed, it leaves what it said at the start: that it has not ended."""
    slow = ("run", "appc-rs232", "--set", MET, "--clock", "realtime", "--link", "inproc", "--junit", "ci.xml")
    process = cli.start(*slow, "--out", "here")
    journal = cli.folder / "here" / "run.journal"
    until = time.monotonic() + 60
    while time.monotonic() < until and not (journal.exists() and journal.stat().st_size > 5000):
        time.sleep(0.05)
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == code
    assert cases(cli.folder / "ci.xml")["the run itself"] == "error"
    assert "passed" not in cases(cli.folder / "ci.xml").values()


def test_a_place_that_cannot_be_written_is_said_before_the_run(cli):
    (cli.folder / "folder").mkdir()
    out, err = cli("run", "appc-rs232", "--junit", "folder", code=2)
    assert (out, err) == ("", "--junit: expected a file, got folder\n")
    assert not (cli.folder / "runs").exists()


def test_it_does_not_write_over_what_is_read(cli):
    """A CI file that replaces its own scenario, or the log that it judges, destroys what cannot be made again."""
    own = cli.folder / "own.yaml"
    own.write_text("extends: appc-rs232\nduration_s: 5\nclock: lockstep\nlink: inproc\n")
    before = own.read_bytes()
    expected = "--junit: expected a file apart from what is read, got {}, and {} is read\n"
    for spelling in ("own.yaml", "./own.yaml", str(own)):
        assert cli("run", "own.yaml", "--junit", spelling, code=2)[1] == expected.format(Path(spelling), "own.yaml")
    assert own.read_bytes() == before
    cli("run", "own.yaml", "--out", "here", "--junit", "here/summary.json", "-q", code=2)
    assert not (cli.folder / "here").exists()
    cli("run", "own.yaml", "--out", "here", "--junit", "here/ci.xml", "-q")
    kept = {path.name: path.read_bytes() for path in (cli.folder / "here").iterdir()}
    for source, file in (("here", "here/new.xml"), ("here", "here/run.mcap"), ("here/run.mcap", "here/summary.json")):
        assert cli("replay", source, "--junit", file, code=2)[1] == expected.format(file, source)
    assert {path.name: path.read_bytes() for path in (cli.folder / "here").iterdir()} == kept
