"""THE LABORATORY: plant, sensors, actuators, the loop, the log, and what a user calls.

    import sil
    run = sil.run("mrac-rs232", duration_s=120, **{"law.params.c2_pole": 0.7})
    run = sil.open_run("runs/mrac-rs232-001")
    run["phi_deg"], run.units["phi_deg"]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import os

    from sil.runs import Run

__all__ = ["open_run", "run"]


def run(scenario: str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None, **overrides: Any) -> Run:
    """Run a scenario (built-in name or YAML file) and read it back.

    overrides: scenario keys; dotted ones by `**{"law.params.c2_pole": 0.7}`. out: run directory, refused if not empty;
    default runs/NAME-NNN. The result's arrays go by name (`run["phi_deg"]`, units in `run.units` and in
    sil.runs), its verdict and metrics stand in `run.summary`. Raises ScenarioInvalid, SilError.
    """
    import json
    import os
    from pathlib import Path

    from sil.runner import run_scenario
    from sil.runs import open_run as read
    from sil.scenario import load_scenario

    sets = [f"{key}={json.dumps(value)}" for key, value in overrides.items()]
    loaded = load_scenario(os.fspath(scenario), sets)
    target = Path(out) if out is not None else Path(loaded.out) if loaded.out else None
    return read(run_scenario(loaded, target)["run_dir"])


def open_run(path: str | os.PathLike[str]) -> Run:
    """A finished run (run directory or .mcap) as numpy arrays by name; names, units and errors: sil.runs.open_run."""
    from sil.runs import open_run as read

    return read(path)
