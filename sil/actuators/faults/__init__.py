"""Faults of wheels: each wraps an actuator that works, and is one to whoever commands it. A line here for each kind."""

from __future__ import annotations

from collections.abc import Sequence

from sil.faulted import Order
from sil.plugins import load
from sil.signals import Actuator

FAULTS: dict[str, str] = {
    "off": "sil.actuators.faults.driven:Off",
    "stuck": "sil.actuators.faults.driven:Stuck",
    "garbage": "sil.actuators.faults.driven:Garbage",
    "wrong": "sil.actuators.faults.driven:Wrong",
    "slow": "sil.actuators.faults.driven:Slow",
    "delayed": "sil.actuators.faults.driven:Delayed",
    "intermittent": "sil.actuators.faults.driven:Intermittent",
}


def faulty(good: Actuator, orders: Sequence[Order], torque_max_Nm: tuple[float | None, ...]) -> Actuator:
    """`good` with faults around it: a command meets the first of them first.

    torque_max_Nm: (3,), garbage is drawn within it; None: no limit.
    """
    for order in reversed(orders):
        good = load(FAULTS, "kind", order.fault.kind)(good, order, torque_max_Nm)
    return good
