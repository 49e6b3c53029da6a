"""The instruments of a scenario: sensors, wheels or thrusters, and the faults that are given to them on purpose.

    sensors: {attitude: {faults: [{kind: stuck, at_s: 100, for_s: 20, axis: x}]}}
    actuators: {wheels: {faults: [{kind: wrong, scale: 0.7, axis: [x, z]}]}}

A fault is there at every tick with at_s <= t_k < at_s + for_s. Several of one instrument act in the order of the list.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from sil.scenario_sampling import OwnSampling, Sampling, Times, times_of
from sil.scenario_sections import (
    Expected,
    Lapse,
    Limits3,
    LimitTriple,
    Matrix3,
    Moment,
    NotNegative,
    OneOrThree,
    OneOrThreeNotNegative,
    OneOrThreePositive,
    Section,
    UnitColumns,
)

AXES = ("x", "y", "z")
BIASES = ("bias_deg", "bias_degps", "bias_Nm")  # each instrument's faults have one of them


def _axes(value: object) -> object:
    items = value if isinstance(value, tuple) else (value,)
    if value is None:
        return None
    if not items or any(item not in AXES for item in items) or len(set(items)) != len(items):
        raise Expected("x, y or z, or a list of these")
    return tuple(sorted(items))


_AXIS: dict[str, Any] = {"enum": list(AXES)}
_AXIS_SCHEMA = WithJsonSchema({"anyOf": [_AXIS, {"type": "array", "items": _AXIS, "minItems": 1}, {"type": "null"}]})
Axes = Annotated[tuple[str, ...] | None, BeforeValidator(_axes), _AXIS_SCHEMA]
Bias = Annotated[float, Field(ge=-1e6, le=1e6)]
Factor = Annotated[float, Field(ge=-1e6, le=1e6)]
Kind = Literal["off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent"]


class Fault(Section):
    """What goes wrong with an instrument, and when."""

    kind: Kind
    """off: gives nothing; stuck: stays at its value at the start; garbage: random values; wrong: scale and bias; slow:
    renews its value once per period_s; delayed: its value of delay_s ago; intermittent: off now and then."""
    at_s: Moment = 0.0
    """Simulation time; it begins at the first tick not before."""
    for_s: Lapse | None = None
    """How long; null: to the end."""
    axis: Axes = None
    """x, y, z or a list of them; null: all."""
    scale: Factor | None = None
    """For wrong: a factor, default 1."""
    period_s: Lapse | None = None
    """For slow: from one new value to the next."""
    delay_s: Annotated[float, Field(gt=0, le=4000)] | None = None
    """For delayed; rounded up to whole periods of the run."""
    fraction: Annotated[float, Field(ge=0, le=1)] | None = None
    """For intermittent: share of the ticks, drawn at random, at which it is off."""
    on_s: Lapse | None = None
    """For intermittent, with off_s and in place of fraction: it works for so long ..."""
    off_s: Lapse | None = None
    """... and then does not for so long, over and over."""


class AttitudeFault(Fault):
    """A fault of the attitude sensor or the star tracker."""

    bias_deg: Bias | None = None
    """For wrong, attitude sensor and star tracker: what is added; star tracker: a turn about the body axes."""


class RateFault(Fault):
    """A fault of the gyros."""

    bias_degps: Bias | None = None
    """For wrong, gyros: what is added."""


class WheelFault(Fault):
    """A fault of wheels or thrusters: it acts on the command, and their limits on what comes of it."""

    bias_Nm: Bias | None = None
    """For wrong, wheels and thrusters: what is added to the command."""


class Wheels(Section):
    """Three reaction wheels along the body axes; one number means the same for all three."""

    torque_max_Nm: LimitTriple = (0.1, 0.1, 0.1)
    """Largest torque of each wheel, either way; null: no limit."""
    momentum_max_Nms: LimitTriple = (0.3, 0.3, 0.3)
    """Largest momentum of each wheel, beyond which it gives no torque that adds to it; null: no limit."""
    inertia_kgm2: OneOrThreeNotNegative = (0.0, 0.0, 0.0)
    """Spin inertia; 0: the momentum is just the integral of the negative torque."""
    initial_speed_radps: OneOrThree = (0.0, 0.0, 0.0)
    """Relative to the body; without spin inertia it carries no momentum."""
    faults: tuple[WheelFault, ...] = ()
    """What goes wrong with them on purpose."""


class Thrusters(Section):
    """Torque from outside, which no wheel takes up: applied = K_T sat(gain * command)."""

    gain: OneOrThreePositive = (1.0, 1.0, 1.0)
    """N m for each N m that is commanded, or for whatever else a law of one's own commands."""
    torque_max_Nm: LimitTriple = (0.1, 0.1, 0.1)
    """Of each axis, before the misalignment."""
    misalignment_percent: Annotated[float, Field(ge=0, le=50)] = 0.0
    """p: K_T has p/100 off its diagonal, and columns of norm 1."""
    misalignment: UnitColumns = None
    """K_T itself, 3 rows; column j is where the torque of axis j points, in body axes."""
    faults: tuple[WheelFault, ...] = ()
    """What goes wrong with them on purpose."""

    @property
    def K_T(self) -> Matrix3:
        """Misalignment matrix."""
        off = self.misalignment_percent / 100.0
        on = math.sqrt(1.0 - 2.0 * off * off)
        return self.misalignment or ((on, off, off), (off, on, off), (off, off, on))


class Actuators(Section):
    """What turns commands into torque."""

    kind: Literal["wheels", "thrusters"] = "wheels"
    """Which of the two the satellite has; wheels take up what they give, thrusters do not."""
    wheels: Wheels = Wheels()
    thrusters: Thrusters = Thrusters()

    @property
    def chosen(self) -> Wheels | Thrusters:
        """The section of the actuator that is there."""
        return self.wheels if self.kind == "wheels" else self.thrusters

    @property
    def command_max(self) -> Limits3:
        """The command at which each axis is at its limit, None: no limit."""
        gain = self.thrusters.gain if self.kind == "thrusters" else (1.0, 1.0, 1.0)
        x, y, z = (most if most is None else most / g for most, g in zip(self.chosen.torque_max_Nm, gain, strict=True))
        return x, y, z

    @property
    def momentum_max_Nms(self) -> Limits3:
        """(3,) of the wheels; None: no limit, as for thrusters."""
        return self.wheels.momentum_max_Nms if self.kind == "wheels" else (None, None, None)

    @property
    def largest_on_the_wire(self) -> float | None:
        """Largest torque that COMMAND or SAMPLE has to carry; None: no limit."""
        commands, limits = self.command_max, self.chosen.torque_max_Nm
        if None in limits:
            return None
        K_T = self.thrusters.K_T if self.kind == "thrusters" else ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        applied = [sum(abs(k) * (most or 0.0) for k, most in zip(row, limits, strict=True)) for row in K_T]
        return max(*applied, *(most or 0.0 for most in commands))


class AttitudeSensor(Section):
    """Euler angles of the body relative to attitude.frame."""

    enabled: bool = True
    """Whether the satellite has one."""
    noise_deg: NotNegative = 0.0
    """White, Gaussian: standard deviation of each angle."""
    bits: Annotated[int, Field(ge=0, le=32)] = 0
    """LSB 360 deg / 2^bits; 0: the wire's own 2^-32 turn."""
    faults: tuple[AttitudeFault, ...] = ()
    """What goes wrong with it on purpose."""
    sampling: OwnSampling = OwnSampling()


class QuaternionSensor(Section):
    """Star tracker: q_BN."""

    enabled: bool = False
    """Whether the satellite has one."""
    noise_deg: NotNegative = 0.0
    """White, Gaussian: standard deviation of a small turn about each body axis."""
    bits: Annotated[int, Field(ge=0, le=31)] = 0
    """LSB 2 / 2^bits of a component; 0: the wire's own 2^-30."""
    faults: tuple[AttitudeFault, ...] = ()
    """What goes wrong with it on purpose."""
    sampling: OwnSampling = OwnSampling()


class RateSensor(Section):
    """Gyros: omega_BN in body axes."""

    enabled: bool = False
    """Whether the satellite has them."""
    noise_degps: NotNegative = 0.0
    """White, Gaussian: standard deviation of each rate."""
    lsb_degps: NotNegative = 0.0
    """Step of a reading; 0: the wire's own, 2^-wire.rate_bits rad/s."""
    faults: tuple[RateFault, ...] = ()
    """What goes wrong with it on purpose."""
    sampling: OwnSampling = OwnSampling()


class Sensors(Section):
    """What the board gets to see."""

    sampling: Sampling = Sampling()
    attitude: AttitudeSensor = AttitudeSensor()
    quaternion: QuaternionSensor = QuaternionSensor()
    rate: RateSensor = RateSensor()

    def times_of(self, name: str) -> Times:
        """When the sensor `name` looks, and how late it tells."""
        return times_of(self.sampling, getattr(self, name).sampling)
