"""sil faults as a user runs it: the same map whoever flies and however often it was interrupted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from subprocesses import Cli

SMALL = ("--law", "pd", "--loss", "0.3", "--burst", "1,4", "--delay", "1", "--transport", "2", "--seeds", "2")
SHORT = ("--set", "duration_s=30", "--set", "sensors.attitude.noise_deg=0.02")
FILES = ("map.csv", "map.json", "map.png", "results.csv")


@pytest.fixture(scope="module")
def module_cli(tmp_path_factory):
    return Cli(tmp_path_factory.mktemp("margin"))


@pytest.fixture(scope="module")
def whole(module_cli):
    """The directory of a small map, flown by one worker."""
    out, _ = module_cli("faults", "pd-root-locus", *SMALL, *SHORT, "-j", "1", "--out", "whole")
    assert "18 of 18 runs" in out
    return module_cli.folder / "whole"


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in FILES}


def test_two_workers_make_the_same_map(module_cli, whole):
    module_cli("faults", "pd-root-locus", *SMALL, *SHORT, "-j", "2", "--out", "two")
    assert contents(module_cli.folder / "two") == contents(whole)


def test_an_interrupted_map_goes_on_to_the_same(module_cli, whole):
    half = module_cli.folder / "half"
    half.mkdir()
    lines = (whole / "results.jsonl").read_bytes().splitlines(keepends=True)
    (half / "results.jsonl").write_bytes(b"".join(lines[:7]))
    (half / "plan.json").write_bytes((whole / "plan.json").read_bytes())
    told = module_cli.json("faults", "--resume", "half")
    assert (told["finished"], told["points"], told["exit_code"], len(told["cells"])) == (18, 18, 0, 9)
    assert contents(half) == contents(whole)


def test_json_is_the_map(module_cli, whole):
    told = json.loads((whole / "map.json").read_text())
    rows = {(cell["transport"], cell["delay"]) for cell in told["cells"]}
    assert rows == {(1, 0), (1, 1), (2, 0)}
    assert [cell["nominal"] for cell in told["cells"]].count(True) == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "expected SCENARIO, or --resume DIR"),
        (("pd-root-locus", "--loss", "1.5"), "--loss: expected numbers"),
        (("pd-root-locus", "--burst", "0.5"), "--burst: expected numbers"),
        (("pd-root-locus", "--delay", "-1"), "--delay: expected whole numbers"),
        (("pd-root-locus", "--law", "no-such"), "a law that flies this scenario"),
        (("pd-root-locus", "--resume", "whole"), "expected no scenario"),
        (("--resume", "no-such"), "expected the directory of a sweep"),
    ],
)
def test_what_is_asked_for_wrongly_is_one_line(module_cli, arguments, told):
    _, err = module_cli("faults", *arguments, code=2)
    assert told in err
    assert err.count("\n") == 1


def test_another_sweep_is_no_map(module_cli):
    module_cli("sweep", "pd-root-locus", "--vary", "seed=1:2", *SHORT, "--set", "require=[]", "--out", "other")
    _, err = module_cli("faults", "--resume", "other", code=2)
    assert "expected a map of `sil faults`" in err
