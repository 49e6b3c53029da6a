"""Faults of wheels: what each makes of a command, when and on which axes; limits stay the good wheels'."""

from __future__ import annotations

import numpy as np
import pytest

from sil.actuators.faults import FAULTS
from sil.instruments import actuator_of
from sil.scenario import load_values

TICKS = 60  # of 0.5 s


def wheels(*faults, seed=0, ticks=TICKS, **section):
    values = {"faults": faults, "momentum_max_Nms": None, **section}
    return actuator_of(load_values({"actuators": {"wheels": values}, "duration_s": ticks * 0.5, "seed": seed}))


def command(tick):
    return np.array([1e-3, -2e-3, 3e-3]) * (tick + 1) / 3


def applied(made, ticks=range(TICKS)):
    return {k: made.limit(command(k), np.zeros(3), 0.5, k).tolist() for k in ticks}


GOOD = applied(wheels())


def flown(*faults, **how):
    return applied(wheels(*faults, **how))


@pytest.mark.parametrize("kind", FAULTS)
def test_before_and_after_the_wheels_are_good(kind):
    own = {"wrong": {"scale": 0.5}, "slow": {"period_s": 2}, "delayed": {"delay_s": 2}, "intermittent": {"fraction": 1}}
    made = flown({"kind": kind, "at_s": 10, "for_s": 5, **own.get(kind, {})})
    assert [k for k in range(TICKS) if made[k] == GOOD[k]] == [
        k for k in range(TICKS) if not 20 <= k < 30 or (kind == "stuck" and k == 20) or (kind == "slow" and k % 4 == 0)
    ]


def test_each_kind_on_its_axis():
    x, y, z = GOOD[25]
    assert flown({"kind": "off", "axis": "y"})[25] == [x, 0.0, z]
    assert flown({"kind": "stuck", "at_s": 10, "axis": ["x", "z"]})[25] == [GOOD[20][0], y, GOOD[20][2]]
    assert flown({"kind": "wrong", "scale": 0.5, "bias_Nm": 0.01, "axis": "x"})[25] == [0.5 * x + 0.01, y, z]
    assert flown({"kind": "slow", "period_s": 5, "axis": "x"})[25] == [GOOD[20][0], y, z]
    assert flown({"kind": "delayed", "delay_s": 1.1, "axis": "z"})[25] == [x, y, GOOD[22][2]]
    assert flown({"kind": "intermittent", "on_s": 5, "off_s": 5, "axis": "z"})[15] == [*GOOD[15][:2], 0.0]


def test_delayed_from_the_start_there_was_no_command():
    made = flown({"kind": "delayed", "delay_s": 1})
    assert made[0] == made[1] == [0.0, 0.0, 0.0]
    assert made[2] == GOOD[0]


def test_garbage_is_within_the_torque_limit_and_by_seed_and_tick():
    fault = {"kind": "garbage", "axis": ["x", "y"]}
    made = flown(fault, torque_max_Nm=[0.1, 0.02, 0.1])
    values = np.array([made[k][:2] for k in range(TICKS)])
    assert (np.abs(values) <= [0.1, 0.02]).all()
    assert (np.abs(values).max(axis=0) > [0.09, 0.018]).all()
    assert applied(wheels(fault, torque_max_Nm=[0.1, 0.02, 0.1]), reversed(range(TICKS))) == made
    assert flown(fault, torque_max_Nm=[0.1, 0.02, 0.1], seed=1) != made


def test_intermittent_by_chance():
    made = applied(wheels({"kind": "intermittent", "fraction": 0.3}, ticks=4096), range(4096))
    assert sum(value == [0.0, 0.0, 0.0] for value in made.values()) / 4096 == pytest.approx(0.3, abs=0.02)


def test_the_limits_are_those_of_the_wheels():
    made = wheels({"kind": "wrong", "scale": 100.0, "bias_Nm": 0.0}, momentum_max_Nms=0.3)
    torque = made.limit(np.array([0.01, -0.01, 0.0]), np.array([-0.3, 0.2, 0.0]), 0.5, 3)
    assert torque.tolist() == pytest.approx([0.0, -0.1, 0.0])


def test_a_command_meets_the_faults_in_the_order_of_the_list():
    double, bias = {"kind": "wrong", "scale": 2.0}, {"kind": "delayed", "delay_s": 0.5}
    half = {"kind": "intermittent", "on_s": 0.5, "off_s": 0.5}
    assert flown(double, bias)[10] == [2 * value for value in GOOD[9]]
    assert flown(bias, half)[9] == [0.0] * 3  # delayed, then cut off
    assert flown(half, bias)[10] == [0.0] * 3  # what was cut off comes later


@pytest.mark.parametrize("kind", ["stuck", "slow", "delayed"])
def test_the_command_that_acts_after_all_counts(kind):
    """With transport delay 0 a tick is asked for twice: the wheels have to forget the first command."""
    own = {"slow": {"period_s": 2}, "delayed": {"delay_s": 0.5}}
    made = wheels({"kind": kind, "at_s": 10, **own.get(kind, {})})
    for k in range(24):
        made.limit(command(k - 1), np.zeros(3), 0.5, k - 1)
        last = made.limit(command(k), np.zeros(3), 0.5, k)
    assert last.tolist() == GOOD[22 if kind == "delayed" else 20]


def test_nobody_writes_into_a_command():
    given = command(5)
    wheels({"kind": "off"}).limit(given, np.zeros(3), 0.5, 5)
    assert given.tolist() == command(5).tolist()
