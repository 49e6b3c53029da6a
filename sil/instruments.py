"""The instruments of a scenario, put together: each sensor in its unit, with its faults around; the actuator with its.

truth -> sensor -> sampling: period, hold, delay, jitter -> faults -> SAMPLE        command -> faults -> actuator
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sil.actuators import ACTUATORS
from sil.actuators import faults as actuator_faults
from sil.faulted import Order
from sil.faulted import orders as fault_orders
from sil.plugins import load
from sil.scenario import Scenario
from sil.scenario_instruments import Fault
from sil.sensors import SENSORS
from sil.sensors import faults as sensor_faults
from sil.sensors.sampled import Instants, Sampled, instants
from sil.signals import Actuator, Sensor

LOOKED_AT = 2000  # ticks, for a mean


class Instruments(NamedTuple):
    """What the loop reads, and which of it looks at instants of its own."""

    sensors: list[Sensor]
    units: list[Sampled]


def sensors_of(scenario: Scenario) -> Instruments:
    """The sensors that the scenario switches on."""
    made = Instruments([], [])
    for name in (name for name in SENSORS if getattr(scenario.sensors, name).enabled):
        good: Sensor = load(SENSORS, "sensors", name).from_scenario(scenario)
        if not scenario.sensors.times_of(name).instantaneous:
            good = Sampled(good, instants_of(scenario, name))
            made.units.append(good)
        made.sensors.append(sensor_faults.faulty(good, _orders_for_sensor(scenario, name)))
    return made


def instants_of(scenario: Scenario, name: str) -> Instants:
    """When the sensor `name` looks."""
    consumer = f"sensors.{name}.sampling"
    return instants(scenario.sensors.times_of(name), scenario.period_us, scenario.seed, consumer)


def ages_s(scenario: Scenario, name: str) -> tuple[float, float]:
    """How old the readings of the sensor `name` are at t_k, once they come: mean and most, s."""
    times, when = scenario.sensors.times_of(name), instants_of(scenario, name)
    first = (3 * times.delay_us + times.period_us) // scenario.period_us + 1
    ages = [tick * scenario.period_us - when.at_us(when.read_at(tick)) for tick in range(first, first + LOOKED_AT)]
    return sum(ages) / len(ages) * 1e-6, max(ages) * 1e-6


def ages(scenario: Scenario) -> Iterator[str]:
    """A line for each sensor whose readings are not those of t_k."""
    for name in (name for name in SENSORS if getattr(scenario.sensors, name).enabled):
        if not scenario.sensors.times_of(name).instantaneous:
            mean_s, most_s = ages_s(scenario, name)
            yield f"sensors.{name}: readings are {mean_s * 1e3:.4g} ms old on average, at most {most_s * 1e3:.4g} ms"


def actuator_of(scenario: Scenario) -> Actuator:
    """The wheels, or the thrusters."""
    kind = scenario.actuators.kind
    orders = _orders(scenario, scenario.actuators.chosen.faults, f"actuators.{kind}.faults", 1.0)
    good = load(ACTUATORS, "actuators.kind", kind).from_scenario(scenario)
    return actuator_faults.faulty(good, orders, scenario.actuators.command_max)


def _orders_for_sensor(scenario: Scenario, name: str) -> list[Order]:
    unit = {"attitude": 2**32 / 360.0, "rate": math.radians(2.0**scenario.wire.rate_bits)}.get(name, math.radians(1.0))
    return _orders(scenario, getattr(scenario.sensors, name).faults, f"sensors.{name}.faults", unit)


def _orders(scenario: Scenario, faults: Sequence[Fault], path: str, unit: float) -> list[Order]:
    return fault_orders(faults, path, unit, scenario.period_us, scenario.ticks, scenario.seed)
