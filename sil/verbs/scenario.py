"""sil check, scenarios: what can be run."""

from __future__ import annotations

import sys

from sil.trouble import EXIT_OK, EXIT_USAGE
from sil.verbs.options import JsonOption, ScenarioArgument, SetOption, print_json, scenario_from


def check(scenario: ScenarioArgument, set_: SetOption = None, as_json: JsonOption = False) -> int:
    """Validate a scenario and its time budget (wire and execution time against the period) without running it."""
    from sil.checks import check as findings_of

    loaded = scenario_from(scenario, set_)
    findings = findings_of(loaded)
    errors = [finding for finding in findings if finding.severity == "error"]
    if as_json:
        print_json({"valid": not errors, "findings": [finding._asdict() for finding in findings]})
    for finding in findings if not as_json else ():
        print(finding, file=sys.stderr)
    if errors:
        return EXIT_USAGE
    if not as_json:
        print(f"{loaded.name}: valid, {loaded.ticks} ticks of {loaded.period_s:g} s")
    return EXIT_OK


def scenarios(as_json: JsonOption = False) -> int:
    """List the built-in scenarios."""
    from sil.scenarios import list_scenarios

    known = list_scenarios()
    if as_json:
        print_json([entry._asdict() for entry in known])
        return EXIT_OK
    from sil.screen import show_table

    show_table(("scenario", "what it is"), [(entry.name, entry.about) for entry in known])
    return EXIT_OK
