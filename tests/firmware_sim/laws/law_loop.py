"""A law and the rigid satellite stepped directly, without board and frames: what the tests of this folder drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from firmware_sim.controllers import Law, inputs, new_law
from firmware_sim.guidance.reference import NOW, Reference
from protocol.law_tables import Configuration, config_words, law_by_name, parse_configuration
from sil.actuators.wheels import Wheels
from sil.plants.rigid import Parameters, Rigid

W0 = 1.0830778e-3
TS_NS = 500_000_000
INERTIA = (2.13, 3.04, 3.09)
BAM_DEG = 360.0 / 2**32


def manoeuvre(profile: str, t: float) -> tuple[float, float, float]:
    """Set-point in deg (study of paper 004, section 0)."""
    if profile == "A":
        roll = 0.0 if t < 60 else 25.0 * (1 if int((t - 60) // 100) % 2 == 0 else -1)
        pitch = 0.0 if t < 110 else 30.0 * (1 if int((t - 110) // 100) % 2 == 0 else -1)
        return roll, pitch, 0.0
    roll = 25.0 if 60 <= t < 150 else -25.0 if 150 <= t < 240 else 0.0
    pitch = 30.0 if 330 <= t < 420 else -30.0 if 420 <= t < 510 else 0.0
    return roll, pitch, 0.0


@dataclass
class Case:
    """One closed loop. `bits` 0: exact readings; `lost`: ticks without SAMPLE; `swap` may wrap the law."""

    law: str
    form: str = "float"
    profile: str = "A"
    wn: float = 0.15
    delay: int = 1
    inertia: tuple[float, ...] = INERTIA
    torque_max: float = 0.1
    momentum_max: float = 0.3
    noise_deg: float = 0.0
    bits: int = 0
    ticks: int = 1200
    start_deg: tuple[float, float, float] = (10.0, 10.0, 5.0)
    rate_degps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lost: frozenset[int] = frozenset()
    swap: Callable[[Law], Any] = lambda law: law
    values: dict[str, Any] = field(default_factory=dict)

    def configuration(self) -> Configuration:
        """The CONFIG of this case, through words and back."""
        values = {"form": self.form, "transport_delay_ticks": self.delay, "torque_limit": self.torque_max}
        values |= {"reference_pole": math.exp(-0.5 * self.wn)} | self.values
        return parse_configuration(config_words(law_by_name(self.law), values))


@dataclass
class Trace:
    """Rows per tick: true attitude and reference in deg, command in N m, flags; and the law as it ended."""

    attitude: np.ndarray
    reference: np.ndarray
    command: np.ndarray
    flags: np.ndarray
    law: Any

    @property
    def error(self) -> np.ndarray:
        """Tracking error, deg (N, 3)."""
        return self.attitude - self.reference


def run(case: Case) -> Trace:
    """Law and plant, tick by tick; a diverging loop is cut at 1000 deg."""
    configuration = case.configuration()
    common, is_float = configuration.common, case.form == "float"
    law, reference = case.swap(new_law(case.law, configuration)), Reference(common, is_float)
    plant = Rigid(
        Parameters(
            inertia_kgm2=np.diag(case.inertia),
            orbit_radius_m=1.0,
            mu=W0 * W0,
            attitude_deg=np.array(case.start_deg),
            rate_degps=np.array(case.rate_degps),
        )
    )
    wheels = Wheels((case.torque_max,) * 3, (case.momentum_max,) * 3)
    noise = np.random.default_rng(7).standard_normal((case.ticks, 3)) * case.noise_deg
    scale, lsb = inputs.si_scale(common), 2.0 ** -common["torque_bits"]
    exact = case.bits == 0
    inp, out = (
        np.zeros(inputs.SIZE, np.float64 if is_float else np.int64),
        np.zeros(4, np.float64 if is_float else np.int64),
    )
    command, good, rows = np.zeros(3), 0, []
    for k in range(case.ticks):
        motion = plant.motion(k * TS_NS)
        if case.delay == 1:
            applied = wheels.limit(command, motion.momentum_B, 0.5)
        fresh = k not in case.lost
        good = good + 1 if fresh else 0
        si = np.zeros(inputs.SIZE)
        si[[inputs.FRESH, inputs.GOOD_RUN, inputs.APPLIED_KNOWN, inputs.TICK]] = fresh, good, fresh, k
        si[inputs.SETPOINT] = np.radians(manoeuvre(case.profile, k * 0.5))
        if fresh:
            si[inputs.EULER] = motion.euler_rad + np.radians(noise[k])
            si[inputs.APPLIED] = applied if case.delay == 1 else 0.0
            si[inputs.MOMENTUM] = motion.momentum_B
        inp[:] = si if exact else _through_the_wire(si, scale, case.bits, is_float)
        reference.advance(inp)
        law.step(inp, reference.state, out)
        command = out[:3] * (1.0 if exact else lsb)
        if is_float and not exact:
            command = np.round(out[:3] / lsb) * lsb
        if case.delay == 0:
            applied = wheels.limit(command, motion.momentum_B, 0.5)
        now = reference.state[NOW : NOW + 3] * (180.0 / math.pi if is_float else BAM_DEG)
        rows.append([*np.degrees(motion.euler_rad), *now, *command, out[3]])
        if not np.abs(command).max() < 1e3:
            break
        plant.advance(applied, k * TS_NS, TS_NS)
    table = np.array(rows, dtype=np.float64)
    return Trace(table[:, 0:3], table[:, 3:6], table[:, 6:9], table[:, 9].astype(int), law)


def _through_the_wire(si: np.ndarray, scale: np.ndarray, bits: int, is_float: bool) -> np.ndarray:
    """Wire integers (angles with `bits` bits a turn), and SI again for the float form."""
    wire = np.round(si / scale)
    angles = np.round(si[inputs.EULER] / (2 * math.pi) * 2**bits) * 2 ** (32 - bits)
    wire[inputs.EULER] = (angles + 2**31) % 2**32 - 2**31
    return wire * scale if is_float else wire.astype(np.int64)
