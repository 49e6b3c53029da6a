"""Row 1 of the issue: the rigid plant against another simulator, and a control that shows the comparison can fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sil.plants.rigid import Parameters, Rigid

GOLDEN = Path(__file__).parents[2] / "golden" / "basilisk"
PERIOD_NS = 500_000_000
ANGLE_RAD, RATE_RADPS = 1e-9, 1e-11


def errors(case: str, late: int = 0, step_s: float = 0.01) -> tuple[float, float, float]:
    """Largest differences over 600 s: attitude in rad, body rate and wheel speed in rad/s; `late`: ticks of delay."""
    table = np.loadtxt(GOLDEN / f"{case}_dt0.01.csv", delimiter=",", skiprows=1)
    plant = Rigid(
        Parameters(
            inertia_includes_wheels=True,
            wheel_inertia_kgm2=np.full(3, 0.002),
            wheel_speed_radps=np.array([50.0, -30.0, 20.0]),
            step_s=step_s,
            gravity_gradient=False,
            orbit_radius_m=6978136.6,
            mu=3.986004415e14,
            initial_frame="inertial",
            q=table[0, 1:5],
            rate_kind="body_inertial",
            rate_degps=np.degrees([0.05, -0.03, 0.02]),
        )
    )
    worst = np.zeros(3)
    for k, row in enumerate(table):
        motion = plant.motion(k * PERIOD_NS)
        q, w, speed = row[1:5], row[8:11], row[11:14]
        angle = 2.0 * min(np.linalg.norm(motion.q_BN - q), np.linalg.norm(motion.q_BN + q))
        found = motion.momentum_B / 0.002 - motion.omega_BN_B
        worst = np.maximum(worst, [angle, np.abs(motion.omega_BN_B - w).max(), np.abs(found - speed).max()])
        motor = table[k - late, 14:17] if k >= late else np.zeros(3)
        plant.advance(-motor, k * PERIOD_NS, PERIOD_NS)
    return float(worst[0]), float(worst[1]), float(worst[2])


@pytest.mark.parametrize("case", ["free_tumble", "torque"])
@pytest.mark.parametrize("step_s", [0.01, 0.05])
def test_plant_agrees_with_the_golden(case: str, step_s: float) -> None:
    angle, rate, wheel_speed = errors(case, step_s=step_s)
    assert angle <= ANGLE_RAD
    assert rate <= RATE_RADPS
    assert wheel_speed <= 1e-9


def test_a_schedule_late_by_one_sample_is_noticed() -> None:
    angle, rate, _ = errors("torque", late=1)
    assert angle > 1e6 * ANGLE_RAD
    assert rate > 1e6 * RATE_RADPS
