"""A run, or a replay, as JUnit XML: a testcase for each requirement, and one for the run itself; for CI.

The root is <testsuite>, which the schemas of Jenkins and Surefire both know. Facts of the run stand in the suite's
<properties> and again in those of each testcase, where most readers look for them. Times are wall-clock seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

from sil.metrics import judge
from sil.report.whole_file import beside
from sil.rig import board_and_link
from sil.scenario_metrics import METRICS
from sil.trouble import EXIT_OK, UsageError

if TYPE_CHECKING:
    from sil.scenario import Scenario

THE_RUN = "the run itself"
THE_REPLAY = "replay is identical"
NOT_ENDED = "it has not ended: it still goes on, or was killed"
VERSIONS_OF = ("attitude-sil", "numpy", "numba")
# All that XML 1.0 cannot carry, escaped or not: control characters, surrogates (from file names), U+FFFE and U+FFFF.
UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

Facts = Mapping[str, str]


class Case(NamedTuple):
    """One testcase. `outcome`: passed, failure (the test says no), error (nothing could be judged), skipped."""

    name: str
    outcome: str = "passed"
    kind: str = ""  # of what went wrong: requirement, degraded, interrupted...
    message: str = ""  # one line
    facts: Facts = {}
    time_s: float = 0.0


# -- what the cases are --------------------------------------------------------------------------------------------


def of_run(scenario: Scenario, summary: Mapping[str, Any]) -> str:
    """The XML of a run that was made; summary: as sil.runner.run_scenario returns it."""
    facts = _facts_of(scenario) | {
        "verdict": str(summary["verdict"]),
        "run_dir": str(summary["run_dir"]),
        "log": str(Path(summary["run_dir"]) / "run.mcap"),
        "sha256": str(summary["sha256"]),
        "ticks": str(summary["ticks"]),
        "reproducible": str(summary["reproducible"]).lower(),
    }
    judged = [_judged(line) for line in summary["require"]]
    cases = [_run_case(summary), *(judged or _not_judged(scenario, f"not judged: {summary['verdict']}"))]
    return _text(scenario.name, facts, cases)


def of_no_run(name: str, scenario: Scenario | None, message: str, kind: str, about: str = THE_RUN) -> str:
    """The XML of a run that did not start, or did not end; scenario: None if not even that could be read."""
    cases = [Case(about, "error", kind, message)]
    if scenario is not None:
        cases += _not_judged(scenario, "not judged: there is no run")
    return _text(name if scenario is None else scenario.name, _facts_of(scenario) if scenario else {}, cases)


def of_replay(name: str, facts: Facts, difference: str) -> str:
    """The XML of a replay: one testcase, which failed if `difference` says where the answers are not the recorded."""
    case = Case(THE_REPLAY)
    if difference:
        case = case._replace(outcome="failure", kind="difference", message=difference)
    return _text(name, facts, [case])


def of_cases(name: str, facts: Facts, cases: Iterable[Case]) -> str:
    """The XML of any other test that consists of cases."""
    return _text(name, facts, cases)


def _run_case(summary: Mapping[str, Any]) -> Case:
    """Everything that can be wrong with a run, its requirements apart."""
    timing = summary["timing"]
    case = Case(THE_RUN, time_s=timing["start_s"] + timing["wall_s"] + timing["seal_s"])
    expected = any(str(line["metric"]).startswith("diverged_at_s") for line in summary["require"])
    if summary["verdict"] == "interrupted":
        return _wrong(case, "error", "interrupted", f"interrupted after {summary['ticks']} ticks")
    if summary["failure"]:
        return _wrong(case, "error", "failed", summary["failure"])
    if timing["degraded"]:
        late = f"{timing['late_ticks']} of {summary['ticks']} ticks late, slipped {timing['slipped_s']:.3f} s"
        return _wrong(case, "error", "degraded", f"timing degraded: {late}: a busy machine or too fast a clock")
    if summary["not_a_number"]:
        times = summary["not_a_number"]
        return _wrong(case, "failure", "not a number", f"torque or plant was not a number, {times} times")
    if summary["reason"] == "diverged" and not expected:
        at_s = summary["metrics"].get("diverged_at_s")
        return _wrong(case, "failure", "diverged", f"diverged after {summary['ticks']} ticks, at {at_s} s")
    if summary["exit_code"] != EXIT_OK and all(line["passed"] for line in summary["require"]):
        return _wrong(case, "error", "failed", f"{summary['verdict']}, exit code {summary['exit_code']}")
    return case


def _wrong(case: Case, outcome: str, kind: str, message: str) -> Case:
    return case._replace(outcome=outcome, kind=kind, message=message)


def _judged(line: Mapping[str, Any]) -> Case:
    value, margin = line["value"], line["margin"]
    said = line.get("reason") or _number(value)
    facts = {"metric": line["metric"], "value": said}
    if margin is not None:
        facts["margin"] = _number(margin)
    case = Case(line["requirement"], facts=facts)
    if line["passed"]:
        return case
    got = f"{line['requirement']}: got {said}" + (f", margin {margin:.4g}" if margin is not None else "")
    return _wrong(case, "failure", "requirement", got)


def _not_judged(scenario: Scenario, why: str) -> list[Case]:
    """The scenario's requirements by their names, so that a reader's history of each has no holes."""
    nothing = dict.fromkeys(METRICS)
    return [Case(each.requirement, "skipped", message=why) for each in judge(scenario.require, nothing)]


def _number(value: float | None) -> str:
    return "none" if value is None else repr(value)


def _facts_of(scenario: Scenario) -> dict[str, str]:
    law = scenario.law
    board, link = board_and_link(scenario)
    flies = {"law": f"{law.name} version {law.version}, {law.form}", "link": link}
    versions = {f"version.{name}": version(name) for name in VERSIONS_OF}
    return {
        "seed": str(scenario.seed),
        "clock": scenario.clock.mode,
        "board": board,
        **(flies if scenario.board != "none" else {}),
        **versions,
        "version.python": python_version(),
    }


# -- XML -----------------------------------------------------------------------------------------------------------


def _text(suite: str, facts: Facts, cases: Iterable[Case]) -> str:
    cases = list(cases)
    counts = {each: sum(case.outcome == each for case in cases) for each in ("failure", "error", "skipped")}
    root = ElementTree.Element(
        "testsuite",
        name=_printable(suite),
        tests=str(len(cases)),
        failures=str(counts["failure"]),
        errors=str(counts["error"]),
        skipped=str(counts["skipped"]),
        time=f"{sum(case.time_s for case in cases):.3f}",
    )
    _properties(root, facts)
    for case in cases:
        _add(root, suite, facts, case)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _add(root: ElementTree.Element, suite: str, facts: Facts, case: Case) -> None:
    attributes = {"classname": _printable(suite), "name": _printable(case.name), "time": f"{case.time_s:.3f}"}
    element = ElementTree.SubElement(root, "testcase", attributes)
    _properties(element, {**case.facts, **facts})
    if case.outcome == "skipped":
        ElementTree.SubElement(element, "skipped", message=_printable(case.message))
    elif case.outcome != "passed":
        wrong = ElementTree.SubElement(element, case.outcome, type=case.kind, message=_printable(case.message))
        lines = [case.message, *(f"{name}: {facts[name]}" for name in ("seed", "run_dir") if name in facts)]
        wrong.text = _printable("\n".join(lines))


def _properties(element: ElementTree.Element, facts: Facts) -> None:
    if facts:
        properties = ElementTree.SubElement(element, "properties")
        for name, value in facts.items():
            ElementTree.SubElement(properties, "property", name=_printable(name), value=_printable(value))


def _printable(text: str) -> str:
    """What XML cannot carry becomes U+FFFD."""
    return UNPRINTABLE.sub("\ufffd", text)


# -- file ----------------------------------------------------------------------------------------------------------


def write(file: Path, text: str) -> None:
    """Put `text` at `file`, whole or not at all; directories on the way are made. Raises UsageError."""
    try:
        target = file.resolve()
        if target.exists() and not target.is_file():
            raise UsageError(f"--junit: expected a file, got {file}")
        target.parent.mkdir(parents=True, exist_ok=True)
        with beside(target) as new:
            new.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"--junit: cannot write {file}: {error.strerror}") from None
