"""The built-in scenarios as one Markdown table of every value that is not the default: docs/reference/scenarios.md.

python -m sil.scenario_table > docs/reference/scenarios.md
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sil.plain import flat
from sil.scenario import Scenario, load_scenario, load_values
from sil.scenarios import list_scenarios

HEAD = """# Built-in scenarios

Made by `python -m sil.scenario_table`; a test keeps it current. Every value that differs from the default is listed,
and nothing else differs; `law.params.*` are compared with the defaults of the law that flies. The files are in
`sil/scenarios/`, with the reason for each number and a remark where it is a guess.
"""


def non_defaults(scenario: Scenario) -> dict[str, Any]:
    """Key to value of everything that is not the default; `require` and `about` left out."""
    plain = load_values({"law": {"name": scenario.law.name}})
    values = {key: value for key, value in scenario.resolved().items() if key != "variants"}
    mine, default = flat(values), flat(plain.resolved())
    if scenario.board != "none":
        default["law.name"] = ""  # always worth a line
    left_out = ("name", "about", "require")
    return {key: value for key, value in mine.items() if value != default.get(key) and key not in left_out}


def markdown() -> str:
    """The whole of docs/reference/scenarios.md."""
    infos = list_scenarios()
    about = "".join(f"- `{info.name}`: {info.about}.\n" for info in infos)
    rows = "".join(row for info in infos for row in _rows(load_scenario(info.name)))
    return f"{HEAD}\n{about}\n| scenario | key | value |\n|---|---|---|\n{rows}"


def _rows(scenario: Scenario) -> Iterator[str]:
    for key, value in non_defaults(scenario).items():
        yield f"| {scenario.name} | `{key}` | {_text(value)} |\n"
    for name, variant in scenario.variants.items():
        yield f"| {scenario.name} | variant `{name}` | {variant.get('about', '')} |\n"
    for line in scenario.require:
        bounds = line.model_dump(exclude={"metric"}, exclude_none=True)
        said = " ".join(f"{word} {_text(value)}" for word, value in bounds.items())
        yield f"| {scenario.name} | `require` | {line.metric} {said} |\n"


def _text(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_text(item) for item in value) + "]"
    return f"{value:.17g}" if isinstance(value, float) and value != round(value, 9) else str(value)


if __name__ == "__main__":
    print(markdown(), end="")
