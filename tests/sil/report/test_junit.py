"""The JUnit XML of a run is one that Jenkins and Surefire read, and never green or empty where something went wrong.

Their schemas in short: a <testsuite> with counts that are required; <properties> first; a <testcase> has a name, a
class and a time. Neither schema knows <properties> inside of a testcase; every reader we know of takes or skips them.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sil.metrics import judge
from sil.plain import plain
from sil.report import junit
from sil.report.junit_file import JunitFile
from sil.scenario import Scenario, load_scenario
from sil.trouble import UsageError

NAMES = ("rms_error_deg.max < 0.1", "missed < 1")
SUITE = {"name", "tests", "failures", "errors", "skipped", "time"}
TIME = re.compile(r"[0-9]+\.[0-9]{3}")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    require = "[{metric: rms_error_deg.max, below: 0.1}, {metric: missed, below: 1}]"
    return load_scenario("mrac-rs232", [f"require={require}", "seed=7"])


def summary_of(scenario: Scenario, error_deg: float = 0.01, **changes: Any) -> dict[str, Any]:
    """A summary as run_scenario returns it, of a run that passed unless `changes` say otherwise."""
    metrics = {"rms_error_deg": [error_deg, 0.0, 0.0], "missed": 0, "diverged_at_s": 50.0}
    timing = {"start_s": 0.5, "wall_s": 1.25, "seal_s": 0.25, "degraded": False, "late_ticks": 0, "slipped_s": 0.0}
    timing |= changes.pop("timing", {})
    require = [judgement._asdict() for judgement in judge(scenario.require, metrics)]
    verdict = {"verdict": "passed", "exit_code": 0, "failure": "", "reason": "finished", "not_a_number": 0}
    if not all(line["passed"] for line in require):
        verdict |= {"verdict": "failed", "exit_code": 1}
    rest = {"ticks": 1200, "reproducible": True, "sha256": "ab" * 32, "run_dir": "runs/x-001", "metrics": metrics}
    return {"require": require, "timing": timing, **verdict, **rest, **changes}


def parsed(text: str) -> ElementTree.Element:
    """The suite, held against both schemas."""
    root = ElementTree.fromstring(text.encode())
    assert root.tag == "testsuite"
    assert set(root.attrib) == SUITE
    cases = root.findall("testcase")
    assert int(root.get("tests")) == len(cases) > 0
    for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        assert int(root.get(name)) == sum(case.find(tag) is not None for case in cases)
    assert [child.tag for child in root] in (["testcase"] * len(cases), ["properties"] + ["testcase"] * len(cases))
    for element in (root, *cases):
        assert TIME.fullmatch(element.get("time"))
        assert all(set(each.attrib) == {"name", "value"} for each in element.findall("properties/property"))
    for case in cases:
        assert set(case.attrib) == {"classname", "name", "time"}
        assert [child.tag for child in case if child.tag != "properties"] in ([], ["failure"], ["error"], ["skipped"])
        assert all(wrong.get("type") for tag in ("failure", "error") for wrong in case.findall(tag))
    return root


def outcomes(root: ElementTree.Element) -> dict[str, str]:
    """Name of each case to what became of it."""
    wrong = ("failure", "error", "skipped")
    return {
        str(case.get("name")): next((child.tag for child in case if child.tag in wrong), "passed")
        for case in root.findall("testcase")
    }


def facts(case: ElementTree.Element) -> dict[str, str]:
    return {each.get("name", ""): each.get("value", "") for each in case.findall("properties/property")}


def test_a_case_for_each_requirement_and_one_for_the_run(scenario: Scenario) -> None:
    root = parsed(junit.of_run(scenario, summary_of(scenario)))
    assert outcomes(root) == dict.fromkeys((junit.THE_RUN, *NAMES), "passed")
    assert root.get("time") == "2.000"
    assert {case.get("classname") for case in root.findall("testcase")} == {"mrac-rs232"}


def test_every_case_says_what_is_needed_to_fly_it_again(scenario: Scenario) -> None:
    root = parsed(junit.of_run(scenario, summary_of(scenario)))
    common = {"seed": "7", "log": "runs/x-001/run.mcap", "sha256": "ab" * 32, "law": "mrac version 1, fixed",
              "clock": "lockstep", "board": "process", "link": "pty", "verdict": "passed"}  # fmt: skip
    for element in (root, *root.findall("testcase")):
        assert common.items() <= facts(element).items()
        assert "version.attitude-sil" in facts(element)
    case = root.findall("testcase")[1]
    assert {"metric": "rms_error_deg.max", "value": "0.01", "margin": "0.09000000000000001"}.items() <= facts(
        case
    ).items()


def test_a_requirement_that_is_not_met_is_a_failure_with_its_value(scenario: Scenario) -> None:
    root = parsed(junit.of_run(scenario, summary_of(scenario, error_deg=0.25)))
    assert outcomes(root) == {junit.THE_RUN: "passed", NAMES[0]: "failure", NAMES[1]: "passed"}
    failure = root.find("testcase/failure")
    assert failure is not None
    assert failure.get("message") == "rms_error_deg.max < 0.1: got 0.25, margin -0.15"
    assert "run_dir: runs/x-001" in str(failure.text)


def test_not_a_number_fails_its_requirement_without_a_margin(scenario: Scenario) -> None:
    root = parsed(junit.of_run(scenario, summary_of(scenario, error_deg=float("nan"))))
    assert outcomes(root)[NAMES[0]] == "failure"
    assert "margin" not in facts(root.findall("testcase")[1])


LATE = {"degraded": True, "late_ticks": 3}
WRONG: dict[str, tuple[dict[str, Any], str, str]] = {
    "link": ({"verdict": "failed", "exit_code": 3, "failure": "board: gone", "require": []}, "error", "board: gone"),
    "interrupted": ({"verdict": "interrupted", "exit_code": 130, "require": []}, "error", "after 1200 ticks"),
    "degraded": ({"verdict": "degraded", "exit_code": 3, "timing": LATE}, "error", "3 of 1200"),
    "not a number": ({"verdict": "failed", "exit_code": 1, "not_a_number": 2}, "failure", "not a number, 2 times"),
    "diverged": ({"verdict": "failed", "exit_code": 1, "reason": "diverged"}, "failure", "diverged"),
    "a verdict of tomorrow": ({"verdict": "cursed", "exit_code": 1}, "error", "cursed"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_with_a_run_is_a_case_that_is_not_green(name: str, scenario: Scenario) -> None:
    """All requirements met, or none judged: the suite must not be green for it."""
    changes, outcome, says = WRONG[name]
    root = parsed(junit.of_run(scenario, summary_of(scenario, **changes)))
    assert outcomes(root)[junit.THE_RUN] == outcome
    assert says in str(root.find(f"testcase/{outcome}").get("message"))  # type: ignore[union-attr]
    assert set(outcomes(root)) == {junit.THE_RUN, *NAMES}
    if changes.get("require") == []:
        assert outcomes(root)[NAMES[0]] == "skipped"


def test_a_divergence_that_is_asked_for_is_none_of_the_runs_faults() -> None:
    scenario = load_scenario("mrac-rs232", ["require=[{metric: diverged_at_s, below: 100}]"])
    root = parsed(junit.of_run(scenario, summary_of(scenario, reason="diverged")))
    assert set(outcomes(root).values()) == {"passed"}


def test_a_run_that_did_not_start_is_an_error(scenario: Scenario) -> None:
    root = parsed(junit.of_no_run("x", None, "scenario: expected a file, got 'x'", "ScenarioInvalid"))
    assert outcomes(root) == {junit.THE_RUN: "error"}
    root = parsed(junit.of_no_run("x", scenario, "no board", "LinkFailure"))
    assert outcomes(root) == {junit.THE_RUN: "error", **dict.fromkeys(NAMES, "skipped")}


@pytest.mark.parametrize(("difference", "outcome"), [("", "passed"), ("differs at tick 3\n  recorded: <x>", "failure")])
def test_a_replay_is_one_case(difference: str, outcome: str) -> None:
    root = parsed(junit.of_replay("x", {"run_dir": "runs/x"}, difference))
    assert outcomes(root) == {junit.THE_REPLAY: outcome}


@given(st.text(st.characters(codec=None), max_size=30))
def test_any_text_makes_valid_xml(text: str) -> None:
    """File names hold surrogates, an exception's text anything; XML 1.0 does not carry control characters at all."""
    root = parsed(junit.of_no_run(text, None, text, "kind"))
    message = str(root.find("testcase/error").get("message"))  # type: ignore[union-attr]
    assert len(message) == len(text)
    assert all(a in (b, "\ufffd") for a, b in zip(message, text, strict=True))


# -- the file ------------------------------------------------------------------------------------------------------


def says(file: Path) -> str:
    """The message of the only error in the file."""
    return str(parsed(file.read_text(encoding="utf-8")).find("testcase/error").get("message"))  # type: ignore[union-attr]


def test_from_the_start_the_file_is_not_an_older_green_one(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "results.xml"
    with JunitFile(file, "x"):
        assert says(file) == junit.NOT_ENDED
    with pytest.raises(KeyboardInterrupt), JunitFile(file, "x"):
        raise KeyboardInterrupt
    assert says(file) == "interrupted"
    with pytest.raises(UsageError), JunitFile(file, "x"):
        raise UsageError("no such law")
    assert says(file) == "no such law"


def test_nothing_is_put_into_a_run_directory_that_has_to_be_empty(tmp_path: Path) -> None:
    out = tmp_path / "run"
    with JunitFile(out / "results.xml", "x", out) as page:
        assert not out.exists()
        page.write(junit.of_replay("x", {}, ""))
    assert (out / "results.xml").is_file()


def test_nor_into_one_that_the_scenario_names(tmp_path: Path) -> None:
    """`out` may stand in the scenario file, which is read after the file was begun."""
    out = tmp_path / "run"
    with JunitFile(out / "results.xml", "x") as page:
        page.leave_empty(out)
        assert list(out.iterdir()) == []
    with JunitFile(tmp_path / "results.xml", "x") as page:
        page.leave_empty(out)
        assert says(tmp_path / "results.xml") == junit.NOT_ENDED


def test_the_file_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "results.xml"
    junit.write(file, "old")

    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(UsageError, match=r"^--junit: cannot write .*results\.xml: No space left on device$"):
        junit.write(file, "new")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


@pytest.mark.parametrize("place", ["/dev/null", "/proc/no/results.xml", "."])
def test_what_is_no_place_for_a_file_is_refused_and_left(place: str) -> None:
    """Renaming a file onto /dev/null as root would replace the device."""
    with pytest.raises(UsageError, match="--junit: "):
        junit.write(Path(place), "x")
    assert Path("/dev/null").is_char_device()


def test_a_requirement_without_a_number_says_why() -> None:
    """`got none` of an axis that never settled reads as if nothing had been measured."""
    metrics = {"settling_s": [None, math.inf, 2.0]}
    lines = [{"metric": f"settling_s.{part}", "below": 60.0} for part in ("roll", "max")]
    cases = [junit._judged(plain(each._asdict())) for each in judge(lines, metrics)]
    assert [case.message.partition(": ")[2] for case in cases] == ["got no step", "got never"]
    assert [case.facts["value"] for case in cases] == ["no step", "never"]
