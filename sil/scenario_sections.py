"""The sections of a scenario: every key with its type, unit (in its name), range and default.

Defaults are the satellite, the orbit, the initial attitude and the sampling of paper 004, so that five lines make a
scenario. Triples are [x, y, z]. The docstring under a key is its description in the JSON Schema.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

Numbers3 = tuple[float, float, float]
Limits3 = tuple[float | None, float | None, float | None]
Matrix3 = tuple[Numbers3, Numbers3, Numbers3]

BOARDS = ("process", "inproc", "native", "cortex-m", "qemu", "none")
LINKS = ("pty", "udp", "inproc")
SCALED = re.compile(r"scaled:[0-9]+(\.[0-9]+)?")
SLOWEST, FASTEST = 0.01, 1000.0  # N of scaled:N; HELLO carries it as a Q16 number
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


COLUMN_OFF = 1e-3  # a misalignment matrix printed with three digits is one


class Expected(PydanticCustomError):
    """A refusal that says what would have been accepted."""

    def __new__(cls, expected: str) -> Expected:
        return super().__new__(cls, "expected", "expected {expected}", {"expected": expected})


class Section(BaseModel):
    """A mapping of known keys; frozen, nothing is converted silently."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


def is_number(value: object) -> bool:
    """An int or float that float64 holds, finite; true and false are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def numbers_of(value: object, count: int) -> tuple[float, ...] | None:
    """`count` finite numbers as floats; None where `value` is something else."""
    fits = isinstance(value, tuple) and len(value) == count and all(is_number(item) for item in value)
    return tuple(float(item) for item in value) if fits and isinstance(value, tuple) else None


def _triple(value: object) -> object:
    if (numbers := numbers_of(value, 3)) is None:
        raise Expected("3 numbers")
    return numbers


def _quaternion(value: object) -> object:
    if value is None:
        return None
    numbers = numbers_of(value, 4)
    if numbers is None or abs(math.hypot(*numbers) - 1.0) > 1e-6:
        raise Expected("4 numbers, scalar first, of norm 1")
    return numbers


def _limits(value: object) -> object:
    items = value if isinstance(value, tuple) else (value,) * 3
    if len(items) != 3 or not all(item is None or (is_number(item) and item > 0) for item in items):
        raise Expected("a number above 0, 3 of them, or null for no limit")
    return tuple(None if item is None else float(item) for item in items)


def _not_negative(value: object) -> object:
    numbers = numbers_of(value if isinstance(value, tuple) else (value,) * 3, 3)
    if numbers is None or min(numbers) < 0:
        raise Expected("a number not below 0, or 3 of them")
    return numbers


def _positive(value: object) -> object:
    numbers = numbers_of(value if isinstance(value, tuple) else (value,) * 3, 3)
    if numbers is None or min(numbers) <= 0:
        raise Expected("a number above 0, or 3 of them")
    return numbers


def _one_or_three(value: object) -> object:
    if (numbers := numbers_of(value if isinstance(value, tuple) else (value,) * 3, 3)) is None:
        raise Expected("a number, or 3 of them")
    return numbers


def _inertia(value: object) -> object:
    diagonal = numbers_of(value, 3)
    if diagonal is not None:
        value = tuple(tuple(diagonal[i] if i == j else 0.0 for j in range(3)) for i in range(3))
    rows = tuple(numbers_of(row, 3) for row in value) if isinstance(value, tuple) else ()
    if len(rows) != 3 or None in rows:
        raise Expected("3 numbers or 3 rows of 3 numbers")
    matrix = tuple(row for row in rows if row is not None)
    if any(matrix[i][j] != matrix[j][i] for i in range(3) for j in range(3)):
        raise Expected("a symmetric matrix")
    if not _positive_definite(matrix):
        raise Expected("a positive definite matrix")
    return matrix


def _unit_columns(value: object) -> object:
    if value is None:
        return None
    rows = tuple(numbers_of(row, 3) for row in value) if isinstance(value, tuple) else ()
    if len(rows) != 3 or None in rows:
        raise Expected("3 rows of 3 numbers")
    norms = [math.hypot(*column) for column in zip(*(row for row in rows if row is not None), strict=True)]
    if any(abs(norm - 1.0) > COLUMN_OFF for norm in norms):
        got = ", ".join(f"{norm:.4g}" for norm in norms)
        raise Expected(f"columns of norm 1 within {COLUMN_OFF:g} (they have {got}; a size belongs into gain)")
    return rows


def _interval(value: object) -> object:
    if value is None:
        return None
    numbers = numbers_of(value, 2)
    if numbers is None or numbers[0] > numbers[1]:
        raise Expected("2 numbers, the lower first")
    return numbers


def _clock(value: object) -> object:
    if value in ("lockstep", "realtime"):
        return value
    scale = float(value.removeprefix("scaled:")) if isinstance(value, str) and SCALED.fullmatch(value) else 0.0
    if SLOWEST <= scale <= FASTEST:
        return value
    raise Expected(f"lockstep, realtime or scaled:N with N from {SLOWEST:g} to {FASTEST:g}")


def _name(value: object) -> object:
    if isinstance(value, str) and NAME.fullmatch(value):
        return value
    raise Expected("a name of letters A-Z a-z, digits, _ . and -, a letter or digit first")


def _port(value: object) -> object:
    """The path of a serial port as the URL that it stands for."""
    return f"serial://{value}" if isinstance(value, str) and value.startswith("/dev/") else value


def _board(value: object) -> object:
    value = _port(value)
    if value in BOARDS or (isinstance(value, str) and re.fullmatch(r"(serial|udp)://\S+", value)):
        return value
    raise Expected(f"{', '.join(BOARDS)}, /dev/X, serial:///dev/X?baud=N or udp://HOST:PORT")


def _url(value: object) -> object:
    value = _port(value)
    if value in LINKS or (isinstance(value, str) and re.fullmatch(r"serial:///?\S+|udp://[^\s:]+:\d+", value)):
        return value
    raise Expected(f"{', '.join(LINKS)}, /dev/X, serial:///dev/X?baud=N or udp://HOST:PORT")


def _positive_definite(m: tuple[tuple[float, ...], ...]) -> bool:
    minor2 = m[0][0] * m[1][1] - m[0][1] * m[1][0]
    minor3 = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )
    return m[0][0] > 0 and minor2 > 0 and minor3 > 0


def _three_of(item: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema({"type": "array", "items": item, "minItems": 3, "maxItems": 3})


def _one_or(item: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema({"anyOf": [item, _three_of(item).json_schema]})


NUMBER: dict[str, Any] = {"type": "number"}
Triple = Annotated[Numbers3, BeforeValidator(_triple)]
OneOrThree = Annotated[Numbers3, BeforeValidator(_one_or_three), _one_or(NUMBER)]
OneOrThreeNotNegative = Annotated[Numbers3, BeforeValidator(_not_negative), _one_or({**NUMBER, "minimum": 0})]
OneOrThreePositive = Annotated[Numbers3, BeforeValidator(_positive), _one_or({**NUMBER, "exclusiveMinimum": 0})]
UnitColumns = Annotated[Matrix3 | None, BeforeValidator(_unit_columns)]
LimitTriple = Annotated[Limits3, BeforeValidator(_limits), _one_or({"type": ["number", "null"], "exclusiveMinimum": 0})]
InertiaMatrix = Annotated[
    Matrix3, BeforeValidator(_inertia), _three_of({"anyOf": [NUMBER, _three_of(NUMBER).json_schema]})
]
UnitQuaternion = Annotated[tuple[float, float, float, float] | None, BeforeValidator(_quaternion)]
Interval = Annotated[tuple[float, float] | None, BeforeValidator(_interval)]
ClockMode = Annotated[str, BeforeValidator(_clock)]
Name = Annotated[str, BeforeValidator(_name), WithJsonSchema({"type": "string", "pattern": f"^{NAME.pattern}$"})]
Board = Annotated[str, BeforeValidator(_board)]
Url = Annotated[str, BeforeValidator(_url)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=0)]
Moment = Annotated[float, Field(ge=0, le=1e12)]  # s; beyond the last tick there can be
Lapse = Annotated[float, Field(ge=1e-6, le=1e12)]  # s


class Sine(Section):
    """amplitude * sin(2 pi t / period + phase), torque on the body in body axes, t = simulation time."""

    amplitude_Nm: Triple
    """Peak torque about each body axis."""
    period_s: Positive
    """Of the oscillation."""
    phase_deg: float = 0.0
    """At t = 0."""


class Disturbance(Section):
    """Torques from outside, in body axes; `disturbance_Nm: [x, y, z]` is short for the constant part."""

    constant_Nm: Triple = (0.0, 0.0, 0.0)
    """The part that never changes."""
    sine: tuple[Sine, ...] = ()
    """Oscillating parts; they add up."""


class Initial(Section):
    """State at t = 0."""

    frame: Literal["lvlh", "inertial"] = "lvlh"
    """What attitude and rates are relative to: the orbital frame or the inertial one."""
    attitude_deg: Triple = (10.0, 10.0, 5.0)
    """Euler angles in attitude.sequence."""
    q: UnitQuaternion = None
    """Scalar first, v_frame = q v_B q*; replaces attitude_deg."""
    rate_kind: Literal["euler", "body_relative", "body_inertial"] = "euler"
    """Euler angle rates, body rate relative to the frame, or omega_BN in body axes."""
    rate_degps: Triple = (0.0, 0.0, 0.0)
    """In the sense of rate_kind."""


class Orbit(Section):
    """Circular orbit; ascending node on the inertial x axis."""

    radius_m: Positive = 6978137.0
    """From the centre of the Earth."""
    mu: Positive = 3.986004418e14
    """Gravitational parameter, m^3/s^2."""
    inclination_deg: float = 97.8
    """Of the orbital plane to the equator."""
    u0_deg: float = 0.0
    """Argument of latitude at t = 0."""


class Plant(Section):
    """The satellite."""

    kind: str = "rigid"
    """A plant of the product, or ./my_plant.py:MyPlant."""
    inertia_kgm2: InertiaMatrix = ((2.13, 0.0, 0.0), (0.0, 3.04, 0.0), (0.0, 0.0, 3.09))
    """3 numbers (diagonal) or 3 rows."""
    inertia_includes_wheels: bool = False
    """True: the wheels' spin inertia is part of inertia_kgm2."""
    step_s: Positive = 0.05
    """Largest integration step; lowered so that a period is a whole number of steps."""
    gravity_gradient: bool = True
    """The torque 3 w0^2 c x I c, c the direction of the nadir in body axes."""
    disturbance_Nm: Disturbance = Disturbance()
    initial: Initial = Initial()
    orbit: Orbit = Orbit()


class Attitude(Section):
    """How attitude is expressed, in readings, set-points and metrics alike."""

    sequence: Literal[321, 123] = 321
    """321: R1(phi) R2(theta) R3(psi), yaw first; 123: intrinsic roll first."""
    frame: Literal["lvlh", "inertial"] = "lvlh"
    """What the angles are relative to: the orbital frame (x along-track, y = -orbit normal, z nadir) or the inertial
    one."""


class Law(Section):
    """The control law on the board."""

    name: str = "appc"
    """A law of the product, or ./my_law.py:MyLaw."""
    form: Literal["fixed", "float"] = "fixed"
    """Arithmetic of the law: the integers of the microcontroller, or float64."""
    version: int | None = None
    """null: the newest."""
    params: dict[str, Any] = Field(default_factory=dict)
    """The law's own parameters; see protocol/SPEC.md for the table of each law."""


class Row(Section):
    """From t_s on, the set-point is attitude_deg."""

    t_s: NotNegative
    """Simulation time."""
    attitude_deg: Triple
    """The set-point, Euler angles in attitude.sequence relative to attitude.frame."""


class Guidance(Section):
    """The manoeuvre and the reference model that smooths it."""

    profile: str = "A"
    """A or B (manoeuvres of the study of paper 004), hold, steps."""
    rows: tuple[Row, ...] = ()
    """For profile steps: set-points in order of time; before the first it is 0."""
    hold_deg: Triple = (0.0, 0.0, 0.0)
    """For profile hold."""
    reference: Literal["zoh", "paper", "none"] = "zoh"
    """D of the reference model C1 ym = q^-d D r: (1-p)^2 (1+q^-1)/2, (1-p)^2; none: the set-point itself."""
    wn_radps: Positive = 0.15
    """Natural frequency of the critically damped reference model, p = exp(-wn T_s)."""
    rate_limit_degps: Positive | None = None
    """Limit of the reference's rate, per axis; with reference none the set-point turns no faster than this."""
    accel_limit_degps2: Positive | None = None
    """Limit of the reference's acceleration, per axis; null: none."""
    setpoint_source: Literal["table", "sample"] = "table"
    """table: the board flies the rows of CONFIG; sample: it takes the set-point from each SAMPLE."""


class Wire(Section):
    """Fractional bits of the integers on the wire: LSB 2^-bits N m, N m s, rad/s."""

    torque_bits: Annotated[int, Field(ge=8, le=30)] | None = None
    """null: 30, lowered until the torque limit fits; 20 without a limit."""
    momentum_bits: Annotated[int, Field(ge=8, le=30)] = 28
    """Of the wheels' momentum."""
    rate_bits: Annotated[int, Field(ge=8, le=30)] = 28
    """Of the rates."""


class Clock(Section):
    """When ticks happen, and what the machine is asked to grant for it; `clock: realtime` is short for its mode."""

    mode: ClockMode = "lockstep"
    """lockstep, realtime or scaled:N, N from 0.01 to 1000"""
    priority: Annotated[int, Field(ge=1, le=99)] | None = None
    """SCHED_FIFO priority of laboratory and board process; null: ordinary scheduling."""
    lock_memory: bool | None = None
    """mlockall in both processes; null: when a priority is asked for."""
    lab_cpu: Count | None = None
    """CPU the laboratory runs on; null: the kernel decides."""
    board_cpu: Count | None = None
    """CPU the board process runs on; null: the kernel decides."""
    spin_us: Annotated[int, Field(ge=0, le=1000)] = 100
    """The last stretch before a deadline that the laboratory does not sleep, at most a tenth of a period; 0: none."""

    @property
    def locks_memory(self) -> bool:
        """lock_memory with its default."""
        return self.priority is not None if self.lock_memory is None else self.lock_memory


class Timing(Section):
    """When a paced run counts as `degraded`; nothing of it touches the simulation."""

    max_lateness_ms: Positive | None = None
    """A tick that wakes later is late; null: one period on the wall clock (T_s / N)."""
    max_degraded_fraction: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of late ticks beyond which the run is degraded."""


class Metrics(Section):
    """What counts."""

    from_tick: Count = 0
    """First tick that metrics look at, to leave out the start."""
    last_s: Positive = 20.0
    """How much of the end of the run the residual_ metrics look at."""
    diverged_deg: Positive | None = 80.0
    """An attitude angle beyond this is a divergence (metric diverged_at_s); null: no such limit."""


class Requirement(Section):
    """One line of the verdict: a metric and where it has to be; exactly one of below, above, between."""

    metric: str
    """What is measured, such as rms_error_deg.yaw."""
    below: float | None = None
    """In the metric's unit."""
    above: float | None = None
    """In the metric's unit."""
    between: Interval = None
    """[lowest, highest], in the metric's unit."""
