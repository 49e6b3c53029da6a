"""When the sensors of a scenario look at the truth, and how late what they saw reaches the board.

    sensors:
      sampling: {period_s: 0.1, delay_s: 0.5, delay: transport, jitter_s: 0.01}   # of every sensor
      rate: {sampling: {delay_s: 0}}                                              # single keys of one of them

sil/sensors/sampled.py says what the keys do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from sil.scenario_errors import Path
from sil.scenario_events import Finding
from sil.scenario_sections import Section

KEYS = ("period_s", "delay_s", "delay", "jitter_s")
Time = Annotated[float, Field(ge=0, le=1000)]  # s; the age on the wire ends at 4294 s
Kind = Literal["transport", "unit"]


class Sampling(Section):
    """When every sensor looks, and how late it tells; a sensor's own `sampling` has the last word, key by key."""

    period_s: Time | None = None
    """Its own sampling period, held in between; null or 0: it looks for each tick, at t_k less the delay."""
    delay_s: Time = 0.0
    """How late the board gets to know what the sensor saw."""
    delay: Kind = "transport"
    """transport: each sample comes delay_s later; unit: a unit-delay block of sample time delay_s behind the sensor."""
    jitter_s: Time = 0.0
    """Most that a sampling instant is moved, either way, at most half a period; Gaussian, its standard deviation is a
    third of this."""


class OwnSampling(Section):
    """Keys of sensors.sampling for this sensor alone; null: as it says there."""

    period_s: Time | None = None
    """0: it looks for each tick."""
    delay_s: Time | None = None
    """How late the board gets to know what it saw."""
    delay: Kind | None = None
    """transport or unit."""
    jitter_s: Time | None = None
    """Most that a sampling instant is moved, either way."""


class Times(NamedTuple):
    """How one sensor samples, in the integers of a run."""

    period_us: int  # 0: it looks at t_k
    delay_us: int
    unit: bool  # the delay is a unit-delay block
    jitter_s: float

    @property
    def instantaneous(self) -> bool:
        """Nothing but the truth at t_k."""
        return not (self.period_us or self.delay_us or self.jitter_s)

    def beat_us(self, tick_us: int) -> int:
        """From one sample to the next."""
        return self.period_us or (self.delay_us if self.unit else tick_us)


def times_of(sampling: Sampling, own: OwnSampling) -> Times:
    """What one sensor has: its own keys, and where it has none those of all."""
    period_s, delay_s, delay, jitter_s = (_value(sampling, own, key) for key in KEYS)
    return Times(round((period_s or 0.0) * 1e6), round(delay_s * 1e6), delay == "unit", jitter_s)


def _value(sampling: Sampling, own: OwnSampling, key: str) -> Any:
    said = getattr(own, key)
    return getattr(sampling, key) if said is None else said


# -- what is wrong with them -------------------------------------------------------------------------------------------


def findings(name: str, sampling: Sampling, own: OwnSampling, tick_us: int) -> Iterator[Finding]:
    """What the keys of sensor `name` cannot mean in a run with this period, each at the place that decides it."""
    times = times_of(sampling, own)
    values = {key: _value(sampling, own, key) for key in KEYS}
    paths: dict[str, Path] = {
        key: ("sensors", "sampling", key) if getattr(own, key) is None else ("sensors", name, "sampling", key)
        for key in KEYS
    }
    for key in ("period_s", "delay_s"):
        value = values[key] or 0.0
        if abs(value * 1e6 - round(value * 1e6)) > 1e-6 * max(1.0, value):
            nearest = f"a whole number of microseconds, nearest {round(value * 1e6) * 1e-6:.6f} s"
            yield Finding(paths[key], nearest, value)
    if times.unit and not times.delay_us:
        yield Finding(paths["delay_s"], "a number in s above 0 with delay unit", values["delay_s"])
    beat_s = times.beat_us(tick_us) * 1e-6
    if times.jitter_s > 0.5 * beat_s > 0:
        whose = "period_s" if times.period_us else "delay_s" if times.unit else "the run's period"
        yield Finding(paths["jitter_s"], f"a number in s, at most half of {whose} ({0.5 * beat_s:g})", times.jitter_s)
