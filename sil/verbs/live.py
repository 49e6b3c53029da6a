"""sil live: a run in a viewer, from another terminal than the run's, or afterwards; and the layout for viewers."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from sil.trouble import EXIT_OK, UsageError
from sil.verbs import completion
from sil.verbs.options import LIVE_AT, address


def live(
    run_dir: Annotated[
        Path | None,
        typer.Argument(
            metavar="RUN", help="Directory of a run that goes on, or is over.", autocompletion=completion.runs
        ),
    ] = None,
    at: Annotated[
        str,
        typer.Option(
            "--at",
            metavar="HOST:PORT",
            help="Where viewers connect. Port 0: any free one.",
            autocompletion=completion.addresses,
        ),
    ] = LIVE_AT,
    speed: Annotated[
        float,
        typer.Option("--speed", metavar="N", min=0.001, max=1000.0, help="Of a run that is over: times real time."),
    ] = 1.0,
    layout: Annotated[
        bool, typer.Option("--layout", help="Print the layout for Foxglove and Lichtblick, and nothing else.")
    ] = False,
) -> int:
    """Show a run to Foxglove or Lichtblick: one that goes on in another terminal, or one that is over, played again.

    Reads RUN/run.journal and writes nothing but its address on stdout, and with --layout the layout in JSON: a 3-D view
    of the satellite, attitude against reference, torque, momentum, the link's frames, the log. A run that is over
    starts when the first viewer has come. To seek in a finished run, open its run.mcap in the viewer instead. `sil run
    --live` shows a run from its first tick.

    Exit codes: 0 all was shown, 2 usage, no such run, or the address is taken, 130 Ctrl-C.

    Examples: sil live runs/mrac-rs232-001 | sil live runs/mrac-rs232-001 --speed 20 --at 127.0.0.1:0 |
    sil live --layout > layout.json
    """
    from sil.launched import child_environment
    from sil.live_view import LAYOUT, command_of

    if layout:
        sys.stdout.write(LAYOUT.read_text(encoding="utf-8"))
        return EXIT_OK
    if run_dir is None:
        raise UsageError("sil live: expected a run, such as runs/mrac-rs232-001, or --layout")
    told = ["--speed", str(speed), "--elsewhere", "--at 127.0.0.1:0 takes any free port"]
    command = [*command_of(*address("--at", at)), *told, "--name", f"attitude-sil: {run_dir.name}", "--", str(run_dir)]
    os.execve(command[0], command, child_environment())
