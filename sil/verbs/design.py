"""sil design: compensators and fuzzy tables on the ground, with their margins, for law state_space and fvsc."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_OK, EXIT_REQUIREMENT, UsageError
from sil.verbs import completion
from sil.verbs.design_options import (
    DESIGN_PANEL,
    DelayOption,
    FileOption,
    InertiaOption,
    IntegralOption,
    MethodOption,
    OrderOption,
    PadeOption,
    PeriodOption,
    PlotOption,
    SensorOption,
    TicksOption,
    YamlOption,
)
from sil.verbs.manual import page_of
from sil.verbs.options import RESULT_PANEL, JsonOption, print_json

if TYPE_CHECKING:
    from sil.design.sheet import Inertia, Sampling, Sheet

app = typer.Typer(
    name="design",
    no_args_is_help=True,
    rich_markup_mode="rich",
    help="Design a compensator or a fuzzy table on the ground: its margins, and the `law:` section of a scenario.\n\n"
    "[not dim]A compensator is made for one axis, a rigid body behind a delay, and multiplied by the inertia of each. "
    "[bold]sil design KIND -h[/] says what a kind takes, with examples.[/]",
    epilog="[bold]Examples[/]\n[cyan]   sil design glover --wc 0.5 --delay 1 --period 0.5[/]",
)


def lqg(
    control: Annotated[
        float,
        typer.Option(
            "--control-bandwidth", metavar="RADPS", help="Of the regulator, rad/s.", rich_help_panel=DESIGN_PANEL
        ),
    ] = 0.5,
    observer: Annotated[
        float,
        typer.Option(
            "--observer-bandwidth", metavar="RADPS", help="Of the observer, rad/s.", rich_help_panel=DESIGN_PANEL
        ),
    ] = 2.0,
    integral: IntegralOption = 0.0,
    inertia: InertiaOption = "1",
    delay: DelayOption = 0.0,
    pade: PadeOption = 2,
    period: PeriodOption = None,
    method: MethodOption = "ramp",
    ticks: TicksOption = 1,
    sensor_delay: SensorOption = 0.0,
    order: OrderOption = None,
    as_json: JsonOption = False,
    as_yaml: YamlOption = False,
    out: FileOption = None,
    plot: PlotOption = None,
) -> int:
    """LQG: the H2-optimal compensator, from two Riccati equations.

    Cost: angle^2 + torque^2 / (J wc^2)^2 with wc the control bandwidth; torque noise of intensity (J wo^2)^2 and unit
    noise of the angle, wo the observer bandwidth. Without delay regulator and observer have their
    poles there. The delay is part of the plant. LQG promises no margins: look at them.

    Exit codes: 0 designed, 1 a loop is not stable, 2 usage.

    Examples: sil design lqg --inertia 0.01 --delay 0.4 |
    sil design lqg --inertia 0.01 --control-bandwidth 0.316228 --observer-bandwidth 10 --integral 1 |
    sil design lqg --inertia 2.13,3.04,3.09 --delay 0.75 --period 0.5 --yaml
    """
    from sil.design.lqg import Weights
    from sil.design.sheet import of_lqg

    weights = Weights(_positive("--control-bandwidth", control), _positive("--observer-bandwidth", observer),
                      _not_negative("--integral", integral))  # fmt: skip
    sampling = _sampling(period, ticks, sensor_delay, method, order)
    sheet = of_lqg(weights, _inertia(inertia), _not_negative("--delay", delay), pade, sampling)
    return _hand_out(sheet, as_json, as_yaml, out, plot)


def glover(
    wc: Annotated[
        float,
        typer.Option(
            "--wc", metavar="RADPS", help="Crossover of the shaped plant, rad/s.", rich_help_panel=DESIGN_PANEL
        ),
    ] = 1.0,
    alpha: Annotated[
        float,
        typer.Option(
            "--alpha",
            metavar="X",
            help="The slope becomes -1 at wc/alpha: more of it is more robust and slower.",
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = 4.0,
    rolloff: Annotated[
        float, typer.Option("--rolloff", metavar="X", help="The weight ends at X wc.", rich_help_panel=DESIGN_PANEL)
    ] = 8.0,
    gamma: Annotated[
        float,
        typer.Option(
            "--gamma",
            metavar="X",
            help="gamma as a multiple of the least, 1.0001 to 100.",
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = 1.1,
    integral: IntegralOption = 0.0,
    inertia: InertiaOption = "1",
    delay: DelayOption = 0.0,
    pade: PadeOption = 2,
    period: PeriodOption = None,
    method: MethodOption = "ramp",
    ticks: TicksOption = 1,
    sensor_delay: SensorOption = 0.0,
    order: OrderOption = None,
    as_json: JsonOption = False,
    as_yaml: YamlOption = False,
    out: FileOption = None,
    plot: PlotOption = None,
) -> int:
    """H-infinity loop shaping after Glover and McFarlane: a shaped loop, made as robust as it can be.

    The weight k (s + wc/alpha) / (s + rolloff wc), with --integral times (s + wi) / s, shapes the plant behind its
    delay; of all compensators the one that stands the largest uncertainty of normalised coprime factors, short of it by
    --gamma, is joined to it. gamma_min below 3 is a shape that the plant can have; above 5 it asks too much.

    Exit codes: 0 designed, 1 a loop is not stable, 2 usage.

    Examples: sil design glover --wc 0.985 --alpha 3.78 --delay 0.293 --period 0.1 --ticks 0 |
    sil design glover --wc 0.8 --delay 0.6 --integral 0.03 --period 0.1 --plot glover.png |
    sil design glover --wc 0.25 --delay 0.75 --inertia 2.13,3.04,3.09 --period 0.5 --out law.yaml
    """
    from sil.design.glover import Shape
    from sil.design.sheet import of_glover

    shape = Shape(_positive("--wc", wc), _positive("--alpha", alpha), _positive("--rolloff", rolloff),
                  _not_negative("--integral", integral))  # fmt: skip
    sampling = _sampling(period, ticks, sensor_delay, method, order)
    J, late = _inertia(inertia), _not_negative("--delay", delay)
    return _hand_out(of_glover(shape, J, late, pade, gamma, sampling), as_json, as_yaml, out, plot)


def printed(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Such as lqg-5.1. Default: the list of them.",
            autocompletion=completion.one_of(
                "pd-1", "pd-2", "lqg-5.1", "ls-5.2", "lqg-5.3", "lqg-5.3-repaired", "ls-5.4", "ls-5.4-repaired"
            ),
        ),
    ] = None,
    inertia: Annotated[
        float | None,
        typer.Option(
            "--inertia",
            metavar="J",
            help="Of the plant, kg m^2. Default: that of the experiment.",
            show_default=False,
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = None,
    actuator_gain: Annotated[
        float,
        typer.Option(
            "--actuator-gain",
            metavar="X",
            help="Multiplies the output: with the paper's own it is unstable.",
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = 1.0,
    period: PeriodOption = None,
    method: MethodOption = "ramp",
    ticks: TicksOption = 1,
    sensor_delay: SensorOption = 0.0,
    order: OrderOption = None,
    as_json: JsonOption = False,
    as_yaml: YamlOption = False,
    out: FileOption = None,
    plot: PlotOption = None,
) -> int:
    """A compensator that paper 000 prints, as it is used: what cancels is cancelled.

    LS 5.2 and 5.4 have no stiffness: a constant torque makes the angle run away, and the table says `drifts`. The
    repaired ones were fitted to the paper's results, not derived.

    Exit codes: 0 shown, 1 a loop is not stable, 2 usage.

    Examples: sil design printed | sil design printed lqg-5.1 --period 0.1 |
    sil design printed lqg-5.1 --actuator-gain 0.01
    """
    from sil.design.sheet import of_printed
    from sil.screen.design_sheet import show_printed

    if name is None:
        show_printed()
        return EXIT_OK
    J = None if inertia is None else _positive("--inertia", inertia)
    gain = _positive("--actuator-gain", actuator_gain)
    sheet = of_printed(name, J, gain, _sampling(period, ticks, sensor_delay, method, order))
    return _hand_out(sheet, as_json, as_yaml, out, plot)


def fuzzy(
    error: Annotated[
        float,
        typer.Option(
            "--error",
            metavar="RAD",
            help="E, where the outer sets of the error peak, rad.",
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = 0.5,
    output: Annotated[
        float,
        typer.Option("--output", metavar="L", help="Where the outer output sets peak.", rich_help_panel=DESIGN_PANEL),
    ] = 1.0,
    inputs: Annotated[
        str,
        typer.Option(
            "--inputs",
            metavar="SETS",
            help="ruspini (they add up to 1) or matlab (its default triangles, a dead zone below 0.2 E).",
            rich_help_panel=DESIGN_PANEL,
            autocompletion=completion.one_of("ruspini", "matlab"),
        ),
    ] = "ruspini",
    outputs: Annotated[
        str,
        typer.Option(
            "--outputs",
            metavar="SETS",
            help="ruspini or matlab.",
            rich_help_panel=DESIGN_PANEL,
            autocompletion=completion.one_of("ruspini", "matlab"),
        ),
    ] = "ruspini",
    aggregation: Annotated[
        str,
        typer.Option(
            "--aggregation",
            metavar="HOW",
            help="max or sum of the clipped outputs.",
            rich_help_panel=DESIGN_PANEL,
            autocompletion=completion.one_of("max", "sum"),
        ),
    ] = "max",
    angle: Annotated[
        float | None,
        typer.Option(
            "--angle",
            metavar="RAD",
            help="Experiment 1: the angle as a second input, its outer sets peak here; a plane instead of a line.",
            show_default=False,
            rich_help_panel=DESIGN_PANEL,
        ),
    ] = None,
    entries: Annotated[
        int,
        typer.Option("--entries", metavar="N", help="Of the table, each way, 3 to 257.", rich_help_panel=DESIGN_PANEL),
    ] = 65,
    as_json: JsonOption = False,
    as_yaml: YamlOption = False,
    out: FileOption = None,
    csv: Annotated[
        Path | None,
        typer.Option(
            "--csv",
            metavar="FILE",
            help="The table into a file: a row for each value of the error.",
            rich_help_panel=RESULT_PANEL,
        ),
    ] = None,
) -> int:
    """A Mamdani controller as a table: triangular sets, exact centroid.

    One input: three sets of the error, three of the output, N to H, Z to N, P to L; the table holds -f(e)/L from e = 0
    to E, and is odd: f_table of laws fvsc and ifvsc. Its slope at 0 is 0 with ruspini sets: no stiffness where the
    error is small. With --angle: the nine rules of experiment 1, f/L over error and angle.

    Exit codes: 0 made, 2 usage.

    Examples: sil design fuzzy | sil design fuzzy --error 0.386 --aggregation sum --json |
    sil design fuzzy --error 0.5 --angle 0.5 --entries 33 --csv plane.csv |
    sil design fuzzy --inputs matlab --outputs matlab --yaml
    """
    from sil.design import fuzzy as sets
    from sil.design.law_section import fuzzy_section
    from sil.screen.design_sheet import show_fuzzy

    if as_json and as_yaml:
        raise UsageError("--json, --yaml: expected one of them, got both")
    if not 3 <= entries <= 257:
        raise UsageError(f"--entries: expected 3 to 257, got {entries}")
    _one_of("--inputs", inputs, sets.SHAPES)
    _one_of("--outputs", outputs, sets.SHAPES)
    _one_of("--aggregation", aggregation, sets.AGGREGATIONS)
    E, L = _positive("--error", error), _positive("--output", output)
    if angle is None:
        inference = sets.one_input(E, L, inputs, outputs, aggregation)
        table = sets.half_table(inference, entries)
    else:
        if (inputs, outputs) != ("ruspini", "ruspini"):
            raise UsageError("--angle: expected ruspini sets beside it, experiment 1 says no others")
        inference = sets.two_inputs(E, _positive("--angle", angle), L, aggregation)
        table = sets.plane_table(inference, entries)
    section = fuzzy_section(inference, table) if as_yaml or out is not None else ""
    if out is not None:
        out.write_text(section, encoding="utf-8")
    if csv is not None:
        rows = table.reshape(len(table), -1)
        csv.write_text("".join(",".join(f"{value:.9g}" for value in row) + "\n" for row in rows), encoding="utf-8")
    if as_json:
        print_json({"ranges_rad": inference.ranges, "reach": L, "aggregation": aggregation, "table": table.tolist()})
    elif as_yaml:
        print(section, end="")
    else:
        show_fuzzy(inference, table)
    return EXIT_OK


for _verb in (lqg, glover, printed, fuzzy):
    _page = page_of(_verb)
    app.command(help=_page.help, epilog=_page.epilog)(_verb)


# -- what they share -------------------------------------------------------------------------------------------------


def _sampling(period: float | None, ticks: int, sensor_delay: float, method: str, order: int | None) -> Sampling | None:
    from sil.design.discrete import METHODS
    from sil.design.sheet import Sampling

    _one_of("--method", method, METHODS)
    if not 0 <= ticks <= 4:
        raise UsageError(f"--ticks: expected 0 to 4, got {ticks}")
    if order is not None and order < 1:
        raise UsageError(f"--order: expected a number of states, at least 1, got {order}")
    _not_negative("--sensor-delay", sensor_delay)
    if period is None:
        return None
    return Sampling(_positive("--period", period), ticks, sensor_delay, method, order)


def _one_of(option: str, got: str, known: Sequence[str]) -> None:
    if got not in known:
        raise UsageError(f"{option}: expected one of {', '.join(known)}, got {got}")


def _positive(option: str, value: float) -> float:
    if not (math.isfinite(value) and 1e-6 <= value <= 1e6):
        raise UsageError(f"{option}: expected 1e-06 to 1e+06, got {value:g}")
    return value


def _not_negative(option: str, value: float) -> float:
    return value if value == 0.0 else _positive(option, value)


def _inertia(text: str) -> Inertia:
    """`0.01` or `2.13,3.04,3.09`."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3):
        raise UsageError(f"--inertia: expected a number or three, such as 2.13,3.04,3.09, got {text!r}")
    x, y, z = (_positive("--inertia", number) for number in (numbers * 3)[:3])
    return x, y, z


def _hand_out(sheet: Sheet, as_json: bool, as_yaml: bool, out: Path | None, plot: Path | None) -> int:
    from sil.design.law_section import law_section
    from sil.plain import plain

    if as_json and as_yaml:
        raise UsageError("--json, --yaml: expected one of them, got both")
    section = law_section(sheet) if as_yaml or out is not None else ""
    if out is not None:
        out.write_text(section, encoding="utf-8")
    if plot is not None:
        from sil.report.design_page import design_page

        design_page(sheet).savefig(plot, format="png")
    if as_json:
        print_json(plain(sheet.plain()))
    elif as_yaml:
        print(section, end="")
    else:
        from sil.screen.design_sheet import show

        show(sheet)
    return EXIT_OK if sheet.stable else EXIT_REQUIREMENT
