"""The reference model: polynomial, float and integer form are one and the same; starts, limits, wrap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmware_sim.checked import rebound
from firmware_sim.controllers import inputs
from firmware_sim.guidance import reference as rf
from protocol.law_tables import config_words, parse_configuration
from protocol.laws.appc import APPC
from protocol.laws.mrac import MRAC
from protocol.laws.pd import PD

DEG = math.pi / 180
BAM = 2 * math.pi / 2**32


def models(**values: object) -> tuple[rf.Reference, rf.Reference]:
    """The float and the fixed reference of one configuration."""
    common = parse_configuration(config_words(PD, values)).common
    return rf.Reference(common, True), rf.Reference(common, False)


def step(model: rf.Reference, is_float: bool, y_deg: float, r_deg: float, fresh: bool = True) -> bool:
    inp = np.zeros(inputs.SIZE)
    inp[inputs.FRESH], inp[inputs.EULER], inp[inputs.SETPOINT] = fresh, y_deg * DEG, r_deg * DEG
    if not is_float:
        inp[3:] = np.round(inp[3:] / BAM)
    return model.advance(inp if is_float else inp.astype(np.int64))


@pytest.mark.parametrize("lead", [1, 2])
@pytest.mark.parametrize("kind", ["zoh", "paper"])
def test_polynomial_float_and_fixed_agree(kind: str, lead: int) -> None:
    real, integer = models(reference_kind=kind, reference_lead=lead, reference_pole=0.93)
    p, y0 = round(0.93 * 2**30) / 2**30, 10.0
    d = (1 - p) ** 2
    ym, before = [y0] * lead, None  # ym(0) .. ym(lead-1) = y(0)
    for k in range(300):
        r = 0.0 if k < 100 else 25.0 if k < 200 else -150.0
        drive = r if kind == "paper" else (r + (r if before is None else before)) / 2
        before = r
        older = ym[-2] if len(ym) > 1 else y0
        ym.append(2 * p * ym[-1] - p * p * older + d * drive)
        assert step(real, True, y0, r) == step(integer, False, y0, r) == (k == 0)
        assert real.state[rf.NOW] / DEG == pytest.approx(ym[k], abs=1e-9)
        for field, index in ((rf.NOW, k), (rf.NEXT, k + 1), (rf.AHEAD, k + 2)):
            if index < len(ym):
                assert real.state[field] / DEG == pytest.approx(ym[index], abs=1e-9)
                assert integer.state[field] * BAM / DEG == pytest.approx(ym[index], abs=4e-7)
    assert real.words() == pytest.approx(integer.words(), abs=2)


def test_a_slow_model_does_not_stick() -> None:
    """200 Hz and wn 0.02 rad/s: one sample moves far less than an LSB near the end, yet it arrives."""
    pole = math.exp(-0.02 * 0.005)
    real, integer = models(reference_pole=pole, period_us=5000)
    for _ in range(200_000):
        step(integer, False, 10.0, 0.0)
        step(real, True, 10.0, 0.0)
    assert abs(real.state[rf.NOW] / DEG) < 1e-6
    assert abs(integer.state[rf.NOW] * BAM / DEG) < 1e-4  # in whole bam per sample it would stop at one degree


def test_nothing_moves_before_the_first_reading() -> None:
    real, integer = models()
    for model, is_float in ((real, True), (integer, False)):
        assert not step(model, is_float, 0.0, 25.0, fresh=False)
        assert not model.state[rf.NOW : rf.LEAD].any()
        assert step(model, is_float, 10.0, 25.0)
        assert not step(model, is_float, 0.0, 25.0, fresh=False)  # later it needs no readings


def test_it_takes_the_short_way_round() -> None:
    real, integer = models()
    for _ in range(400):
        step(real, True, 170.0, -170.0)
        step(integer, False, 170.0, -170.0)
        assert abs(integer.state[rf.NOW] * BAM) > 169 * DEG
    assert integer.state[rf.NOW] * BAM / DEG == pytest.approx(-170.0, abs=1e-5)
    assert real.state[rf.NOW] / DEG == pytest.approx(190.0, abs=1e-5)
    assert real.words() == pytest.approx(integer.words(), abs=2)


def test_rate_and_acceleration_limits() -> None:
    rate, accel = 2_000_000, 100_000
    real, integer = models(rate_limit=rate, accel_limit=accel)
    old, peak = 0, 0
    for _ in range(600):
        step(integer, False, 0.0, 30.0)
        step(real, True, 0.0, 30.0)
        now = int(integer.state[rf.RATE_NOW]) >> 4
        peak = max(peak, now)
        if old:
            assert abs(now - old) <= accel + 1
        old = now
        assert real.state[rf.NOW] == pytest.approx(integer.state[rf.NOW] * BAM, abs=1e-8)
    assert peak == rate
    assert integer.state[rf.NOW] * BAM / DEG == pytest.approx(30.0, abs=1e-5)


def test_reference_none_is_the_set_point() -> None:
    for model, is_float in zip(models(reference_kind="none"), (True, False), strict=True):
        for r in (10.0, -20.0):
            step(model, is_float, 5.0, r)
            assert model.words()[:3] == (round(r / 360 * 2**32),) * 3 and model.words()[3:] == (0, 0, 0)


def test_a_limited_set_point_turns_at_its_rate_and_stops_on_it() -> None:
    """From the first reading, the short way round, each step the limit and the last one what is left."""
    limit = 8_000_000  # 0.67 deg
    real, integer = models(reference_kind="none", rate_limit=limit, accel_limit=1)
    ym, goal = 170.0, -170.0
    for k in range(40):
        assert step(real, True, 170.0, goal) == step(integer, False, 170.0, goal) == (k == 0)
        left = (goal - ym + 180.0) % 360.0 - 180.0
        ym += math.copysign(min(abs(left), limit * BAM / DEG), left)
        for model, unit in ((real, 1.0), (integer, BAM)):
            for field, ahead in ((rf.NOW, 0), (rf.NEXT, 1), (rf.AHEAD, 2)):
                there = min(190.0, ym + ahead * limit * BAM / DEG) if ym <= 190.0 else ym
                off = (model.state[field] * unit / DEG - there + 180.0) % 360.0 - 180.0
                assert abs(off) < 1e-6
        assert real.words() == pytest.approx(integer.words(), abs=2)
    assert real.state[rf.NOW] == goal * DEG and integer.words() == (round(goal / 360 * 2**32),) * 3 + (0,) * 3


def test_a_limited_set_point_says_the_rate_at_which_it_turns() -> None:
    limit = 2_000_000
    real, integer = models(reference_kind="none", rate_limit=limit)
    for model, is_float in ((real, True), (integer, False)):
        step(model, is_float, 0.0, 1.0)
        assert model.words() == (limit,) * 6
        for _ in range(10):
            step(model, is_float, 0.0, 1.0, fresh=False)  # needs no readings
        assert model.words() == (round(1.0 / 360 * 2**32),) * 3 + (0, 0, 0)


def test_checked_mode() -> None:
    """Extreme poles, limits and set-points: no intermediate leaves int64, the published fields fit int32."""
    rng = np.random.default_rng(5)
    for pole in (0.0, 0.5, 0.999999, 1.0):
        for kind, rate in (("zoh", 0), ("paper", 0), ("none", 0), ("none", 1), ("none", 2**30), ("none", 2**31 - 1)):
            values = {"reference_pole": pole, "reference_kind": kind, "rate_limit": rate}
            common = parse_configuration(config_words(MRAC, values)).common
            model = rf.Reference(common, False)
            state, par = model.state.astype(object), np.array(model.par.tolist(), dtype=object)
            advance = rebound(rf.advance_fixed, {})
            for k in range(200):
                inp = np.array([1, 1, 1, *rng.integers(-(2**31), 2**31, 19).tolist(), k], dtype=object)
                advance(state, par, inp)
                model.advance(inp.astype(np.int64))
                assert state.tolist() == model.state.tolist()
                assert all(-(2**31) <= x < 2**31 for x in state[: rf.HEAD])


def test_restart_waits_and_then_leaves_with_its_rate() -> None:
    common = parse_configuration(config_words(APPC, {"reference_pole": 1.0})).common
    model = rf.Reference(common, False)
    step(model, False, 0.0, 0.0)
    rf.restart_fixed(model.state, 0, 1000, 160)
    seen = []
    for _ in range(5):
        step(model, False, 0.0, 0.0)
        seen.append(int(model.state[rf.NOW]))
    assert seen == [1000, 1000, 1010, 1020, 1030]
