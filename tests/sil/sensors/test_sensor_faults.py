"""Faults of sensors: what each does to a reading, what the instrument says of it, and when; by seed and tick."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sil import sensors
from sil.faulted import orders
from sil.instruments import sensors_of
from sil.plugins import load
from sil.scenario import load_values
from sil.sensors import SENSORS
from sil.sensors.faults import FAULTS
from sil.sensors.faults.wrapped import Wrapped
from sil.signals import Motion

TURN = 2**32
TICKS = 60  # of 0.5 s
PERIOD_US = 500_000


def truth(tick):
    """Every value changes from tick to tick."""
    euler = np.radians([1.0 + tick, -2.0 - tick, 0.5 * tick])
    omega = np.array([1e-3, -2e-3, 3e-3]) * (tick + 1)
    half = 0.01 * tick
    return Motion(tick, np.array([math.cos(half), math.sin(half), 0.0, 0.0]), omega, np.zeros(3), euler, np.zeros(3))


def sensor(name, *faults, seed=0, ticks=TICKS):
    values = {"enabled": True, "faults": faults}
    only = {"attitude": {"enabled": False}, name: values}
    ((made,), _) = sensors_of(load_values({"sensors": only, "duration_s": ticks * 0.5, "seed": seed}))
    return made


def readings(made, ticks=range(TICKS)):
    """{tick: (values, age in us, valid)}"""
    found = {}
    for tick in ticks:
        reading = made.read(truth(tick), tick)
        found[tick] = (reading.values, reading.age_us, made.valid)
    return found


def flown(name, *faults, **how):
    return readings(sensor(name, *faults, **how))


GOOD = {name: flown(name) for name in SENSORS}


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("kind", FAULTS)
def test_before_and_after_it_is_the_good_sensor(name, kind):
    own = {
        "wrong": {"bias_degps" if name == "rate" else "bias_deg": 1},
        "slow": {"period_s": 2},
        "delayed": {"delay_s": 2},
        "intermittent": {"fraction": 1},
    }
    made = flown(name, {"kind": kind, "at_s": 10, "for_s": 5, **own.get(kind, {})})
    assert [k for k in range(TICKS) if made[k] == GOOD[name][k]] == [
        k for k in range(TICKS) if not 20 <= k < 30 or (kind == "stuck" and k == 20) or (kind == "slow" and k % 4 == 0)
    ]


@pytest.mark.parametrize("name", SENSORS)
def test_off_is_not_valid(name):
    made = flown(name, {"kind": "off", "at_s": 10})
    assert {made[k] for k in range(20, TICKS)} == {((0,) * len(GOOD[name][0][0]), 0, False)}
    assert made[19] == GOOD[name][19]


def test_one_axis_off_takes_the_validity_of_the_whole_and_leaves_the_other_values():
    made = flown("attitude", {"kind": "off", "at_s": 10, "axis": "y"})
    x, _, z = GOOD["attitude"][25][0]
    assert made[25] == ((x, 0, z), 0, False)


def test_stuck_is_silent():
    made = flown("attitude", {"kind": "stuck", "at_s": 10.2, "for_s": 5, "axis": ["z", "x"]})
    held, good = GOOD["attitude"][21][0], GOOD["attitude"][27][0]
    assert made[27] == ((held[0], good[1], held[2]), 0, True)
    assert made[20] == GOOD["attitude"][20]


@pytest.mark.parametrize(("name", "half"), [("attitude", 2**31), ("rate", 2**31), ("quaternion", 2**30)])
def test_garbage_is_anything_the_wire_can_carry(name, half):
    values = np.array(
        [value for value, age, valid in flown(name, {"kind": "garbage"}).values() if (age, valid) == (0, True)]
    )
    assert len(values) == TICKS
    assert values.min() < -0.9 * half
    assert 0.9 * half < values.max() < half
    assert abs(values.mean()) < 0.15 * half


def test_garbage_is_by_seed_and_tick_not_by_the_order_of_calls():
    garbage = {"kind": "garbage", "axis": "x"}
    forward, backward = flown("rate", garbage), readings(sensor("rate", garbage), reversed(range(TICKS)))
    assert forward == backward
    assert forward != flown("rate", garbage, seed=1)
    two = flown("rate", garbage, {"kind": "garbage", "axis": "y"})
    assert [v[0][0] for v in two.values()] == [v[0][0] for v in forward.values()]
    assert all(v[0][0] != v[0][1] for v in two.values())


def test_wrong_angle():
    made = flown("attitude", {"kind": "wrong", "scale": 1.5, "bias_deg": 90, "axis": "x"})
    good = GOOD["attitude"]
    for k in (0, 10, 59):
        expected = (round(1.5 * good[k][0][0]) + 2**30 + 2**31) % TURN - 2**31
        assert made[k] == ((expected, *good[k][0][1:]), 0, True)
    full_turn = flown("attitude", {"kind": "wrong", "bias_deg": 360})
    assert full_turn == good


def test_wrong_rate():
    made = flown("rate", {"kind": "wrong", "bias_degps": 0.1, "scale": -1})
    bias = round(math.radians(0.1) * 2**28)
    assert made[10] == (tuple(-value + bias for value in GOOD["rate"][10][0]), 0, True)
    assert flown("rate", {"kind": "wrong", "scale": 1e6})[10][0] == (2**31 - 1, -(2**31) + 1, 2**31 - 1)


def test_wrong_star_tracker_is_turned_about_a_body_axis():
    made = flown("quaternion", {"kind": "wrong", "bias_deg": 2, "axis": "x"})[10][0]
    angle = 0.1 + math.atan(math.radians(1.0))  # the truth's half angle, and half of 2 deg
    np.testing.assert_allclose(np.array(made) / 2**30, [math.cos(angle), math.sin(angle), 0, 0], atol=2e-9)


def test_slow_holds_and_says_how_old_it_is():
    made = flown("attitude", {"kind": "slow", "at_s": 10, "period_s": 1.2, "for_s": 5})
    taken = [20, 20, 20, 23, 23, 25, 25, 25, 28, 28]  # at 10, 11.2, 12.4, 13.6 s, each at the first tick not before
    assert [made[k] for k in range(20, 30)] == [
        (GOOD["attitude"][since][0], (k - since) * PERIOD_US, True)
        for k, since in zip(range(20, 30), taken, strict=True)
    ]


@pytest.mark.parametrize(("delay_s", "ticks"), [(0.5, 1), (0.7, 2), (3, 6)])
def test_delayed_is_as_old_as_it_says(delay_s, ticks):
    made = flown("quaternion", {"kind": "delayed", "delay_s": delay_s, "at_s": 10})
    assert made[20] == (GOOD["quaternion"][20 - ticks][0], ticks * PERIOD_US, True)
    assert made[59] == (GOOD["quaternion"][59 - ticks][0], ticks * PERIOD_US, True)


def test_delayed_from_the_start_has_nothing_to_say_at_first():
    made = flown("attitude", {"kind": "delayed", "delay_s": 1})
    assert made[0] == made[1] == ((0, 0, 0), 0, False)
    assert made[2] == (GOOD["attitude"][0][0], 2 * PERIOD_US, True)


def test_intermittent_at_times():
    made = flown("attitude", {"kind": "intermittent", "at_s": 10, "on_s": 1.5, "off_s": 1})
    assert [valid for _, _, valid in made.values()] == [True] * 20 + ([True] * 3 + [False] * 2) * 8


def test_intermittent_by_chance():
    fault = {"kind": "intermittent", "fraction": 0.25}
    long = readings(sensor("attitude", fault, ticks=4096), range(4096))
    share = sum(not valid for _, _, valid in long.values()) / 4096
    assert share == pytest.approx(0.25, abs=0.02)
    assert readings(sensor("attitude", fault, ticks=4096), [4000, 7, 256, 255])[7] == long[7]
    assert all(valid for _, _, valid in flown("attitude", {"kind": "intermittent", "fraction": 0}).values())


def test_faults_act_in_the_order_of_the_list():
    bias, delay = {"kind": "wrong", "bias_deg": 10, "at_s": 10}, {"kind": "delayed", "delay_s": 1}
    first, last = flown("attitude", bias, delay), flown("attitude", delay, bias)
    ten = round(10 / 360 * TURN)
    assert first[21][0] == GOOD["attitude"][19][0]  # the reading of tick 19 was right
    assert last[21][0] == tuple(value + ten for value in GOOD["attitude"][19][0])
    assert first[22] == last[22]


def test_what_was_not_valid_is_not_valid_when_it_comes():
    fails, delay = {"kind": "intermittent", "on_s": 1, "off_s": 1}, {"kind": "delayed", "delay_s": 1}
    made = flown("attitude", fails, delay)
    assert not any(valid for _, _, valid in made.values())  # fails now, or failed a second ago


def test_an_age_has_room_on_the_wire():
    made = sensor("attitude", {"kind": "slow", "period_s": 1e6}, ticks=20_000)
    made.read(truth(0), 0)
    assert made.read(truth(0), 10_000).age_us == 2**32 - 1


def test_kinds_are_those_of_the_scenario_and_every_file_is_about_them():
    from sil.scenario_faults import KINDS

    assert tuple(FAULTS) == KINDS
    assert {kind: issubclass(load(FAULTS, "kind", kind), Wrapped) for kind in FAULTS} == dict.fromkeys(FAULTS, True)
    assert sensors.__doc__ and orders([], "", 1.0, PERIOD_US, 1, 0) == []
