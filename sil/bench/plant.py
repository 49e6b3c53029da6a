"""Bench `plant`: integration steps per second of the plant `rigid`, beside Basilisk with the same body and step.

RK4, 0.05 s, ten steps a call as the loop makes them at T_s 0.5 s; Basilisk steps in its own compiled loop.
"""

from __future__ import annotations

import time

import numpy as np

from sil.bench.basilisk import Satellite
from sil.bench.book import Book, Plan
from sil.bench.series import Unavailable
from sil.plants.rigid import Parameters, Rigid

STEP_S, PERIOD_S = 0.05, 0.5
SAME_DEG = 1e-6
CASES = {"free": False, "orbit, gravity gradient": True}


class PlantSteps:
    """The bench `plant`."""

    about = "RK4 steps of the rigid satellite, beside Basilisk with the same body, step and torques"

    def expected_s(self, plan: Plan) -> float:
        return 3.0 + plan.repeats * len(CASES) * (0.3 if plan.quick else 1.1)

    def measure(self, plan: Plan, book: Book) -> None:
        ticks = 2_000 if plan.quick else 10_000
        for _ in plan.rounds("plant"):
            for case, gravity_gradient in CASES.items():
                measured(book, case, parameters(gravity_gradient), ticks)


def measured(book: Book, case: str, body: Parameters, ticks: int) -> None:
    """One repeat of one case."""
    plant, steps = Rigid(body), ticks * PERIOD_S / STEP_S
    ours_s = plant_s(plant, ticks)
    try:
        satellite = Satellite(body, STEP_S)
        theirs_s = satellite.run(ticks * PERIOD_S)
    except Unavailable as error:
        book.note(str(error))
        book.line(case, "steps/s", more=True).add(steps / ours_s)
        return
    angle_deg = satellite.angle_to(plant.state[:4])
    book.details[f"attitude difference at the end, {case}, deg"] = angle_deg
    if angle_deg > SAME_DEG:
        book.note(f"{case}: not the same motion, {angle_deg:.3g} deg apart at the end: do not trust the ratio")
    book.line(case, "steps/s", "Basilisk", more=True).add(steps / ours_s, steps / theirs_s)


def plant_s(plant: Rigid, ticks: int) -> float:
    """Seconds for so many periods."""
    torque, period_ns = np.zeros(3), round(PERIOD_S * 1e9)
    began = time.perf_counter()
    for k in range(ticks):
        plant.advance(torque, k * period_ns, period_ns)
    return time.perf_counter() - began


def parameters(gravity_gradient: bool) -> Parameters:
    """The default satellite, tumbling slowly under a constant external torque."""
    return Parameters(
        step_s=STEP_S,
        gravity_gradient=gravity_gradient,
        disturbance_Nm=np.array([1e-5, -2e-5, 1e-5]),
        attitude_deg=np.array([10.0, 20.0, -5.0]),
        rate_degps=np.array([0.05, -0.03, 0.02]),
    )
