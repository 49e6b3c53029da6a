"""Options that the kinds of `sil design` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sil.verbs import completion
from sil.verbs.options import RESULT_PANEL

DESIGN_PANEL = "What is designed"
STEPPED_PANEL = "How it is stepped"

InertiaOption = Annotated[
    str,
    typer.Option(
        "--inertia",
        metavar="J",
        help="kg m^2, one number or JX,JY,JZ: gain of each axis.",
        rich_help_panel=DESIGN_PANEL,
    ),
]
DelayOption = Annotated[
    float,
    typer.Option(
        "--delay",
        metavar="S",
        help="Delay of the whole loop that the design allows for, s: sensor, link, half a period for the hold.",
        rich_help_panel=DESIGN_PANEL,
    ),
]
PadeOption = Annotated[
    int, typer.Option("--pade", metavar="N", help="Order of its approximation, 1 to 4.", rich_help_panel=DESIGN_PANEL)
]
IntegralOption = Annotated[
    float,
    typer.Option(
        "--integral",
        metavar="RADPS",
        help="Integral action below this rate, rad/s, against a constant torque. Default: none.",
        show_default=False,
        rich_help_panel=DESIGN_PANEL,
    ),
]
PeriodOption = Annotated[
    float | None,
    typer.Option(
        "--period", metavar="S", help="Period of the board, s: adds the discrete form.", rich_help_panel=STEPPED_PANEL
    ),
]
MethodOption = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="HOW",
        help="ramp (exact for straight lines between samples), zoh (exact for a held input), tustin (slow poles only).",
        rich_help_panel=STEPPED_PANEL,
        autocompletion=completion.one_of("ramp", "zoh", "tustin"),
    ),
]
TicksOption = Annotated[
    int,
    typer.Option(
        "--ticks", metavar="N", help="transport_delay_ticks of the scenario, 0 to 4.", rich_help_panel=STEPPED_PANEL
    ),
]
SensorOption = Annotated[
    float,
    typer.Option(
        "--sensor-delay", metavar="S", help="Delay of the sensor in the sampled loop, s.", rich_help_panel=STEPPED_PANEL
    ),
]
OrderOption = Annotated[
    int | None,
    typer.Option("--order", metavar="N", help="Fewer states, by balanced truncation.", rich_help_panel=STEPPED_PANEL),
]
YamlOption = Annotated[
    bool,
    typer.Option("--yaml", help="The law section of a scenario on stdout, nothing else.", rich_help_panel=RESULT_PANEL),
]
FileOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="FILE", help="That section into a file, beside the table.", rich_help_panel=RESULT_PANEL
    ),
]
PlotOption = Annotated[
    Path | None,
    typer.Option(
        "--plot", metavar="PNG", help="Bode, Nichols and step response, as a picture.", rich_help_panel=RESULT_PANEL
    ),
]
