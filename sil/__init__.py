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
    default runs/NAME-NNN. The result's arrays go by name (`run["phi_deg"]`, names and units: help(sil.open_run)), its
    verdict and metrics stand in `run.summary`. Raises ScenarioInvalid, SilError.
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
    """A finished run (run directory or .mcap) as numpy arrays by name: `open_run("runs/mrac-rs232-001")["phi_deg"]`.

    One row per tick k at t_k = k T_s. Axes x, y, z are the body's (roll, pitch, yaw); angles are those of the
    scenario's `attitude.sequence` relative to `attitude.frame`.

    | name | unit | what |
    |---|---|---|
    | tick | 1 | tick number |
    | t_s | s | simulation time |
    | phi_deg theta_deg psi_deg | deg | true attitude at the tick, not the reading |
    | ref_phi_deg ref_theta_deg ref_psi_deg | deg | reference, recomputed here in float64 (sil.reference) |
    | command_x_Nm command_y_Nm command_z_Nm | N m | torque computed at this tick; NaN where no COMMAND came |
    | applied_x_Nm applied_y_Nm applied_z_Nm | N m | torque acting on the body from this tick on, after limits |
    | w_x_radps w_y_radps w_z_radps | rad/s | body rate omega_BN, body axes |
    | h_x_Nms h_y_Nms h_z_Nms | N m s | absolute wheel momentum, body axes |
    | q_s q_x q_y q_z | 1 | attitude in inertial space, v_N = q v_B q*, scalar first, sign continuous |
    | attitude_deg reference_deg setpoint_deg | deg | (N, 3) |
    | error_deg setpoint_error_deg | deg | (N, 3) attitude - reference, attitude - set-point, modulo a turn |
    | command_Nm applied_Nm | N m | (N, 3) |
    | omega_radps | rad/s | (N, 3) |
    | momentum_Nms | N m s | (N, 3) |
    | q_BN | 1 | (N, 4) |

    TELEMETRY by the names of the law's table, such as `g_x`, `trace_y`, `a1_z`: NaN at ticks without. `run.telemetry`
    has all of them, `run.units` every unit. Angles in TELEMETRY are in deg.

    Raises sil.runs.RunError, one line: no such run, not sealed yet, empty, cut off, corrupt, not MCAP, not a run.
    """
    from sil.runs import open_run as read

    return read(path)
