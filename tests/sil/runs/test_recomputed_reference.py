"""The recomputed reference against the recursion in its transfer-function form, wherever it starts or is seeded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from protocol.law_tables import REFERENCE_NONE, REFERENCE_PAPER, REFERENCE_ZOH
from sil.reference import Model, Start, recompute

POLE = math.exp(-0.075)
N = 400
NAN = np.full((N, 3), np.nan)


def setpoints() -> np.ndarray:
    r = np.zeros((N, 3))
    r[100:, 0], r[150:, 1], r[200:250, 2] = 0.4, -0.5, 0.2
    return r


def transfer_function(kind: int, lead: int, r: np.ndarray, y0: np.ndarray) -> np.ndarray:
    """(1 - p q^-1)^2 ym(k+d) = D r(k), with ym = y0 up to d - 1 and r(-1) = r(0): study, section 0."""
    ym = np.zeros((N + 2, 3))
    ym[:lead] = y0
    before = y0
    for k in range(N):
        old = r[max(k - 1, 0)]
        drive = (1 - POLE) ** 2 * ((r[k] + old) / 2 if kind == REFERENCE_ZOH else r[k])
        last = ym[k + lead - 1]
        previous = ym[k + lead - 2] if k + lead >= 2 else before
        if k + lead < N + 2:
            ym[k + lead] = 2 * POLE * last - POLE**2 * previous + drive
    return ym[:N]


def telemetry(ym: np.ndarray, rate: np.ndarray, every: int) -> tuple[np.ndarray, np.ndarray]:
    a, b = NAN.copy(), NAN.copy()
    a[::every], b[::every] = ym[::every], rate[::every]
    return a, b


def model(kind: int, lead: int) -> Model:
    return Model(kind, lead, POLE, math.pi, math.pi)


@pytest.mark.parametrize("kind", [REFERENCE_ZOH, REFERENCE_PAPER])
@pytest.mark.parametrize("lead", [1, 2])
def test_model_start_is_the_transfer_function(kind: int, lead: int) -> None:
    y0 = np.array([0.17, 0.17, 0.08])
    reported = NAN.copy()
    reported[0] = y0
    made = recompute(model(kind, lead), setpoints(), reported, NAN, [Start(0, True)])
    assert np.abs(made - transfer_function(kind, lead, setpoints(), y0)).max() < 1e-12


@pytest.mark.parametrize("kind", [REFERENCE_ZOH, REFERENCE_PAPER])
@pytest.mark.parametrize("lead", [1, 2])
@pytest.mark.parametrize("seed", [1, 2, 3, 7, 120])
def test_sparse_telemetry_seeds_the_same_trajectory(kind: int, lead: int, seed: int) -> None:
    """TELEMETRY every n-th tick: the state (ym, vm) at the seed carries on as if it had been there from the start."""
    y0 = np.array([0.17, 0.17, 0.08])
    reported = NAN.copy()
    reported[0] = y0
    whole = recompute(model(kind, lead), setpoints(), reported, NAN, [Start(0, True)])
    rate = rates(whole, setpoints(), kind, lead)
    sparse, sparse_rate = NAN.copy(), NAN.copy()
    sparse[seed], sparse_rate[seed] = whole[seed], rate[seed]
    made = recompute(model(kind, lead), setpoints(), sparse, sparse_rate, [Start(0, True)])
    assert np.isnan(made[:seed]).all()
    assert np.abs(made[seed:] - whole[seed:]).max() < 1e-9


def rates(ym: np.ndarray, r: np.ndarray, kind: int, lead: int) -> np.ndarray:
    """vm(k) from ym(k), ym(k+1) and the set-point between: ym(k+1) = ym + vm + share (k1 (r - ym) - k2 vm)."""
    k1, k2, share = model(kind, lead).gains
    vm = np.zeros_like(ym)
    for k in range(N - 1):
        drive = k1 * (r[max(k - lead + 1, 0)] - ym[k])
        vm[k] = (ym[k + 1] - ym[k] - share * drive) / (1 - share * k2)
    return vm


@pytest.mark.parametrize("lead", [1, 2])
@pytest.mark.parametrize("rate_found", [0.0, 0.002])
def test_bumpless_start_by_the_law_stands_still_then_goes_on_at_the_rate_it_found(lead: int, rate_found: float) -> None:
    """Starts at rows 0 to 3; after the last one the board reports a trajectory that begins at `rate_found`."""
    still = 3 + lead
    begun = NAN.copy()
    begun[0] = 0.103
    truth = recompute(model(REFERENCE_ZOH, lead), setpoints(), begun, NAN, [Start(0, True)])
    reported, rate = NAN.copy(), np.zeros((N, 3))
    reported[:4] = np.arange(4)[:, None] * 0.001 + 0.1
    reported[4 : still + 1] = 0.103
    reported[still + 1 :] = truth[still + 1 :] + rate_found
    rate[still + 1 :] = rates(truth, setpoints(), REFERENCE_ZOH, lead)[still + 1 :] + rate_found
    starts = [Start(0, True), Start(1, False), Start(2, False), Start(3, False)]
    made = recompute(model(REFERENCE_ZOH, lead), setpoints(), reported, rate, starts)
    assert np.array_equal(made[:4], reported[:4])
    assert (made[3 : still + 1] == made[3]).all()
    assert np.array_equal(made[still + 1], reported[still + 1])
    moved = made[still + 2] - made[still + 1]
    assert np.abs(moved - (truth[still + 2] - truth[still + 1])).max() < 3 * rate_found + 1e-9
    assert (moved > -0.01).all()


def test_limits_hold() -> None:
    limited = Model(REFERENCE_ZOH, 2, POLE, 0.004, 0.0005)
    reported = NAN.copy()
    reported[0] = 0.0
    made = recompute(limited, setpoints(), reported, NAN, [Start(0, True)])
    assert np.abs(np.diff(made, axis=0)).max() <= 0.004 + 1e-15
    assert np.abs(np.diff(made, 2, axis=0)).max() <= 0.0005 + 1e-15
    assert made[-1] == pytest.approx([0.4, -0.5, 0.0], abs=1e-3)


def test_the_way_across_the_turn_is_the_short_one() -> None:
    r = np.full((N, 3), -3.0)
    reported = NAN.copy()
    reported[0] = 3.0
    made = recompute(model(REFERENCE_ZOH, 2), r, reported, NAN, [Start(0, True)])
    assert made[-1] == pytest.approx([2 * math.pi - 3.0] * 3, abs=1e-6)
    assert made.min() >= 3.0 - 1e-12


def test_a_limited_set_point_is_the_ramp() -> None:
    """From what was reported at the start, and anew from what is reported after the law began again."""
    limited = Model(REFERENCE_NONE, 2, POLE, 0.004, math.pi)
    reported = NAN.copy()
    reported[0], reported[300] = (0.1, 0.0, -3.1), (0.0, 0.0, 0.0)
    r = setpoints()
    r[:100, 2] = 3.1
    made = recompute(limited, r, reported, NAN, [Start(0, True), Start(300, False)])
    steps = np.abs((np.diff(made, axis=0) + math.pi) % (2 * math.pi) - math.pi)
    steps[299] = 0.0
    assert steps.max() <= 0.004 + 1e-12
    assert made[30] == pytest.approx([0.0, 0.0, 3.1], abs=1e-15)  # x down, z the short way
    assert made[125, 0] == pytest.approx(26 * 0.004) and made[199, 0] == 0.4
    assert made[350] == pytest.approx([0.2, -0.2, 0.0])


def test_without_model_or_telemetry() -> None:
    r = setpoints()
    assert np.array_equal(recompute(model(REFERENCE_NONE, 1), r, NAN, NAN, []), r)
    assert np.isnan(recompute(model(REFERENCE_ZOH, 2), r, NAN, NAN, [Start(0, True)])).all()
