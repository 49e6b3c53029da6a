"""Faults of sensors: each wraps a sensor that works, and is one to whoever reads it. One line here for each kind."""

from __future__ import annotations

from collections.abc import Sequence

from sil.faulted import Order
from sil.plugins import load
from sil.signals import Sensor

FAULTS: dict[str, str] = {
    "off": "sil.sensors.faults.reported:Off",
    "stuck": "sil.sensors.faults.silent:Stuck",
    "garbage": "sil.sensors.faults.silent:Garbage",
    "wrong": "sil.sensors.faults.silent:Wrong",
    "slow": "sil.sensors.faults.reported:Slow",
    "delayed": "sil.sensors.faults.reported:Delayed",
    "intermittent": "sil.sensors.faults.reported:Intermittent",
}


def faulty(good: Sensor, orders: Sequence[Order]) -> Sensor:
    """`good` with faults around it: the first of them has the first say."""
    for order in orders:
        good = load(FAULTS, "kind", order.fault.kind)(good, order)
    return good
