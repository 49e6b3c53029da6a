"""What several verbs share: their arguments and options, the scenario or run these name, JSON on stdout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from sil.runs import Run
    from sil.scenario import Scenario

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Built-in name (see `sil scenarios`) or YAML file.")
]
RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="Run directory, or a run.mcap.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override one key, such as law.params.c2_pole=0.7; repeatable."),
]
ClockOption = Annotated[str | None, typer.Option("--clock", help="lockstep, realtime or scaled:N (N times real time).")]
LinkOption = Annotated[
    str | None,
    typer.Option("--link", metavar="URL", help="pty, udp, inproc, udp://HOST:PORT or serial:///dev/X?baud=N."),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="Run directory; refused if not empty. Default: runs/NAME-NNN.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on stdout, for programs.")]

_KEYS = {"clock": "clock.mode", "link": "link.url", "board": "board"}


def scenario_from(name: str, sets: list[str] | None, **options: str | None) -> Scenario:
    """The scenario with its overrides; --clock, --link and --board are short for keys. Raises ScenarioInvalid."""
    from sil.scenario import load_scenario

    overrides = [f"{_KEYS[key]}={value}" for key, value in options.items() if value is not None]
    return load_scenario(name, [*(sets or ()), *overrides])


def opened(path: Path) -> Run:
    """The run at this place. Raises RunError."""
    from sil.runs import open_run

    return open_run(path)


def print_json(content: Any) -> None:
    """One JSON value on stdout; what JSON does not know as text."""
    print(json.dumps(content, indent=2, allow_nan=False, default=str))
