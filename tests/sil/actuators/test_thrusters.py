"""Thrusters: gain, limit, misalignment, in that order; torque from outside, which no wheel takes up; their faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from protocol.law_tables import INT32_MAX
from sil.configure import orders
from sil.instruments import actuator_of
from sil.plants.rigid import Rigid
from sil.scenario import load_values

SIX_TICKS = {"duration_s": 3.0}


def scenario(actuators=None, **thrusters):
    return load_values({**SIX_TICKS, "actuators": {"kind": "thrusters", "thrusters": thrusters, **(actuators or {})}})


def applied(command, **thrusters):
    return actuator_of(scenario(**thrusters)).limit(np.array(command), np.zeros(3), 0.5, 0)


def test_five_percent_of_misalignment():
    """Study of paper 000: 0.9975 on the diagonal, 0.05 off it, columns of unit norm."""
    K_T = np.array(scenario(misalignment_percent=5).actuators.thrusters.K_T)
    np.testing.assert_allclose(K_T, np.full((3, 3), 0.05) + 0.9475 * np.eye(3), atol=5e-6)
    np.testing.assert_allclose(np.linalg.norm(K_T, axis=0), 1.0, atol=1e-15)


def test_gain_then_limit_then_misalignment():
    tilted = [[0.8, 0.0, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 1.0]]
    found = applied([1.0, -0.01, 0.02], gain=[0.5, 2, 1], torque_max_Nm=[0.1, 0.1, 0.01], misalignment=tilted)
    np.testing.assert_allclose(found, [0.08, 0.06 - 0.02, 0.01], atol=1e-15)
    assert applied([1e-3, -2e-3, 3e-3]).tolist() == [1e-3, -2e-3, 3e-3], "nothing said, nothing changed"
    assert applied([1e3, 0, 0], torque_max_Nm=None).tolist() == [1e3, 0, 0]


def test_no_wheel_takes_up_the_torque():
    """I w' = tau - w x (I w): momentum grows by the torque, and that of the wheels does not change."""
    flown = load_values(
        {
            "plant": {"inertia_kgm2": [400, 400, 400], "gravity_gradient": False, "step_s": 0.01},
            "actuators": {"kind": "thrusters"},
            "attitude": {"frame": "inertial"},
        }
    )
    plant, torque = Rigid.from_scenario(flown), np.array([1.0, -2.0, 3.0])
    start = plant.motion(0)
    for k in range(20):
        plant.advance(torque, k * 500_000_000, 500_000_000)
    end = plant.motion(10_000_000_000)
    assert end.momentum_B.tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(400 * (end.omega_BN_B - start.omega_BN_B), 10 * torque, rtol=1e-12)


def test_spinning_wheels_keep_their_momentum_beside_thrusters():
    wheels = {"inertia_kgm2": 0.01, "initial_speed_radps": [100, 0, 0]}
    plant = Rigid.from_scenario(scenario({"wheels": wheels}))
    before = plant.motion(0).momentum_B
    plant.advance(np.array([0.1, 0.1, 0.1]), 0, 500_000_000)
    assert plant.motion(500_000_000).momentum_B.tolist() == before.tolist()
    assert before[0] == pytest.approx(1.0, rel=1e-3)


def test_the_board_is_told_the_command_at_which_they_saturate():
    words = orders(scenario(gain=[1, 2, 4], torque_max_Nm=[0.1, 0.1, None])).configuration.common
    lsb = 2.0 ** -words["torque_bits"]
    assert words["torque_limit_x"] * lsb == pytest.approx(0.1, abs=lsb)
    assert words["torque_limit_y"] * lsb == pytest.approx(0.05, abs=lsb)


@pytest.mark.parametrize("most", [1e-3, 0.1, 1.99, 40.0, 4e6])
def test_what_acts_fits_the_wire(most):
    """40 N m with 5 % of misalignment can be 43.9 N m about one axis."""
    made = scenario(torque_max_Nm=most, misalignment_percent=5)
    largest = most * (math.sqrt(0.995) + 0.1)
    assert largest * 2**made.torque_bits < INT32_MAX
    assert made.torque_bits == 30 or largest * 2 ** (made.torque_bits + 1) >= INT32_MAX


def test_faults_of_thrusters():
    assert applied([0.1, 0.1, 0.1], faults=[{"kind": "off", "axis": "y"}]).tolist() == [0.1, 0.0, 0.1]
    doubled = applied([0.01] * 3, gain=2, faults=[{"kind": "wrong", "scale": 0.5, "axis": "x"}])
    assert doubled.tolist() == [0.01, 0.02, 0.02]
    garbage = applied([0.0] * 3, gain=0.5, torque_max_Nm=0.1, faults=[{"kind": "garbage"}])
    assert 0.0 < np.abs(garbage).max() <= 0.1


@pytest.mark.parametrize(
    ("actuators", "line"),
    [
        ({"kind": "wheel"}, "kind: expected one of wheels, thrusters (did you mean wheels?), got 'wheel'"),
        ({"thrusters": {"gain": [1, 0, 1]}}, "thrusters.gain: expected a number above 0, or 3 of them, got [1, 0, 1]"),
        (
            {"thrusters": {"misalignment": [[0.9, 0, 0], [0, 1, 0], [0, 0, 1]]}},
            "thrusters.misalignment: expected columns of norm 1 within 0.001 (they have 0.9, 1, 1; a size belongs into "
            "gain), got [[0.9, 0, 0], [0, 1, 0], [0, 0, 1]]",
        ),
        (
            {"thrusters": {"misalignment_percent": 1, "misalignment": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}},
            "thrusters.misalignment_percent: expected 0 beside misalignment, which says all of it, got 1.0",
        ),
        (
            {"thrusters": {"faults": [{"kind": "off"}]}},
            "thrusters.faults: expected faults of the actuator that is there (actuators.kind: thrusters), got 'wheels'",
        ),
        (
            {"kind": "thrusters", "thrusters": {"torque_max_Nm": None, "faults": [{"kind": "garbage"}]}},
            "thrusters.faults[0].kind: expected a torque_max_Nm, within which garbage is drawn, got 'garbage'",
        ),
        (
            {"kind": "thrusters", "thrusters": {"torque_max_Nm": 1e7}},
            "thrusters.torque_max_Nm: expected at most 8388608 N m, got 10000000.0",
        ),
    ],
)
def test_what_cannot_be_is_one_line(actuators, line):
    with pytest.raises(ValueError) as refused:
        load_values({**SIX_TICKS, "actuators": actuators})
    assert str(refused.value).removeprefix("recorded scenario: ") == f"actuators.{line}"
