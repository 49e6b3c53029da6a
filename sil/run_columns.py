"""The columns of a run by name, with their units, in the order of `sil export`; what each one means: sil.open_run."""

from __future__ import annotations

ANGLES = ("phi", "theta", "psi")
AXES = ("x", "y", "z")
COLUMNS: dict[str, str] = {
    "tick": "1",
    "t_s": "s",
    **{f"{a}_deg": "deg" for a in ANGLES},
    **{f"ref_{a}_deg": "deg" for a in ANGLES},
    **{f"command_{a}_Nm": "N m" for a in AXES},
    **{f"applied_{a}_Nm": "N m" for a in AXES},
    **{f"w_{a}_radps": "rad/s" for a in AXES},
    **{f"h_{a}_Nms": "N m s" for a in AXES},
    **{f"q_{a}": "1" for a in ("s", *AXES)},
}
TRIPLES = {
    "attitude_deg": "deg",
    "reference_deg": "deg",
    "error_deg": "deg",
    "setpoint_deg": "deg",
    "setpoint_error_deg": "deg",
    "command_Nm": "N m",
    "applied_Nm": "N m",
    "omega_radps": "rad/s",
    "momentum_Nms": "N m s",
    "q_BN": "1",
}
PARTS: dict[str, tuple[str, int]] = {
    **{f"{a}_deg": ("attitude_deg", i) for i, a in enumerate(ANGLES)},
    **{f"ref_{a}_deg": ("reference_deg", i) for i, a in enumerate(ANGLES)},
    **{f"command_{a}_Nm": ("command_Nm", i) for i, a in enumerate(AXES)},
    **{f"applied_{a}_Nm": ("applied_Nm", i) for i, a in enumerate(AXES)},
    **{f"w_{a}_radps": ("omega_radps", i) for i, a in enumerate(AXES)},
    **{f"h_{a}_Nms": ("momentum_Nms", i) for i, a in enumerate(AXES)},
    **{f"q_{a}": ("q_BN", i) for i, a in enumerate(("s", *AXES))},
}
