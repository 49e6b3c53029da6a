"""Plants, sensors, actuators: every file is registered, and every entry keeps the contract, new ones unasked."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from protocol.frames import Reading
from sil import actuators, plants, sensors
from sil.actuators import ACTUATORS
from sil.plants import PLANTS
from sil.plugins import UnknownPlugin, load
from sil.scenario import Scenario, load_values
from sil.sensors import SENSORS
from sil.signals import Motion, Plant, Sensor

FOLDERS = [(plants, PLANTS), (sensors, SENSORS), (actuators, ACTUATORS)]
IDS = ["plants", "sensors", "actuators"]
PERIOD_NS = 500_000_000


def scenario(**sections: object) -> Scenario:
    everything_on = {name: {"enabled": True} for name in SENSORS}
    return load_values({"seed": 7, "sensors": everything_on, **sections})


@pytest.fixture(params=sorted(PLANTS))
def plant(request: pytest.FixtureRequest) -> Plant:
    built: Plant = load(PLANTS, "plant.kind", request.param).from_scenario(scenario(plant={"kind": request.param}))
    return built


@pytest.fixture(params=sorted(SENSORS))
def sensor(request: pytest.FixtureRequest) -> Sensor:
    built: Sensor = load(SENSORS, "sensors", request.param).from_scenario(scenario())
    return built


def motion_at(t_ns: int = 0) -> Motion:
    return load(PLANTS, "plant.kind", "rigid").from_scenario(scenario()).motion(t_ns)


@pytest.mark.parametrize(("folder", "registry"), FOLDERS, ids=IDS)
def test_every_file_is_registered_and_every_entry_is_a_file(folder: ModuleType, registry: dict[str, str]) -> None:
    assert folder.__file__ is not None
    others = {"__init__", *getattr(folder, "SUPPORT", ())}
    files = {path.stem for path in Path(folder.__file__).parent.glob("*.py")} - others
    modules = [entry.partition(":")[0] for entry in registry.values()]
    assert sorted(modules) == sorted(f"{folder.__name__}.{file}" for file in files)


@pytest.mark.parametrize(("folder", "registry"), FOLDERS, ids=IDS)
def test_every_entry_loads_and_says_what_it_is(folder: ModuleType, registry: dict[str, str]) -> None:
    for name in registry:
        thing = load(registry, "name", name)
        assert inspect.getdoc(thing)
        assert callable(thing.from_scenario)
        module = importlib.import_module(thing.__module__)
        assert (module.__doc__ or "").strip().count("\n") >= 3, "a plug-in starts with its equations and units"


def test_an_unknown_name_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(UnknownPlugin, match=r"^plant\.kind: expected one of rigid, got 'rgid'$"):
        load(PLANTS, "plant.kind", "rgid")


# -- plants -----------------------------------------------------------------------------------------------------------


def test_motion_has_its_shapes_and_fresh_arrays(plant: Plant) -> None:
    first, second = plant.motion(0), plant.motion(0)
    assert first.t_ns == 0
    for name, size in (("q_BN", 4), ("omega_BN_B", 3), ("momentum_B", 3), ("euler_rad", 3), ("rate_rel", 3)):
        one, other = getattr(first, name), getattr(second, name)
        assert one.shape == (size,)
        assert one.dtype == np.float64
        assert not np.shares_memory(one, other)
        np.testing.assert_array_equal(one, other)
    assert np.linalg.norm(first.q_BN) == pytest.approx(1.0, abs=1e-14)


def test_motion_is_not_touched_by_advance(plant: Plant) -> None:
    motion = plant.motion(0)
    before = [np.array(part) for part in motion[1:]]
    plant.advance(np.full(3, 0.01), 0, PERIOD_NS)
    for part, copy in zip(motion[1:], before, strict=True):
        np.testing.assert_array_equal(part, copy)


def test_two_plants_of_one_scenario_are_the_same_and_independent(plant: Plant) -> None:
    twin = type(plant).from_scenario(scenario())  # type: ignore[attr-defined]
    torque = np.array([0.01, -0.02, 0.03])
    for k in range(5):
        plant.advance(torque, k * PERIOD_NS, PERIOD_NS)
    for k in range(5):
        twin.advance(torque, k * PERIOD_NS, PERIOD_NS)
    for one, other in zip(plant.motion(5 * PERIOD_NS)[1:], twin.motion(5 * PERIOD_NS)[1:], strict=True):
        np.testing.assert_array_equal(one, other)


def test_torque_on_the_body_comes_out_of_the_wheels(plant: Plant) -> None:
    before, torque = plant.motion(0).momentum_B, np.array([0.01, -0.02, 0.03])
    plant.advance(torque, 0, PERIOD_NS)
    np.testing.assert_allclose(plant.motion(PERIOD_NS).momentum_B, before - 0.5 * torque, rtol=0, atol=1e-15)


def test_quaternion_stays_a_unit_and_continuous_in_sign(plant: Plant) -> None:
    last = plant.motion(0).q_BN
    for k in range(400):
        plant.advance(np.array([0.02, 0.01, -0.01]), k * PERIOD_NS, PERIOD_NS)
        q = plant.motion((k + 1) * PERIOD_NS).q_BN
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-14)
        assert q @ last > 0
        last = q


# -- sensors ----------------------------------------------------------------------------------------------------------


def test_sensors_fill_different_readings() -> None:
    bits = [load(SENSORS, "sensors", name).bit for name in SENSORS]
    assert bits == list(range(len(SENSORS))), "the order of the registry is the order of the readings"


def test_reading_is_plain_integers_that_fit_the_wire(sensor: Sensor) -> None:
    reading = sensor.read(motion_at(), 0)
    assert isinstance(reading, Reading)
    assert 0 <= reading.age_us < 2**32
    assert all(type(value) is int and -(2**31) <= value < 2**31 for value in reading.values)
    assert len(reading.values) == (3, 4, 3)[sensor.bit]


NOISY = {
    "attitude": {"enabled": True, "noise_deg": 0.02},
    "quaternion": {"enabled": True, "noise_deg": 0.02},
    "rate": {"enabled": True, "noise_degps": 0.02},
}


@pytest.mark.parametrize("name", sorted(SENSORS))
def test_noise_depends_on_seed_and_tick_never_on_the_order_of_calls(name: str) -> None:
    kind, motion = load(SENSORS, "sensors", name), motion_at()
    forward, backward, other = (kind.from_scenario(scenario(sensors=NOISY, seed=seed)) for seed in (7, 7, 8))
    ticks = [0, 1, 255, 256, 257, 1000, 70_000]
    ahead = {tick: forward.read(motion, tick) for tick in ticks}
    assert {tick: backward.read(motion, tick) for tick in reversed(ticks)} == ahead
    assert len({reading.values for reading in ahead.values()}) == len(ticks)
    assert other.read(motion, 0) != ahead[0]


def test_sensors_do_not_share_noise() -> None:
    """Attitude and rate with the same sigma, seed and tick draw different numbers."""
    motion = motion_at()._replace(euler_rad=np.zeros(3), omega_BN_B=np.zeros(3))
    built = scenario(sensors=NOISY)
    attitude, rate = (
        load(SENSORS, "sensors", name).from_scenario(built).read(motion, 3) for name in ("attitude", "rate")
    )
    scaled = np.array(attitude.values) * 2 * np.pi / 2**32 * 2**28
    assert np.abs(scaled - np.array(rate.values)).max() > 100


# -- actuators --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(ACTUATORS))
def test_actuator_gives_what_it_can_and_hands_out_fresh_arrays(name: str) -> None:
    actuator = load(ACTUATORS, "actuators", name).from_scenario(scenario())
    command, momentum = np.array([0.01, -0.02, 0.0]), np.zeros(3)
    applied = actuator.limit(command, momentum, 0.5)
    assert applied.shape == (3,)
    assert not np.shares_memory(applied, command)
    np.testing.assert_array_equal(applied, command)
