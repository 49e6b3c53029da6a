"""sil check, scenarios, schema: what can be run, and what a scenario file may say."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from sil.trouble import EXIT_OK, EXIT_USAGE
from sil.verbs.options import JsonOption, ScenarioArgument, SetOption, VariantOption, print_json, scenario_from


def check(
    scenario: ScenarioArgument,
    set_: SetOption = None,
    variant: VariantOption = None,
    as_json: JsonOption = False,
) -> int:
    """Validate a scenario and its time budget (wire and execution time against the period) without running it.

    Reads the scenario, what it extends and the files it names; writes nothing. Each finding is a line on stderr: file,
    line, key, what was expected and what stands there. Errors would keep it from running; a warning is something that
    looks unintended. Without --variant all variants are checked, too. Then it names the JSON Schema for your editor,
    which checks keys and ranges as you type.

    Exit codes: 0 valid, warnings or not; 2 an error.

    Examples: sil check mine.yaml | sil check mrac-rs232 --set link.baud=9600 | sil check mine.yaml --json
    """
    from sil.checks import check as findings_of
    from sil.instruments import ages
    from sil.scenarios import SCHEMA

    loaded = scenario_from(scenario, set_, variant=variant)
    others = [scenario_from(scenario, set_, variant=name) for name in loaded.variants]
    findings = list(dict.fromkeys(finding for each in (loaded, *others) for finding in findings_of(each)))
    errors = [finding for finding in findings if finding.severity == "error"]
    if as_json:
        content = {"valid": not errors, "findings": [finding._asdict() for finding in findings], "schema": str(SCHEMA)}
        print_json(content)
    for finding in findings if not as_json else ():
        print(finding, file=sys.stderr)
    if errors:
        return EXIT_USAGE
    if not as_json:
        print(f"{loaded.name}: valid, {loaded.ticks} ticks of {loaded.period_s:g} s")
        if others:
            print(f"its variants, valid: {', '.join(loaded.variants)}")
        for line in ages(loaded):
            print(line)
        print(f"schema for editors, first line of the file: # yaml-language-server: $schema={SCHEMA}")
    return EXIT_OK


def scenarios(as_json: JsonOption = False) -> int:
    """List the built-in scenarios: name and what each is about.

    They are files of the package, to run by name, to extend (`extends: mrac-rs232` as first line of your own) or to
    read. Writes a table on stdout.

    Exit codes: 0 always.

    Examples: sil scenarios | sil scenarios --json
    """
    from sil.scenarios import list_scenarios

    known = list_scenarios()
    if as_json:
        print_json([entry._asdict() for entry in known])
        return EXIT_OK
    from sil.screen import show_table

    show_table(("scenario", "what it is"), [(entry.name, entry.about) for entry in known])
    return EXIT_OK


def schema(
    path: Annotated[bool, typer.Option("--path", help="Where the file is, instead of what it says.")] = False,
) -> int:
    """Print the JSON Schema of a scenario file: every key with meaning, unit, range and default.

    For an editor that speaks YAML (VS Code with the YAML extension, Neovim, Emacs, JetBrains): make the first line of a
    scenario `# yaml-language-server: $schema=FILE`, FILE as --path says, and keys are completed and checked as you
    type. It cannot tell what only `sil check` can: whether keys fit each other, and whether deadlines can be met.

    Exit codes: 0 always.

    Examples: sil schema --path | sil schema > scenario.schema.json
    """
    from sil.scenarios import SCHEMA

    print(SCHEMA if path else SCHEMA.read_text(encoding="utf-8"), end="\n" if path else "")
    return EXIT_OK
