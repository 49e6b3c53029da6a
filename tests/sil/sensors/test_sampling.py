"""The sensor unit against a model that walks through time microsecond by microsecond, and what a reading says of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.frames import Reading
from sil.checks import check
from sil.instruments import ages, ages_s, sensors_of
from sil.loop import Loop, Scales, Timing
from sil.noise import Gaussian
from sil.plants.rigid import Rigid
from sil.scenario import load_values
from sil.scenario_sampling import Times
from sil.sensors.sampled import Instants, Sampled, instants
from sil.signals import Motion


class Witness:
    """A sensor whose reading is (instant of the truth in us, number of the sample)."""

    bit, valid = 0, True

    def read(self, motion, tick):
        assert motion.t_ns % 1000 == 0
        return Reading(0, (motion.t_ns // 1000, tick, 0))


def truth(t_us):
    return Motion(t_us * 1000, *[np.zeros(3)] * 5)


def flown(unit, tick_us, ticks):
    """Readings at the ticks, with the stops in between that the loop makes."""
    found = []
    for k in range(ticks):
        found.append(unit.read(truth(k * tick_us), k))
        while unit.due_ns < (k + 1) * tick_us * 1000:
            assert unit.due_ns >= k * tick_us * 1000, "an instant behind us"
            unit.observe(truth(unit.due_ns // 1000))
    return found


def walked(times, tick_us, ticks, jitter_us):
    """The same by walking: a sampler, a hold, a delay line or a block that moves every D."""
    period = times.period_us or times.delay_us
    samples = {max(0, i * period + jitter_us(i)): i for i in range(ticks * tick_us // period + 3)}
    held, line, block_in, block_out = 0, {}, 0, 0
    for t in range((ticks - 1) * tick_us + 1):
        held = t if t in samples else held
        line[t] = held
        if times.unit and t % times.delay_us == 0:
            block_out, block_in = block_in, held
        if t % tick_us == 0:
            yield block_out if times.unit else line[max(0, t - times.delay_us)]


@settings(max_examples=300, deadline=None)
@given(
    period_us=st.integers(0, 60), delay_us=st.integers(0, 90), unit=st.booleans(), share=st.floats(0, 0.5),
    tick_us=st.integers(1, 40), seed=st.integers(0, 5),
)  # fmt: skip
def test_as_a_walk_through_time(period_us, delay_us, unit, share, tick_us, seed):
    times = Times(period_us, delay_us, unit and delay_us > 0, 0.0)
    beat_us = times.beat_us(tick_us)
    times = times._replace(jitter_s=share * beat_us * 1e-6)
    when, ticks = instants(times, tick_us, seed, "sensors.attitude.sampling"), 40
    readings = flown(Sampled(Witness(), when), tick_us, ticks)
    moved = Gaussian(seed, "sensors.attitude.sampling", share * beat_us / 3, 1)
    most = times.jitter_s * 1e6

    def jitter_us(i):
        return round(float(np.clip(moved.at(i)[0], -most, most))) if i else 0

    if times.period_us or times.unit:
        expected = list(walked(times, tick_us, ticks, jitter_us))
    else:
        expected = [min(max(0, k * tick_us - delay_us + jitter_us(k)), k * tick_us) for k in range(ticks)]
    assert [reading.values[0] for reading in readings] == expected
    assert [reading.age_us for reading in readings] == [k * tick_us - at_us for k, at_us in enumerate(expected)]
    assert all(reading.values[1] == 0 for reading, at_us in zip(readings, expected, strict=True) if not at_us)


def test_nothing_is_sampled_that_nobody_reads():
    """A 1 ms sensor behind a 100 ms board costs one stop a tick, not a hundred."""
    times = Times(1000, 0, False, 0.0004)
    readings = flown(Sampled(Witness(), Instants(times, 100_000, 0, "x")), 100_000, 50)
    assert len({reading.values[1] for reading in readings}) == 50
    assert all(reading.age_us < 1400 for reading in readings)


def test_jitter_is_gaussian_clipped_and_of_seed_and_sensor_alone():
    times = Times(100_000, 0, False, 0.01)
    moved = np.array([Instants(times, 100_000, 3, "a").at_us(i) - i * 100_000 for i in range(1, 4000)])
    assert 9000 < np.abs(moved).max() <= 10_000
    assert moved.std() == pytest.approx(10_000 / 3, rel=0.04)
    assert abs(moved.mean()) < 200
    one, other, seeded = (Instants(times, 1, seed, name) for seed, name in ((3, "a"), (3, "b"), (4, "a")))
    assert len({each.at_us(7) for each in (one, other, seeded)}) == 3
    assert Instants(times, 999, 3, "a").at_us(7) == one.at_us(7)


@pytest.mark.parametrize(
    ("delay", "ages_s"),
    [
        ("transport", [0, 0.1, 0.2, 0.3, 0.4, 0.4, 0.4, 0.4, 0.4]),
        ("unit", [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.4]),
    ],
)
def test_both_delays_at_the_values_of_the_study(delay, ages_s):
    """Experiment 2: T_s 0.1 s, T_d 0.4 s. Transport: 0.4 s late. Unit delay: 0.4 to 0.7 s, from 0.4 s on."""
    sampling = {"period_s": 0.1, "delay_s": 0.4, "delay": delay}
    made = sensors_of(load_values({"period_s": 0.1, "sensors": {"sampling": sampling}}))
    readings = flown(made.units[0], 100_000, 9)
    assert [reading.age_us / 1e6 for reading in readings] == ages_s


def test_a_held_reading_holds_its_noise():
    sensors = {"attitude": {"noise_deg": 1.0, "sampling": {"period_s": 0.3}}}
    made = sensors_of(load_values({"period_s": 0.1, "duration_s": 6, "seed": 2, "sensors": sensors}))
    readings = flown(made.units[0], 100_000, 60)
    for start in range(0, 60, 3):
        assert readings[start].values == readings[start + 1].values == readings[start + 2].values
    assert len({reading.values for reading in readings}) == 20
    ticks_of_03_s = {"period_s": 0.3, "duration_s": 6, "seed": 2, "sensors": {"attitude": {"noise_deg": 1.0}}}
    ((good,), _) = sensors_of(load_values(ticks_of_03_s))
    assert [reading.values for reading in readings[::3]] == [good.read(truth(0), i).values for i in range(20)]


def test_each_sensor_has_its_own_keys_and_what_is_null_from_all():
    sensors = {
        "sampling": {"period_s": 0.2, "delay_s": 0.4, "jitter_s": 0.01},
        "attitude": {"sampling": {"delay": "unit"}},
        "rate": {"enabled": True, "sampling": {"period_s": 0, "delay_s": 0, "jitter_s": 0}},
    }
    scenario = load_values({"sensors": sensors})
    assert scenario.sensors.times_of("attitude") == Times(200_000, 400_000, True, 0.01)
    assert scenario.sensors.times_of("quaternion") == Times(200_000, 400_000, False, 0.01)
    assert scenario.sensors.times_of("rate").instantaneous
    made = sensors_of(scenario)
    assert [unit.bit for unit in made.units] == [0]
    assert load_values(scenario.resolved()).sensors == scenario.sensors


def test_faults_are_around_the_unit():
    """A stuck sensor that samples: the held value stays, and its age grows as that of the unit does."""
    sensors = {"attitude": {"sampling": {"period_s": 0.3}, "faults": [{"kind": "wrong", "scale": 2, "at_s": 0.2}]}}
    made = sensors_of(load_values({"period_s": 0.1, "duration_s": 6, "sensors": sensors}))
    motion = truth(0)._replace(euler_rad=np.full(3, math.pi / 4))
    values = [made.sensors[0].read(motion._replace(t_ns=k * 100_000_000), k) for k in range(3)]
    assert [value.values[0] for value in values] == [2**29, 2**29, 2**30]
    assert [value.age_us for value in values] == [0, 100_000, 200_000]


@pytest.mark.parametrize(
    ("sampling", "mean_s", "most_s"),
    [
        ({"period_s": 0.1, "delay_s": 0.4}, 0.4, 0.4),
        ({"period_s": 0.1, "delay_s": 0.4, "delay": "unit"}, 0.55, 0.7),  # 4, 5, 6, 7 ticks of 0.1 s
        ({"period_s": 0.3}, 0.1, 0.2),
        ({"delay_s": 0.123}, 0.123, 0.123),
    ],
)
def test_how_old_readings_are(sampling, mean_s, most_s):
    values = {"period_s": 0.1, "sensors": {"sampling": sampling}, "law": {"name": "appc"}}
    scenario = load_values(values)
    assert ages_s(scenario, "attitude") == pytest.approx((mean_s, most_s), abs=2e-4)
    assert [line.split(":")[0] for line in ages(scenario)] == ["sensors.attitude"]


def test_a_law_that_takes_readings_for_fresh_is_warned_of_old_ones():
    def said(name, **sampling):
        found = check(load_values({"sensors": {"sampling": sampling}, "law": {"name": name}}))
        return [str(finding) for finding in found if "sampling" in finding.key]

    (line,) = said("appc", delay_s=0.4)
    assert line.endswith(
        "sensors.sampling.delay_s: expected readings less than half a period old (0.25 s), law appc takes them for "
        "fresh, got 0.4 s on average"
    )
    assert said("appc", delay_s=0.2) == said("pd", delay_s=0.4) == said("appc") == []


# -- in the loop ------------------------------------------------------------------------------------------------------


class Recorded:
    """A board and a recorder in one, for a loop without either."""

    def __init__(self):
        self.samples, self.notices, self.acting = [], [], None

    def __getattr__(self, name):
        return lambda *args, **named: self.samples.append(args[0]) if name == "send" else None


def test_a_unit_sees_the_truth_of_its_instant_and_pieces_add_up():
    """Between ticks the plant is stopped at the instant, exactly: the reading is what a finer run has there."""
    from sil.commands import Acting
    from sil.sensors.attitude import Attitude

    values = {
        "period_s": 0.5, "duration_s": 20, "seed": 9,
        "sensors": {"attitude": {"sampling": {"period_s": 0.13, "delay_s": 0.07, "jitter_s": 0.03}}},
        "plant": {"step_s": 0.01, "initial": {"rate_degps": [1, -2, 3]}},
    }  # fmt: skip
    scenario = load_values(values)
    sensors, units = sensors_of(scenario)
    nobody = Recorded()
    nobody.acting = Acting((0.01, -0.02, 0.03), 0, 0)
    nobody.last_answer_ns = -1

    class Still:
        def limit(self, command, momentum, period_s, tick):
            return command

    loop = Loop(
        Timing(scenario.period_ns, 0, scenario.ticks), Scales(2**-30, 2**-28), Rigid.from_scenario(scenario), Still(),
        sensors, lambda tick: (0, 0, 0), nobody, _Constant(nobody.acting), nobody, _Unpaced(), units=units,
    )  # fmt: skip
    for k in range(scenario.ticks):
        loop.tick(k)
    ages = [sample.readings[0].age_us for sample in nobody.samples]
    assert len(set(ages)) > 20, "instants between the ticks"
    fine = Rigid.from_scenario(scenario)
    good = Attitude(0.0, 0, 0)
    instants, torque, t_ns = {}, np.array(nobody.acting.torque_Nm), 0
    stops = sorted({k * 500_000_000 - age * 1000 for k, age in enumerate(ages)})
    for stop in stops:
        if stop > t_ns:
            fine.advance(torque, t_ns, stop - t_ns)
        t_ns = stop
        instants[stop] = good.read(fine.motion(stop), 0).values
    expected = [instants[k * 500_000_000 - age * 1000] for k, age in enumerate(ages)]
    read = [sample.readings[0].values for sample in nobody.samples]
    assert np.abs(np.array(read) - np.array(expected)).max() < 2**32 / 360 * 1e-7, "1e-7 deg"


class _Constant:
    def __init__(self, acting):
        self.acting, self.notices = acting, []

    def decide(self, due):
        return self.acting


class _Unpaced:
    paced = False


# -- what cannot be ---------------------------------------------------------------------------------------------------


HALF = "a number in s, at most half of"
MICROSECONDS = "a whole number of microseconds, nearest"


@pytest.mark.parametrize(
    ("keys", "key", "expected", "got"),
    [
        ({"period_s": 0.1, "jitter_s": 0.051}, "jitter_s", f"{HALF} period_s (0.05)", "0.051"),
        ({"jitter_s": 0.3}, "jitter_s", f"{HALF} the run's period (0.25)", "0.3"),
        ({"delay": "unit", "delay_s": 0.1, "jitter_s": 0.06}, "jitter_s", f"{HALF} delay_s (0.05)", "0.06"),
        ({"delay": "unit"}, "delay_s", "a number in s above 0 with delay unit", "0.0"),
        ({"period_s": 1e-7}, "period_s", f"{MICROSECONDS} 0.000000 s", "1e-07"),
        ({"delay_s": 0.1234567}, "delay_s", f"{MICROSECONDS} 0.123457 s", "0.1234567"),
        ({"delay_s": -0.1}, "delay_s", "a number in s not below 0", "-0.1"),
        ({"delay": "units"}, "delay", "one of transport, unit (did you mean unit?)", "'units'"),
    ],
)
def test_what_cannot_be_is_one_line_at_the_key_that_says_it(keys, key, expected, got):
    for sensors, path in (({"sampling": keys}, "sensors"), ({"attitude": {"sampling": keys}}, "sensors.attitude")):
        with pytest.raises(ValueError) as refused:
            load_values({"sensors": {**sensors, "rate": {"enabled": True}}})
        line = str(refused.value).removeprefix("recorded scenario: ")
        if key in keys:
            assert line == f"{path}.sampling.{key}: expected {expected}, got {got}"
        else:  # what decides it is the other section's, or a default
            assert line == f"sensors.sampling.{key}: expected {expected}, got {got}"
