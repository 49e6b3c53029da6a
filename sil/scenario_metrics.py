"""The metrics a requirement may name. Wall-clock figures are not among them: a verdict must not depend on the host."""

from __future__ import annotations

from sil.scenario_errors import one_of

ANGLES = ("roll", "pitch", "yaw", "max")
AXES = ("x", "y", "z", "max")
ALL, TOTAL = "all", "total"  # rms over the three axes as well as over time; sum of the three
METRICS: dict[str, tuple[str, ...]] = {
    "rms_error_deg": (*ANGLES, ALL),
    "rms_setpoint_error_deg": (*ANGLES, ALL),
    "residual_error_deg": (*ANGLES, ALL),
    "peak_error_deg": ANGLES,
    "rms_torque_Nm": (*AXES, ALL),
    "residual_torque_Nm": (*AXES, ALL),
    "peak_torque_Nm": AXES,
    "peak_momentum_Nms": AXES,
    "effort_Nms": (*AXES, TOTAL),
    "settling_s": ANGLES,
    "diverged_at_s": (),
    "reference_mismatch_deg": (),
    "missed": (),
    "late": (),
    "overruns": (),
    "restarts": (),
    "crc_errors": (),
    "discarded_bytes": (),
}
WALL = ("wall_s", "seal_s", "times_real_time", "wakeup_us", "answer_us", "timing")


def refused_metric(metric: str) -> str | None:
    """What was expected instead of `metric`, or None if it is one."""
    name, dot, part = metric.partition(".")
    if name in WALL:
        return "a metric of the simulation: a wall-clock figure cannot decide a verdict"
    if name not in METRICS:
        return one_of(METRICS, name)
    parts = METRICS[name]
    if parts:
        return None if part in parts else one_of([f"{name}.{each}" for each in parts], metric)
    return None if not dot else name
