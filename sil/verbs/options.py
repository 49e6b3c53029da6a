"""What several verbs share: their arguments and options, the scenario or run these name, JSON on stdout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sil.trouble import UsageError
from sil.verbs import completion

if TYPE_CHECKING:
    from sil.live_view import LiveOrder
    from sil.runs import Run
    from sil.scenario import Scenario

KEYS_PANEL = "Keys of the scenario"
MACHINE_PANEL = "What the machine grants"
RESULT_PANEL = "Results"
LIVE_PANEL = "Live view"
SWEEP_PANEL = "How the sweep goes on"
LIVE_AT = "127.0.0.1:8765"  # where viewers look first

ScenarioArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="Built-in name (see `sil scenarios`) or YAML file.",
        autocompletion=completion.scenarios,
    ),
]
SweptArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="SCENARIO",
        help="Built-in name (see `sil scenarios`) or YAML file; none with --resume.",
        autocompletion=completion.scenarios,
    ),
]
RunArgument = Annotated[
    Path, typer.Argument(metavar="RUN", help="Run directory, or a run.mcap.", autocompletion=completion.runs)
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override one key, such as law.params.c2_pole=0.7; repeatable. Keys and units: `sil schema`.",
        rich_help_panel=KEYS_PANEL,
        autocompletion=completion.sets,
    ),
]
VariantOption = Annotated[
    str | None,
    typer.Option(
        "--variant",
        metavar="NAME",
        help="One of the scenario's variants, such as another law; short for variant.",
        rich_help_panel=KEYS_PANEL,
        autocompletion=completion.variants,
    ),
]
ClockOption = Annotated[
    str | None,
    typer.Option(
        "--clock",
        metavar="CLOCK",
        help="lockstep, realtime or scaled:N (N times real time, 0.01 to 1000).",
        rich_help_panel=KEYS_PANEL,
        autocompletion=completion.clocks,
    ),
]
LinkOption = Annotated[
    str | None,
    typer.Option(
        "--link",
        metavar="URL",
        help="pty, udp, inproc, udp://HOST:PORT or serial:///dev/X?baud=N.",
        rich_help_panel=KEYS_PANEL,
        autocompletion=completion.links,
    ),
]
PriorityOption = Annotated[
    int | None,
    typer.Option(
        "--priority",
        metavar="N",
        min=1,
        max=99,
        help="SCHED_FIFO priority of laboratory and board; short for clock.priority.",
        show_default=False,
        rich_help_panel=MACHINE_PANEL,
    ),
]
CpusOption = Annotated[
    str | None,
    typer.Option(
        "--cpus",
        metavar="LAB,BOARD",
        help="CPU of the laboratory, CPU of the board, such as 0,1; short for clock.lab_cpu and clock.board_cpu.",
        rich_help_panel=MACHINE_PANEL,
    ),
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        "-j",
        metavar="N",
        help="Worker processes. Default: one for each CPU; one alone where the clock is not lockstep.",
        rich_help_panel=SWEEP_PANEL,
    ),
]
ResumeOption = Annotated[
    str | None,
    typer.Option(
        "--resume",
        metavar="DIR",
        help="Go on with what is in this directory; its plan says what is varied.",
        rich_help_panel=SWEEP_PANEL,
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Run directory; refused if not empty. Default: runs/NAME-NNN.",
        rich_help_panel=RESULT_PANEL,
    ),
]
JunitOption = Annotated[
    Path | None,
    typer.Option(
        "--junit",
        metavar="FILE",
        help="JUnit XML for CI: a testcase per requirement and one for the run itself; written whatever happens.",
        rich_help_panel=RESULT_PANEL,
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="One JSON object on stdout, for programs.", rich_help_panel=RESULT_PANEL)
]
QuietOption = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Nothing but the verdict, in one line; errors.", rich_help_panel=RESULT_PANEL),
]
VerboseOption = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Also every event, the facts of link and session, a histogram of wake-ups.",
        rich_help_panel=RESULT_PANEL,
    ),
]

LiveOption = Annotated[
    bool,
    typer.Option(
        "--live",
        help="Show the run to Foxglove or Lichtblick while it goes on; the same bytes are logged, the loop waits for "
        "nobody.",
        rich_help_panel=LIVE_PANEL,
    ),
]
LiveAtOption = Annotated[
    str | None,
    typer.Option(
        "--live-at",
        metavar="HOST:PORT",
        help="Where viewers connect; implies --live. Port 0: any free one, named on stderr. Default: 127.0.0.1:8765.",
        show_default=False,
        rich_help_panel=LIVE_PANEL,
        autocompletion=completion.addresses,
    ),
]
LiveWaitOption = Annotated[
    float | None,
    typer.Option(
        "--live-wait",
        metavar="S",
        min=0.0,
        help="Start when the first viewer is there, or after S seconds; implies --live.",
        show_default=False,
        rich_help_panel=LIVE_PANEL,
    ),
]

_KEYS = {"clock": "clock.mode", "link": "link.url", "priority": "clock.priority"} | {
    key: key for key in ("variant", "board")
}


def scenario_from(name: str, sets: list[str] | None, **options: str | None) -> Scenario:
    """The scenario with its overrides; --clock, --link, --board... are short for keys. Raises ScenarioInvalid."""
    from sil.scenario import load_scenario

    overrides = [f"{_KEYS[key]}={value}" for key, value in options.items() if value is not None]
    return load_scenario(name, [*(sets or ()), *overrides])


def cpu_sets(cpus: str | None) -> list[str]:
    """--cpus as overrides; either side may be left out: `0`, `0,1`, `,1`. Raises UsageError."""
    parts = (cpus or "").split(",")
    known = len(parts) <= 2 and any(parts) and all(part.isdecimal() or not part for part in parts)
    if cpus is not None and not known:
        raise UsageError(f"--cpus: expected LAB,BOARD, numbers of CPUs such as 0,1, got {cpus!r}")
    return [f"{key}={part}" for key, part in zip(("clock.lab_cpu", "clock.board_cpu"), parts, strict=False) if part]


def live_order(live: bool, at: str | None, wait_s: float | None) -> LiveOrder | None:
    """What --live, --live-at and --live-wait ask for; None without any of them. Raises UsageError."""
    from sil.live_view import LiveOrder

    if not live and at is None and wait_s is None:
        return None
    return LiveOrder(*address("--live-at", LIVE_AT if at is None else at), wait_s or 0.0)


def address(option: str, text: str) -> tuple[str, int]:
    """HOST:PORT or [HOST]:PORT. Raises UsageError."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise UsageError(f"{option}: expected HOST:PORT such as {LIVE_AT}, port 0 to 65535, got {text!r}")
    return host.removeprefix("[").removesuffix("]"), int(port)


def resumed(directory: str) -> Path:
    """--resume. Raises UsageError."""
    if not directory:
        raise UsageError("--resume: expected the directory of a sweep, got an empty text")
    return Path(directory)


def variant_sets(variant: str | None) -> list[str]:
    """--variant as an override."""
    return [] if variant is None else [f"variant={variant}"]


def verbosity_of(quiet: bool, verbose: bool) -> int:
    """-1, 0 or 1, as sil.screen takes it. Raises UsageError."""
    if quiet and verbose:
        raise UsageError("-q, -v: expected one of them, got both")
    return int(verbose) - int(quiet)


def opened(path: Path) -> Run:
    """The run at this place. Raises RunError."""
    from sil.runs import open_run

    return open_run(path)


def print_json(content: Any) -> None:
    """One JSON value on stdout; what JSON does not know as text."""
    print(json.dumps(content, indent=2, allow_nan=False, default=str))
