"""Random episodes of a law: CONFIG within its table, a satellite that its torque turns, noise, losses; Python's answer.

An episode is CONFIG words, and per tick the law's inputs and everything the compiled Python form holds afterwards.
main() computes that from recorded inputs again, with the packages its process imports.
"""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from firmware_sim.controllers import LawRefuses, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import COMMON, Configuration, config_words, law_by_name, parse_configuration

STEPS = 200
INT32 = (-(2**31), 2**31)


@dataclass
class Expected:
    """Rows per tick; `par` and `ref_par` do not change."""

    out: np.ndarray  # (n, 4) torque and flags
    started: np.ndarray  # (n, 2) reference started, reference restarted by the law
    reference_words: np.ndarray  # (n, 6)
    telemetry: np.ndarray  # (n, words)
    ref: np.ndarray
    state: np.ndarray
    par: np.ndarray
    ref_par: np.ndarray


@dataclass
class Episode:
    """`common`, `params`: CONFIG; `inp` (n, SIZE) int32 words; `expected` None: the law refuses."""

    law: str
    common: np.ndarray
    params: np.ndarray
    inp: np.ndarray
    expected: Expected | None
    limits: np.ndarray  # of the torque, in its LSB


# -- what Python does --------------------------------------------------------------------------------------------------


class Flown:
    """Reference and law of one configuration, stepped as the board does, each tick recorded."""

    def __init__(self, configuration: Configuration, steps: int) -> None:
        self.law: Any = new_law(configuration.table.name, configuration)
        self.reference = Reference(configuration.common, False)
        self._inp, self._out = np.zeros(inputs.SIZE, np.int64), np.zeros(4, np.int64)
        ref, state = self.reference.state, self.law.state
        self.expected = Expected(
            *(np.zeros((steps, n), np.int64) for n in (4, 2, 6, len(configuration.table.telemetry))),
            *(np.zeros((steps, len(array)), np.int64) for array in (ref, state)),
            self.law.par,
            self.reference.par,
        )

    def step(self, k: int, inp: np.ndarray) -> np.ndarray:
        """Torque in LSB."""
        self._inp[:] = inp
        e = self.expected
        started = self.reference.advance(self._inp)
        self.law.step(self._inp, self.reference.state, self._out)
        e.out[k] = self._out
        e.started[k] = started, self.law.reference_restarted
        e.reference_words[k] = self.reference.words()
        e.telemetry[k] = self.law.telemetry()
        e.ref[k], e.state[k] = self.reference.state, self.law.state
        return self._out[:3]


def again(episode: Episode) -> Expected:
    """What Python does with the recorded inputs."""
    flown = Flown(parse_configuration([*map(int, episode.common), *map(int, episode.params)]), len(episode.inp))
    for k, inp in enumerate(episode.inp):
        flown.step(k, inp)
    return flown.expected


# -- random episodes ---------------------------------------------------------------------------------------------------


def episodes(law: str, count: int, seed: int = 1) -> Iterator[Episode]:
    """`count` episodes; one in twelve has inputs without any sense, all others a closed loop."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        words = CONFIGURATIONS[law](rng)
        configuration = parse_configuration(config_words(law_by_name(law), words))
        yield _flight(configuration, rng, wild=number % 12 == 11)


def _common(rng: np.random.Generator, period_s: float) -> dict[str, Any]:
    lowest, highest = 2.0**-12, 2.0 ** rng.choice([-6, -3, -1, 0, 1])
    limit = rng.uniform(0.2, 1.0, 3) * highest if rng.random() < 0.7 else np.full(3, math.inf)
    wn = np.exp(rng.uniform(math.log(0.02), math.log(0.15))) / period_s
    return {
        "period_us": period_s * 1e6,
        "torque_bits": int(rng.integers(20, 31)),
        "momentum_bits": int(rng.integers(16, 31)),
        "torque_limit": [float(max(x, lowest)) for x in limit],
        "reference_kind": int(rng.choice([0, 1, 1, 1, 2])),
        "reference_pole": float(math.exp(-wn * period_s)),
        "rate_limit": int(rng.choice([0, rng.integers(1, 2**26)])),
        "accel_limit": int(rng.choice([0, rng.integers(1, 2**22)])),
    }


def _inertia(rng: np.random.Generator) -> list[float]:
    return [float(x) for x in np.exp(rng.uniform(math.log(0.5), math.log(8.0), 3))]


def _pd(rng: np.random.Generator) -> dict[str, Any]:
    period = float(np.exp(rng.uniform(math.log(0.05), math.log(5.0))))
    inertia, wn = np.array(_inertia(rng)), rng.uniform(0.02, 0.15) / period
    gains = {"kp": (inertia * wn * wn).tolist(), "kd": (inertia * 2 * rng.uniform(0.5, 1.2) * wn).tolist()}
    if rng.random() < 0.1:
        gains = {name: (10.0 ** rng.uniform(-6, 6, 3) * rng.choice([-1, 1], 3)).tolist() for name in gains}
    return {**_common(rng, period), **gains, "reference_lead": int(rng.integers(1, 3)), **_readings(rng),
            "rate": int(rng.random() < 0.4)}  # fmt: skip


def _readings(rng: np.random.Generator) -> dict[str, Any]:
    """Which error, of which angles, and the scale of the rates."""
    error, sequence = int(rng.random() < 0.5), int(rng.random() < 0.5)
    return {"error": error, "attitude_sequence": sequence, "rate_bits": int(rng.integers(8, 29))}


def _mrac(rng: np.random.Generator) -> dict[str, Any]:
    period, printed = float(rng.uniform(0.2, 1.0)), rng.random() < 0.3
    inertia = _inertia(rng)
    b = period * period / 2 / np.array(inertia)
    values = {
        "design": "printed" if printed else "repaired",
        "transport_delay_ticks": 0 if printed else 1,
        "c2_pole": float(rng.uniform(0.0, 0.9) if rng.random() < 0.2 else rng.uniform(0.65, 0.93)),
        "kappa": float(rng.uniform(0.0, 1.0)),
        "forgetting": float(rng.choice([1.0, rng.uniform(0.95, 1.0)])),
        "trace_max": float(np.exp(rng.uniform(0, math.log(1500)))),
        "F0": float(np.exp(rng.uniform(math.log(0.01), math.log(20.0)))),
        "decouple": int(rng.random() < 0.4),
        "identify": int(rng.random() < 0.8),
        "inertia_kgm2": inertia,
        "printed_b0": np.clip(b * rng.uniform(1, 6), -1.9, 1.9).tolist(),
        "printed_b1": np.clip(b * rng.uniform(0.5, 1.5), -1.9, 1.9).tolist(),
    }
    return {**_common(rng, period), **values}


def _appc(rng: np.random.Generator) -> dict[str, Any]:
    values = {
        "controller_pole": float(rng.uniform(0.6, 0.97)),
        "observer_pole": float(rng.uniform(0.3, 0.97)),
        "adapt": int(rng.random() < 0.8),
        "gyro": int(rng.random() < 0.5),
        "recover_torque": int(rng.random() < 0.8),
        "inertia_kgm2": _inertia(rng),
        "orbit_rate_radps": float(rng.choice([1.0830778e-3, rng.uniform(0, 0.007)])),
    }
    return {**_common(rng, float(rng.uniform(0.2, 1.0))), **values}


def _vsc(rng: np.random.Generator) -> dict[str, Any]:
    """The tuned law of study 000, its time scaled to the period."""
    period = float(np.exp(rng.uniform(math.log(0.05), math.log(5.0))))
    slow = period * rng.uniform(10, 60)
    gains = {"Ks": 1.449 / slow**2, "Kr": 0.914 / slow, "m": 0.881 / slow, "ka": _inertia(rng)}
    if rng.random() < 0.1:
        gains = {"Ks": rng.uniform(0, 2000), "Kr": rng.uniform(0, 2000), "m": rng.uniform(0, 100), "ka": _inertia(rng)}
    return {**_common(rng, period), **gains, **_readings(rng), "rate_in_S": int(rng.random() < 0.4)}


def _fvsc(rng: np.random.Generator) -> dict[str, Any]:
    values = _vsc(rng)
    table = np.clip(np.cumsum(rng.uniform(-0.01, 0.03, 65)), -1, 1)
    fuzzy = {"E": float(np.exp(rng.uniform(-5, 1))), "L": float(rng.uniform(0.1, 1)), "inference": int(rng.integers(2))}
    return {**values, **fuzzy, "f_table": table.tolist()}


def _ifvsc(rng: np.random.Generator) -> dict[str, Any]:
    values = _fvsc(rng)
    limit = float(np.exp(rng.uniform(-5, 5)))
    return {**values, "Ki": float(rng.choice([0.01, 0.1]) * values["Ks"]), "integral_limit": limit}


def _state_space(rng: np.random.Generator) -> dict[str, Any]:
    """PD with a filtered derivative, and states beside it that do little; one in ten has numbers without any sense."""
    period, n = float(np.exp(rng.uniform(math.log(0.05), math.log(5.0)))), int(rng.integers(1, 9))
    values = {
        **_readings(rng),
        "anti_windup": int(rng.random() < 0.5),
        "state_bits": int(rng.integers(18, 29)),
        **_common(rng, period),
    }
    if rng.random() < 0.1:
        A, B, C, D = (10.0 ** rng.uniform(-4, 2, (8, 8)) * rng.choice([-1, 0, 1], (8, 8)) for _ in range(4))
        return values | {"A": A.tolist(), "B": B[0].tolist(), "C": C[0].tolist(), "D": float(D[0, 0])}
    wn, pole = rng.uniform(0.02, 0.15) / period, rng.uniform(0.2, 0.8)
    kd = 2 * rng.uniform(0.5, 1.2) * wn / period * (1 - pole)
    A = np.diag([pole, *rng.choice([1.0, rng.uniform(0.3, 0.99)], n - 1)]) + 0.01 * np.tri(n, n, -1)
    B, C = np.append(1 - pole, rng.normal(0, 0.02, n - 1)), np.append(-kd, rng.normal(0, 0.02, n - 1) * wn * wn)
    scale = 2.0 ** rng.integers(-3, 3, n)
    values |= {"A": (A * scale[:, None] / scale).tolist(), "B": (B * scale).tolist(), "C": (C / scale).tolist()}
    return values | {"D": float(wn * wn + kd), "gain": (np.array([2.13, 3.04, 3.09]) * rng.uniform(0.8, 1.2)).tolist()}


CONFIGURATIONS = {"pd": _pd, "mrac": _mrac, "appc": _appc, "fvsc": _fvsc, "vsc": _vsc, "ifvsc": _ifvsc,
                  "state_space": _state_space}  # fmt: skip


def _flight(configuration: Configuration, rng: np.random.Generator, wild: bool) -> Episode:
    common, words = configuration.common, np.array(configuration.words, np.int32)
    split = len(COMMON)
    inp = _inputs(common, rng)
    episode = Episode(
        configuration.table.name, words[:split], words[split:], inp, None, words[[14, 15, 16]].astype(np.int64)
    )
    try:
        flown = Flown(configuration, STEPS)
    except LawRefuses:
        return episode
    satellite = Satellite(configuration, rng)
    for k in range(STEPS):
        if wild:
            inp[k, 3:22] = rng.integers(*INT32, 19)
        else:
            satellite.read(inp, k)
        satellite.command(flown.step(k, inp[k]))
    episode.expected = flown.expected
    return episode


def _inputs(common: dict[str, int], rng: np.random.Generator) -> np.ndarray:
    """fresh, good_run, applied_known, set-point and tick; readings come from the satellite."""
    inp = np.zeros((STEPS, inputs.SIZE), np.int32)
    loss = rng.choice([0.0, 0.03, 0.3])
    fresh = rng.random(STEPS) >= loss
    start = rng.integers(0, STEPS)
    fresh[start : start + rng.integers(0, 30)] = False
    good = 0
    for k in range(STEPS):
        good = good + 1 if fresh[k] else 0
        inp[k, inputs.GOOD_RUN] = good
    inp[:, inputs.FRESH] = fresh
    inp[:, inputs.APPLIED_KNOWN] = fresh if rng.random() < 0.7 else rng.random(STEPS) < 0.5
    angles = rng.uniform(-1, 1, (4, 3)) * rng.choice([2.0**24, 2.0**26, 2.0**28])
    inp[:, inputs.SETPOINT] = np.repeat(angles, STEPS // 4, axis=0)
    inp[:, inputs.TICK] = np.arange(STEPS)
    return inp


class Satellite:
    """Three double integrators with the law's torque, a constant disturbance, noise, and wheels that take it up."""

    def __init__(self, configuration: Configuration, rng: np.random.Generator) -> None:
        common, values = configuration.common, configuration.values
        self._period = common["period_us"] * 1e-6
        belief = configuration.vector("inertia_kgm2") if "inertia_kgm2_x" in values else (2.13, 3.04, 3.09)
        if "ka_x" in values:
            belief = configuration.vector("ka")
        if configuration.table.name == "pd":  # what its gains are for: damping 1
            belief = tuple(
                min(max(kd * kd / 4 / max(abs(kp), 1e-9), 0.1), 50.0)
                for kp, kd in zip(configuration.vector("kp"), configuration.vector("kd"), strict=True)
            )
        self._turns = self._period**2 / 2 / math.pi / (np.array(belief) * rng.uniform(0.85, 1.2, 3))
        self._lsb = 2.0 ** -common["torque_bits"]
        self._momentum_lsb = 2.0 ** -common["momentum_bits"]
        self._rate_lsb = 2.0 ** -common["rate_bits"]
        self._angle = rng.uniform(-1, 1, 3) * rng.choice(
            [0.001, 0.003, 0.01, 0.03, 0.5], p=[0.3, 0.3, 0.2, 0.15, 0.05]
        )  # turns
        self._rate = rng.normal(0, 1, 3) * 1e-5
        self._disturbance = rng.normal(0, 1, 3) * rng.choice([0.0, 1e-6, 2e-5])
        self._noise = rng.normal(0, 1, (STEPS, 3)) * rng.choice([0.0, 1e-7, 5e-5])
        self._momentum = rng.uniform(-0.2, 0.2, 3)
        self._acting = self._wanted = np.zeros(3)
        self._delay = common["transport_delay_ticks"]

    def read(self, inp: np.ndarray, k: int) -> None:
        """Readings of tick k; the old ones while none comes."""
        if self._delay:
            self._acting = self._wanted
        if not inp[k, inputs.FRESH]:
            inp[k, 3:19] = inp[k - 1, 3:19] if k else 0
            inp[k, inputs.APPLIED] = np.clip(self._acting / self._lsb, -(2**31), 2**31 - 1)
            return
        turns = self._angle + self._noise[k]
        inp[k, inputs.EULER] = np.rint((turns - np.rint(turns)) * 2.0**32).astype(np.int64).astype(np.int32)
        rate = self._rate * 2.0 * math.pi / self._period / self._rate_lsb
        inp[k, inputs.RATE] = np.clip(np.rint(rate), -(2**31), 2**31 - 1)
        inp[k, inputs.APPLIED] = np.clip(self._acting / self._lsb, -(2**31), 2**31 - 1)
        inp[k, inputs.MOMENTUM] = np.clip(self._momentum / self._momentum_lsb, -(2**31), 2**31 - 1)

    def command(self, torque: np.ndarray) -> None:
        """The law's answer, LSB; the satellite moves on to the next tick."""
        self._wanted = torque * self._lsb
        if not self._delay:
            self._acting = self._wanted
        acceleration = (self._acting + self._disturbance) * self._turns
        self._angle = self._angle + self._rate + acceleration / 2
        self._rate = np.clip(self._rate + acceleration, -0.2, 0.2)
        self._momentum = self._momentum - self._acting * self._period


def main() -> None:
    """sys.argv: file of recorded episodes, file for what Python does with them."""
    with open(sys.argv[1], "rb") as file:
        recorded: list[Episode] = pickle.load(file)
    with open(sys.argv[2], "wb") as file:
        pickle.dump([again(episode) for episode in recorded], file)
