"""What every registered law owes the board, in both forms; a new law is held to it unasked."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import firmware_sim.controllers
import protocol.laws
from firmware_sim import jit
from firmware_sim.checked import CheckedLaw
from firmware_sim.controllers import LAWS, SUPPORT, LawRefuses, inputs, new_law
from firmware_sim.controllers.compiled import CompiledLaw
from firmware_sim.guidance.reference import Reference
from protocol.frames import MAX_TELEMETRY_WORDS
from protocol.law_tables import COMMON, TELEMETRY_COMMON, config_words, law_by_name, parse_configuration, refusal
from protocol.laws import IN_C

FORMS = ("fixed", "float")
FOLDER = Path(firmware_sim.controllers.__file__).parent
BODY = {"error": "quaternion", "attitude_sequence": "123"}
VARIANTS = {
    "pd": ({}, {"rate": "sensed"}, BODY),
    "mrac": ({}, {"decouple": 1}, {"design": "printed"}),
    "appc": ({}, {"gyro": 1}, {"adapt": 0}),
    "state_space": ({}, {"error": "euler", "anti_windup": 1, "A": [[1.0]], "B": [0.1], "C": [0.05], "D": 0.1}),
}
FLOAT_ONLY = {table.name for table in protocol.laws.tables() if table.float_only}
FORMS_OF = [(name, form) for name in LAWS for form in FORMS if form == "float" or name not in FLOAT_ONLY]
IN_FIXED = [name for name in LAWS if name not in FLOAT_ONLY]
EACH = [(name, form, values) for name, form in FORMS_OF for values in VARIANTS.get(name, ({},))]
each = pytest.mark.parametrize(("name", "form", "values"), EACH, ids=lambda value: str(value))


class Rig:
    """A law, its reference and its arrays, stepped with numbers as the board would."""

    def __init__(self, name: str, form: str, values: dict[str, object], **more: object) -> None:
        given = {"form": form, "torque_limit": 0.1} | values | more
        self.configuration = parse_configuration(config_words(law_by_name(name), given))
        self.is_float = form == "float"
        self.scale = inputs.si_scale(self.configuration.common) if self.is_float else np.ones(inputs.SIZE)
        dtype = np.float64 if self.is_float else np.int64
        self.law = new_law(name, self.configuration)
        self.reference = Reference(self.configuration.common, self.is_float)
        self.inp, self.out = np.zeros(inputs.SIZE, dtype), np.zeros(4, dtype)

    def step(self, wire: np.ndarray) -> list[float]:
        self.inp[:] = wire * self.scale
        self.reference.advance(self.inp)
        self.law.step(self.inp, self.reference.state, self.out)
        return self.out.tolist()


def flight(ticks: int, seed: int, loss: float = 0.05) -> np.ndarray:
    """Inputs in wire units (ticks, SIZE): slow turns with noise, random set-points, torques, losses."""
    rng = np.random.default_rng(seed)
    wire = np.zeros((ticks, inputs.SIZE))
    t = np.arange(ticks) * 0.5
    for axis in range(3):
        period, phase = rng.uniform(60, 300), rng.uniform(0, 6)
        turn = rng.uniform(0.05, 0.2) * np.sin(2 * math.pi * t / period + phase) + rng.normal(0, 5e-5, ticks)
        wire[:, 3 + axis] = np.round(turn * 2**32)
        wire[:, 10 + axis] = np.round(np.gradient(turn) * 4 * math.pi * 2**28)
        wire[:, 19 + axis] = np.round(np.repeat(rng.uniform(-0.2, 0.2, ticks // 100 + 1), 100)[:ticks] * 2**32)
        wire[:, 13 + axis] = np.round(rng.uniform(-0.1, 0.1, ticks) * 2**30)
        wire[:, 16 + axis] = np.round(0.2 * np.sin(t / 50) * 2**28)
    fresh = rng.random(ticks) >= loss
    good = 0
    for k in range(ticks):
        good = good + 1 if fresh[k] else 0
        wire[k, :3], wire[k, 22] = (fresh[k], good, fresh[k]), k
        if not fresh[k] and k:
            wire[k, 3:19] = wire[k - 1, 3:19]
    return wire


def test_every_file_is_registered_or_support() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - {"__init__"}
    registered = {spec.partition(":")[0].rpartition(".")[2] for spec in LAWS.values()}
    assert files == registered | set(SUPPORT)


def test_every_law_has_its_words_under_its_name() -> None:
    """And every file of words is registered; what the firmware is said to have is among them."""
    files = {path.stem for path in Path(protocol.laws.__file__).parent.glob("*.py")} - {"__init__"}
    modules = {spec.partition(":")[0].rpartition(".")[2] for spec in protocol.laws.LAWS.values()}
    assert files == modules
    assert set(protocol.laws.LAWS) == set(LAWS) == {table.name for table in protocol.laws.tables()}
    assert set(IN_C) <= set(LAWS)


def test_laws_are_imported_only_when_named() -> None:
    import subprocess
    import sys

    code = (
        "import sys; from firmware_sim.controllers import LAWS;"
        " print([entry for entry in LAWS.values() if entry.split(':')[0] in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@each
def test_deterministic(name: str, form: str, values: dict[str, object]) -> None:
    wire = flight(300, 1)
    first, second = Rig(name, form, values), Rig(name, form, values)
    assert [first.step(row) for row in wire] == [second.step(row) for row in wire]
    assert first.law.telemetry() == second.law.telemetry()


@each
def test_stays_within_the_torque_limit_and_says_so(name: str, form: str, values: dict[str, object]) -> None:
    rig = Rig(name, form, values, torque_limit=0.001)
    limit = rig.configuration.common["torque_limit_x"]
    if rig.is_float:
        limit = rig.configuration.values["torque_limit_x"]
    rows = np.array([rig.step(row) for row in flight(400, 2)])
    assert np.abs(rows[:, :3]).max() <= limit
    at_limit = np.isclose(np.abs(rows[:, :3]).max(axis=1), limit, rtol=1e-5)
    saturated = rows[:, 3].astype(int) & inputs.SATURATED != 0
    assert name == "pd" or at_limit.any()
    assert not (saturated & ~at_limit).any()


@each
def test_ten_thousand_realistic_steps_keep_every_range(name: str, form: str, values: dict[str, object]) -> None:
    """Nothing grows without bound, telemetry stays within its table, state within its registers."""
    rig = Rig(name, form, values)
    table = law_by_name(name).telemetry
    low = np.array([word.minimum * 2.0 ** int(word.q) for word in table]) - 1
    high = np.array([word.maximum * 2.0 ** int(word.q) for word in table]) + 1
    for k, row in enumerate(flight(10_000, 3)):
        out = rig.step(row)
        assert all(math.isfinite(x) for x in out)
        if k % 10 == 0:
            words = np.array(rig.law.telemetry())
            assert words.shape == low.shape and (low <= words).all() and (words <= high).all()
    assert np.isfinite(rig.law.state.astype(float)).all()
    if not rig.is_float:
        for field in rig.law.STATE:
            assert np.abs(rig.law.field(field.name)).max() < 2 ** (field.width - 1) + 1


@each
def test_a_long_loss_does_not_blow_up(name: str, form: str, values: dict[str, object]) -> None:
    rig, wire = Rig(name, form, values), flight(200, 4, loss=0.0)
    for row in wire:
        rig.step(row)
    for k in range(1000):
        row = wire[-1].copy()
        row[:3], row[22] = 0, 200 + k
        out = rig.step(row)
        assert all(math.isfinite(x) for x in out)
    assert np.isfinite(rig.law.state.astype(float)).all()
    assert all(math.isfinite(x) for x in rig.step(wire[-1]))


@each
def test_warm_up_leaves_everything_as_it_was(name: str, form: str, values: dict[str, object]) -> None:
    rig = Rig(name, form, values)
    for row in flight(30, 5):
        rig.step(row)
    arrays = (rig.law.state, rig.reference.state, rig.inp, rig.out)
    before = [array.copy() for array in arrays]
    rig.law.warm_up(rig.inp, rig.reference.state, rig.out)
    assert all(np.array_equal(a, b) for a, b in zip(arrays, before, strict=True))


@each
def test_a_law_starts_anew_with_every_instance(name: str, form: str, values: dict[str, object]) -> None:
    wire = flight(50, 6)
    first = Rig(name, form, values)
    rows = [first.step(row) for row in wire]
    fresh = Rig(name, form, values)
    assert [fresh.step(row) for row in wire] == rows


@pytest.mark.parametrize("name", LAWS)
def test_tables_fit_the_frames_and_the_interface(name: str) -> None:
    table = law_by_name(name)
    assert len(TELEMETRY_COMMON) + len(table.telemetry) <= MAX_TELEMETRY_WORDS
    law = Rig(name, "float" if name in FLOAT_ONLY else "fixed", {}).law
    assert isinstance(law, CompiledLaw) and law.has_model == table.has_model
    assert len(law.telemetry()) == len(table.telemetry)
    assert all(field.width in (32, 64) and field.length > 0 for field in law.STATE)
    assert len({field.name for field in law.STATE}) == len(law.STATE)


@pytest.mark.parametrize("name", sorted(FLOAT_ONLY))
def test_a_law_without_a_fixed_form_says_so(name: str) -> None:
    configuration = parse_configuration(config_words(law_by_name(name), {"form": "fixed"}))
    with pytest.raises(LawRefuses, match=f"law {name}: expected form float, got fixed"):
        new_law(name, configuration)


@pytest.mark.parametrize(("name", "form"), FORMS_OF)
def test_what_a_law_cannot_fly_it_refuses(name: str, form: str) -> None:
    table = law_by_name(name)
    for n in range(5):
        words = config_words(table, {"form": form, "transport_delay_ticks": n})
        allowed = n in table.variant(parse_configuration(words).values).transport_delays
        assert (refusal(parse_configuration(words)) is None) == allowed
        if not allowed:
            with pytest.raises(LawRefuses, match="transport_delay_ticks"):
                new_law(name, parse_configuration(words))
    shortest = next(word.minimum for word in COMMON if word.name == "period_us")
    for period_s in (max(table.period_s[0] * 0.5, shortest * 1e-6), table.period_s[1] * 2):
        if period_s == table.period_s[0]:
            continue  # no CONFIG can ask for less
        configuration = parse_configuration(config_words(table, {"form": form, "period_us": round(period_s * 1e6)}))
        with pytest.raises(LawRefuses, match="period_s"):
            new_law(name, configuration)


WILD = np.array([-(2**31), 2**31 - 1, 0, 1, -1, 2**30, -(2**30), 12345, -(2**20)])


@pytest.mark.parametrize("values", [{}, {"torque_bits": 20, "torque_limit": math.inf}], ids=["limited", "unlimited"])
@pytest.mark.parametrize("name", IN_FIXED)
def test_no_input_whatever_overflows_a_register(name: str, values: dict[str, object]) -> None:
    """Checked mode under inputs no sensor would give: numbers saturate and are flagged, none wraps, and the compiled
    code gives the same bits."""
    rng = np.random.default_rng(8)
    for variant in VARIANTS.get(name, ({},)):
        rig, twin = Rig(name, "fixed", variant | values), Rig(name, "fixed", variant | values)
        checked = CheckedLaw(rig.law)
        for k in range(150):
            wire = np.concatenate([[1, k + 1, k % 3 > 0], rng.choice(WILD, 19), [k]])
            if k % 2:
                wire[3:22] = rng.integers(-(2**31), 2**31, 19)
            rows = twin.step(wire)
            rig.reference.advance(twin.inp)
            checked.step(twin.inp, rig.reference.state, rig.out)
            assert rig.out.tolist() == rows
        assert max(checked.register_use().values()) <= 1.0


def test_source_hash_covers_every_source() -> None:
    """An edit anywhere in firmware_sim starts an empty cache: numba itself looks at one file only."""
    assert jit.source_hash() in str(jit.cache_directory())
    assert "site-packages" not in str(jit.cache_directory())
