"""A fault of an instrument, worked out: ticks, axes, numbers. What sensors' and wheels' faults have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sil.noise import Uniform
from sil.scenario_events import span
from sil.scenario_instruments import AXES, BIASES, Fault


class Order(NamedTuple):
    """One fault, in the integers of a run."""

    fault: Fault
    first: int  # tick
    end: int  # the first tick without it
    axes: tuple[int, ...]  # 0 x, 1 y, 2 z
    scale: float
    bias: float  # in the instrument's own unit
    period_us: int
    seed: int
    consumer: str  # names its random numbers

    def at(self, tick: int) -> bool:
        """It is there at this tick."""
        return self.first <= tick < self.end

    def since_us(self, tick: int) -> int:
        """Simulated time since its first tick."""
        return (tick - self.first) * self.period_us

    def draws(self, count: int) -> Uniform:
        """Its random numbers: in [0, 1), `count` a tick."""
        return Uniform(self.seed, self.consumer, count)


def orders(faults: Sequence[Fault], path: str, unit: float, period_us: int, ticks: int, seed: int) -> list[Order]:
    """The faults at `path` of a scenario, such as sensors.attitude.faults; each draws numbers of its own.

    unit: what 1 deg, deg/s or N m of a bias is to the instrument.
    """
    return [
        Order(
            fault,
            *span(fault.at_s, fault.for_s, period_us, ticks),
            tuple(AXES.index(axis) for axis in fault.axis or AXES),
            1.0 if fault.scale is None else fault.scale,
            unit * next((bias for key in BIASES if (bias := getattr(fault, key, None)) is not None), 0.0),
            period_us,
            seed,
            f"{path}[{index}]",
        )
        for index, fault in enumerate(faults)
    ]


def failing(order: Order) -> Callable[[int], bool]:
    """Of an intermittent instrument: is it off at this tick (of those at which the fault is there)?"""
    fault = order.fault
    if fault.fraction is not None:
        draws, fraction = order.draws(1), fault.fraction
        return lambda tick: bool(draws.at(tick)[0] < fraction)
    on_us, off_us = (round((time_s or 0.0) * 1e6) for time_s in (fault.on_s, fault.off_s))
    return lambda tick: order.since_us(tick) % (on_us + off_us) >= on_us


def renews(order: Order, tick: int) -> bool:
    """Of a slow instrument: does it take a new value at this tick? The first one not before each of its instants."""
    assert order.fault.period_s is not None
    own_us = round(order.fault.period_s * 1e6)
    since = order.since_us(tick)
    return since // own_us != (since - order.period_us) // own_us


def delay_ticks(order: Order) -> int:
    """Of a delayed instrument: by how many ticks, rounded up."""
    assert order.fault.delay_s is not None
    return -(-round(order.fault.delay_s * 1e6) // order.period_us)
