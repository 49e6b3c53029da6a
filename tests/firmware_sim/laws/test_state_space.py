"""state_space: scipy's answers, fixed beside float, losses, limits; a compensator of the study in a closed loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from firmware_sim.controllers import LawRefuses, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration
from sil.design.discrete import discretised
from sil.design.glover import Shape, glover
from sil.design.linear import StateSpace
from sil.design.lqg import Weights
from sil.design.lqg import lqg as lqg_design
from sil.design.realisation import fitted

FORMS = ("float", "fixed")
LSB = 2.0**-30


class Bench:
    """The law stepped by hand: error in rad (the reading is 0, the set-point the reference), torque in N m."""

    def __init__(self, form: str, **values: Any) -> None:
        given = {"form": form, "reference_kind": "none", "error": "euler", "gain": 1.0} | values
        configuration = parse_configuration(config_words(law_by_name("state_space"), given))
        self.law = new_law("state_space", configuration)
        self.reference = Reference(configuration.common, form == "float")
        self.scale = inputs.si_scale(configuration.common)
        self.is_float = form == "float"

    def step(self, reading: Any, setpoint: Any = 0.0, fresh: bool = True) -> tuple[np.ndarray, int]:
        wire, out = np.zeros(inputs.SIZE), np.zeros(4, self.law.state.dtype)  # type: ignore[attr-defined]
        wire[inputs.FRESH] = fresh
        wire[inputs.EULER], wire[inputs.SETPOINT] = reading, setpoint
        wire[3:] = np.round(wire[3:] / self.scale[3:])
        inp = wire * self.scale if self.is_float else wire.astype(np.int64)
        self.reference.advance(inp)
        self.law.step(inp, self.reference.state, out)
        return out[:3] * (1.0 if self.is_float else LSB), int(out[3])


def compensator(order: int) -> tuple[np.ndarray, ...]:
    """A stable one with full matrices; the first pole is an integrator."""
    rng = np.random.default_rng(order)
    T = np.linalg.qr(rng.standard_normal((order, order)))[0]
    poles = np.concatenate([[1.0], rng.uniform(-0.5, 0.98, order - 1)])
    return T @ np.diag(poles) @ T.T, rng.standard_normal(order), 0.01 * rng.standard_normal(order), np.array(0.02)


@pytest.mark.parametrize("order", [1, 3, 8])
@pytest.mark.parametrize("form", FORMS)
def test_it_answers_as_scipy_does(form: str, order: int) -> None:
    """A gain per axis. 32 bits of a coefficient, 28 in the fixed form, are felt most where an integrator is spread over
    all states; of order 1 they leave three LSB of the torque."""
    A, B, C, D = compensator(order)
    gain = np.array([1.0, 0.5, -2.0])
    bench = Bench(form, A=A.tolist(), B=B.tolist(), C=C.tolist(), D=float(D), gain=gain.tolist())
    error = np.random.default_rng(9).uniform(-0.5, 0.5, (300, 3))
    mine = np.array([bench.step(0.0, row)[0] for row in error])
    system = (A, B[:, None], C[None], D.reshape(1, 1), 1.0)
    theirs = gain * np.stack([dlsim(system, error[:, i : i + 1])[1].ravel() for i in range(3)], axis=1)
    assert np.abs(theirs).max() > 0.02
    assert np.abs(mine - theirs).max() < {"float": 1e-8, "fixed": 3 * LSB if order == 1 else 1e-7}[form]


def test_no_compensator_is_a_gain() -> None:
    for form in FORMS:
        assert Bench(form, A=[], B=[], C=[], D=0.5).step(0.0, [0.1, 0.2, -0.3])[0] == pytest.approx(
            [0.05, 0.1, -0.15], abs=2e-9
        )


# LQG of paper 000, experiment 2, eq. (5.1): torque from error, J = 0.01, |u| <= 0.01; poles of 11 rad/s at T_s 0.1 s
LQG_NUM = 0.00082667 * np.array([3.9**2, 5.6, 1.0])
LQG_DEN = np.array([0.091**2, 0.13, 1.0, 0.0])


def lqg(**more: Any) -> dict[str, Any]:
    num, den, _ = cont2discrete((LQG_NUM, LQG_DEN), 0.1, "bilinear")
    a, b = den[1:], num.ravel()
    A = np.vstack([-a, np.eye(len(a))[:-1]])
    values = {"A": A.tolist(), "B": np.eye(len(a))[0].tolist(), "C": (b[1:] - b[0] * a).tolist(), "D": float(b[0])}
    return values | {"period_us": 100_000, "torque_limit": 0.01, "state_bits": 20} | more


def closed_loop(form: str, goal_rad: float, ticks: int, J: float, delay: int = 0, **values: Any) -> np.ndarray:
    """(ticks, 2): angle and torque of axis x after a step of the set-point; double integrator, torque held."""
    bench, angle, rate, rows = Bench(form, **values), 0.0, 0.0, []
    lsb = 2.0 ** -values.get("torque_bits", 30)
    seen = [0.0] * (delay + 1)
    for _ in range(ticks):
        seen = [*seen[1:], angle]
        u = bench.step([seen[0], 0.0, 0.0], [goal_rad, 0.0, 0.0])[0][0] * (1.0 if form == "float" else lsb / LSB)
        rows.append((angle, u))
        angle, rate = angle + 0.1 * rate + 0.005 * u / J, rate + 0.1 * u / J
    return np.array(rows)


def test_fixed_and_float_fly_the_studys_lqg_alike() -> None:
    """A step of 20 deg with the torque at its limit first, then 100 s of settling: an integrator in companion form."""
    flown = {form: closed_loop(form, math.radians(20.0), 1000, 0.01, **lqg()) for form in FORMS}
    difference = np.abs(flown["fixed"] - flown["float"]).max(axis=0)
    print(f"fixed against float: {math.degrees(difference[0]):.1e} deg, {difference[1]:.1e} N m")
    assert np.abs(flown["float"][:, 1]).max() == pytest.approx(0.01, abs=1e-8)
    assert np.abs(flown["float"][-50:, 0] - math.radians(20.0)).max() < 1e-4
    assert math.degrees(difference[0]) < 1e-3 and difference[1] < 5e-6


def designed(system: StateSpace) -> dict[str, Any]:
    """As `sil design` writes it."""
    C = fitted(discretised(system, 0.1))
    values = {"A": C.A.tolist(), "B": C.B[:, 0].tolist(), "C": C.C[0].tolist(), "D": float(C.D[0, 0])}
    return values | {"period_us": 100_000, "state_bits": 28}


@pytest.mark.parametrize(
    ("name", "system", "J", "limit", "bits"),
    [
        ("Glover-McFarlane with integral", glover(Shape(0.8, integral=0.03), 0.6).compensator, 1.0, 1.0, 30),
        ("the same, 400 kg m^2", glover(Shape(0.8, integral=0.03), 0.6).compensator, 400.0, 40.0, 25),
        ("LQG with integral", lqg_design(Weights(0.3, 1.5, 0.2), 0.5), 0.01, 0.01, 30),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_fixed_and_float_fly_what_is_designed_alike(
    name: str, system: StateSpace, J: float, limit: float, bits: int
) -> None:
    """120 s at T_s 0.1, readings half a second old, a step of 20 deg that takes the torque to its limit."""
    values = designed(system) | {"gain": J, "torque_limit": limit, "torque_bits": bits}
    flown = {form: closed_loop(form, math.radians(20.0), 1200, J, delay=5, **values) for form in FORMS}
    difference = np.abs(flown["fixed"] - flown["float"]).max(axis=0)
    order = len(values["A"])
    print(f"{name}: order {order}, {math.degrees(difference[0]):.1e} deg, {difference[1] / limit:.1e} of the limit")
    assert np.abs(flown["float"][-50:, 0] - math.radians(20.0)).max() < math.radians(0.5)
    assert math.degrees(difference[0]) < 1e-4 and difference[1] < 1e-5 * limit


@pytest.mark.parametrize("form", FORMS)
def test_without_a_reading_states_stay_and_the_command_is_repeated(form: str) -> None:
    bench = Bench(form, A=[[1.0]], B=[0.1], C=[1.0], D=0.5)
    assert bench.step(0.0, 0.1, fresh=False) == (pytest.approx([0.0] * 3), inputs.STARTING)
    last = bench.step(0.0, 0.1)[0]
    states = bench.law.state.copy()  # type: ignore[attr-defined]
    for _ in range(5):
        torque, flags = bench.step(0.3, 0.1, fresh=False)
        assert torque.tolist() == last.tolist() and not flags
    assert bench.law.state[:24].tolist() == states[:24].tolist()  # type: ignore[attr-defined]
    assert bench.step(0.0, 0.1)[0] == pytest.approx(0.05 + 0.01, abs=1e-8)  # one step of the integrator, not six


@pytest.mark.parametrize("form", FORMS)
def test_an_integrator_winds_up_unless_told_not_to(form: str) -> None:
    """After ten seconds at the limit the linear form stays there for ten seconds more; anti_windup leaves at once."""
    stays = {}
    for on in (0, 1):
        bench = Bench(form, A=[[1.0]], B=[1.0], C=[0.01], D=0.1, torque_limit=0.05, anti_windup=on)
        for _ in range(100):
            torque, flags = bench.step(0.0, 0.4)
        assert torque == pytest.approx([0.05] * 3, abs=2e-9) and flags == inputs.SATURATED
        back = [bench.step(0.0, -0.4)[0][0] for _ in range(120)]
        stays[on] = next(k for k, u in enumerate(back) if u < 0.049)
        assert min(back) == pytest.approx(-0.05, abs=2e-9)  # and it is not stuck anywhere
    assert stays[0] > 70 and stays[1] == 0


def test_a_full_state_saturates_and_says_so() -> None:
    """Fixed form: an integrator at the end of its register stays there, and comes back as soon as the error turns."""
    bench = Bench("fixed", A=[[1.0]], B=[1.0], C=[0.5], D=0.0, state_bits=30)
    flags = [bench.step(0.0, 0.4)[1] for _ in range(10)]
    assert [bool(flag & inputs.ARITHMETIC) for flag in flags] == [False] * 4 + [True] * 6
    assert bench.step(0.0, -0.4)[0] == pytest.approx([1.0] * 3, abs=1e-8)
    assert bench.step(0.0, -0.4)[0] == pytest.approx([0.8] * 3, abs=1e-8)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"B": [1e5], "state_bits": 30}, "B below 1024"),
        ({"C": [1e6], "state_bits": 10}, "C times gain below 128"),
        ({"gain": 1e6, "D": 1e4}, "D times gain below"),
    ],
)
def test_what_fixed_point_cannot_hold_is_refused(values: dict[str, Any], name: str) -> None:
    whole = {"A": [[0.5]], "B": [1.0], "C": [1.0]} | values
    with pytest.raises(LawRefuses, match=f"law state_space: expected {name}"):
        Bench("fixed", **whole)
    Bench("float", **whole)
