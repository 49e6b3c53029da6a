"""predictor: with a known delay and inertia the loop is the one without delay; losses, disturbances, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from firmware_sim.controllers import LawRefuses, inputs, new_law
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration

T, J, TICKS = 0.1, 2.0, 300
FINE = 20  # plant steps per tick
GOAL = np.radians([20.0, -30.0, 10.0])
FLAT = {"error": "euler", "inertia_kgm2": J, "wn_radps": 1.2, "torque_limit": 0.5, "torque_bits": 28}


def fly(
    true_delay_s: float, n: int = 0, lost: frozenset[int] = frozenset(), torque: float = 0.0, **values: Any
) -> tuple[np.ndarray, Any]:
    """(angle (TICKS, 3) of three double integrators after a step of the set-point, the law); readings delay_s old."""
    given = FLAT | {"period_us": round(T * 1e6), "transport_delay_ticks": n, "delay_s": true_delay_s} | values
    configuration = parse_configuration(config_words(law_by_name("predictor"), {"reference_kind": "none", **given}))
    law, reference = new_law("predictor", configuration), Reference(configuration.common, True)
    x, w, past, acting = np.zeros(3), np.zeros(3), [(np.zeros(3), np.zeros(3))], [np.zeros(3)] * n
    inp, out, rows = np.zeros(inputs.SIZE), np.zeros(4), []
    for k in range(TICKS):
        rows.append(x.copy())
        inp[inputs.FRESH], inp[inputs.TICK] = k not in lost, k
        inp[inputs.EULER], inp[inputs.RATE] = past[max(0, round((k - true_delay_s / T) * FINE))]
        inp[inputs.SETPOINT] = GOAL
        reference.advance(inp)
        law.step(inp, reference.state, out)
        acting.append(out[:3].copy())
        acceleration = (acting.pop(0) + torque) / J
        for _ in range(FINE):
            x, w = x + w * T / FINE + acceleration * (T / FINE) ** 2 / 2, w + acceleration * T / FINE
            past.append((x, w))
    return np.array(rows), law


@pytest.fixture(scope="module")
def undelayed() -> np.ndarray:
    angles, _ = fly(0.0)
    assert np.abs(angles[-1] - GOAL).max() < 1e-6 and np.abs(angles[20] - GOAL).max() > 0.01
    return angles


@pytest.mark.parametrize("delay_s", [0.2, 0.235, 0.5, 1.0])
def test_a_known_delay_changes_nothing(delay_s: float, undelayed: np.ndarray) -> None:
    """Whole samples or not, and with the torque at its limit on the way: what was sent is what acted."""
    assert np.abs(fly(delay_s)[0] - undelayed).max() < 1e-7  # a word holds 2^-24 s


@pytest.mark.parametrize("n", [1, 3])
def test_a_transport_delay_moves_all_by_n_ticks(n: int, undelayed: np.ndarray) -> None:
    assert np.abs(fly(0.25, n)[0][n:] - undelayed[:-n]).max() < 1e-7


def test_lost_readings_change_nothing_either(undelayed: np.ndarray) -> None:
    lost = frozenset(np.flatnonzero(np.random.default_rng(3).random(TICKS - 1) < 0.4).tolist()) | set(range(40, 60))
    assert np.abs(fly(0.3, lost=frozenset(k + 1 for k in lost))[0] - undelayed).max() < 1e-7


def test_a_constant_torque_is_found_and_leaves_no_error() -> None:
    angles, law = fly(0.5, torque=0.01)
    assert law.field("disturbance") == pytest.approx([0.01] * 3, rel=1e-3)
    assert np.abs(angles[-1] - GOAL).max() < 1e-4
    without, _ = fly(0.5, torque=0.01, disturbance=0, observer_pole=0.0)
    left = 0.01 / J * (1 / 1.2**2 + 0.5**2 / 2 + 2 * 0.9 * 0.5 / 1.2)  # of a PD, and what the prediction leaves out
    assert without[-1] - GOAL == pytest.approx([left] * 3, rel=1e-3)


def test_a_wrong_delay_is_felt() -> None:
    """The study: at half a second, wn 1.6, two samples too few oscillate and one is borne."""
    said = {samples: FLAT | {"delay_s": samples * T, "wn_radps": 1.6} for samples in (5, 4, 3)}
    residual = {samples: float(np.abs(fly(0.5, **values)[0][-60:] - GOAL).max()) for samples, values in said.items()}
    print(residual)
    assert residual[5] < 1e-4 and residual[4] < 0.01 and residual[3] > 0.02


def test_what_it_refuses() -> None:
    with pytest.raises(LawRefuses, match=r"law predictor: expected delay_s at most 250 periods \(25 s\), got 30"):
        fly(30.0)
    with pytest.raises(LawRefuses, match="law predictor: expected form float, got fixed"):
        fly(0.1, form="fixed")


def test_before_the_first_reading_nothing_is_asked_for() -> None:
    angles, _ = fly(0.2, lost=frozenset(range(5)))
    assert not angles[:6].any() and math.isfinite(angles[-1].sum())
