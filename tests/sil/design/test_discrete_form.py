"""Discretisation against closed forms, margins of sampled loops against eigenvalues, states that fit fixed point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sil.design.discrete import discretised
from sil.design.glover import Shape, glover
from sil.design.linear import StateSpace, closed_loop, state_space, transfer_function
from sil.design.margins import held, largest_delay, sampled
from sil.design.plants import double_integrator
from sil.design.realisation import bits, fitted
from sil.trouble import UsageError

T = 0.1
GLOVER = glover(Shape(0.8, integral=0.03), 0.6).compensator


def test_zoh_of_lag_and_double_integrator_in_closed_form() -> None:
    lag = discretised(state_space(transfer_function([3.0], [1.0, 3.0])), 0.2, "zoh")
    assert lag.A[0, 0] == pytest.approx(math.exp(-0.6), rel=1e-14)
    assert (lag.C @ lag.B)[0, 0] == pytest.approx(1 - math.exp(-0.6), rel=1e-14)
    whole = discretised(double_integrator(2.0), 0.2, "zoh")
    np.testing.assert_allclose(whole.A, [[1, 0.2], [0, 1]], atol=1e-15)
    np.testing.assert_allclose(whole.B[:, 0], [0.01, 0.1], rtol=1e-13)


@pytest.mark.parametrize("method", ["ramp", "zoh"])
def test_a_pole_far_beyond_the_period_stays_where_it_belongs(method: str) -> None:
    """The study's 14 rad/s at 0.5 s: Tustin puts it at z = -0.56, and refuses."""
    fast = state_space(transfer_function([14.0], [1.0, 14.0]))
    assert discretised(fast, 0.5, method).poles[0] == pytest.approx(math.exp(-7.0))
    with pytest.raises(UsageError, match=r"slower than 2/period = 4 rad/s, got 14"):
        discretised(fast, 0.5, "tustin")


def test_ramp_is_exact_for_straight_lines_between_samples() -> None:
    """Against the same system stepped a thousand times finer."""
    rng = np.random.default_rng(4)
    e = rng.normal(size=40)
    coarse = discretised(GLOVER, T, "ramp")
    fine = discretised(GLOVER, T / 400, "zoh")
    x, z, y, reference = np.zeros(8), np.zeros(8), [], []
    x = -discretised_offset(coarse, e[0])
    for k in range(len(e) - 1):
        y.append((coarse.C @ x)[0] + coarse.D[0, 0] * e[k])
        reference.append((fine.C @ z)[0] + fine.D[0, 0] * e[k])
        x = coarse.A @ x + coarse.B[:, 0] * e[k]
        for i in range(400):
            z = fine.A @ z + fine.B[:, 0] * (e[k] + (e[k + 1] - e[k]) * (i + 0.5) / 400)
    np.testing.assert_allclose(y, reference, atol=2e-5 * np.max(np.abs(reference)))


def discretised_offset(coarse: StateSpace, first: float) -> np.ndarray:
    """z = x - G2 u of the ramp form begins at -G2 u(0) where the states begin at 0; C G2 = D of a strictly proper C."""
    n = GLOVER.order
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n:-1], block[n, n + 1] = GLOVER.A * T, GLOVER.B * T, 1.0
    from scipy.linalg import expm

    G2 = expm(block)[:n, n + 1]
    assert (GLOVER.C @ G2)[0] == pytest.approx(coarse.D[0, 0], rel=1e-12)
    return np.asarray(G2 * first)


@pytest.mark.parametrize("method", ["ramp", "zoh", "tustin"])
@pytest.mark.parametrize("ticks", [0, 1])
def test_the_delay_margin_of_a_sampled_loop_is_where_its_eigenvalues_leave_the_circle(method: str, ticks: int) -> None:
    C, plant = discretised(GLOVER, T, method), double_integrator()
    found = sampled(C, plant, ticks * T)
    assert found.delay_s is not None
    for factor, inside in ((0.999, True), (1.001, False)):
        assert (radius(C, plant, ticks * T + factor * found.delay_s) < 1.0) == inside


@settings(max_examples=15, deadline=None)
@given(kp=st.floats(0.1, 2.0), zeta=st.floats(0.4, 1.2), period=st.floats(0.02, 0.5))
def test_delay_margins_of_sampled_pd_by_eigenvalues(kp: float, zeta: float, period: float) -> None:
    D = np.array([[kp, 2 * zeta * math.sqrt(kp)]])
    C = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), D, period)
    plant = double_integrator(rate_too=True)
    delay = largest_delay(C, plant)
    if delay > 0.0:
        assert radius(C, plant, 0.998 * delay) < 1.0 < radius(C, plant, 1.002 * delay)
    else:
        assert radius(C, plant, 0.0) >= 1.0


def radius(C: StateSpace, plant: StateSpace, delay: float) -> float:
    """Largest |eigenvalue| of the closed loop with the delay as states: an independent way."""
    period = C.period_s
    assert period is not None
    whole, fraction = int(delay / period), delay - int(delay / period) * period
    P = held(plant, period, fraction)
    for _ in range(whole):
        n = P.order
        A = np.block([[P.A, P.B], [np.zeros((1, n + 1))]])
        P = StateSpace(A, np.eye(n + 1)[:, n:], np.hstack([P.C, np.zeros((len(P.C), 1))]), P.D, period)
    return float(np.max(np.abs(np.linalg.eigvals(closed_loop(P, C)))))


# -- states ------------------------------------------------------------------------------------------------------------


def test_fitted_states_give_the_same_response_and_never_leave_one() -> None:
    C = discretised(GLOVER, T)
    F = fitted(C)
    omega = np.geomspace(1e-3, 1.0, 40) * math.pi / T
    np.testing.assert_allclose(F.response(omega), C.response(omega), rtol=1e-4)
    assert F.order < C.order and np.max(np.abs(F.A)) <= 1.0
    impulse, x = [], F.B[:, 0]
    for _ in range(4000):
        impulse.append(np.abs(x[1:]))
        x = F.A @ x
    np.testing.assert_allclose(np.sum(impulse, axis=0) * math.pi, 1.0, rtol=1e-3)
    np.testing.assert_array_equal(F.A[0], np.eye(F.order)[0])  # the integrator is one exactly, on its own


def test_the_bits_it_says_are_needed_are_enough_and_one_less_is_not() -> None:
    F = fitted(discretised(GLOVER, T))
    found = bits(F)
    assert found.fraction_bits is not None
    omega = np.geomspace(1e-3, 1.0, 60) * math.pi / T
    off = []
    for count in (found.fraction_bits, found.fraction_bits - 1):
        A, B, C, D = (np.round(M * 2.0**count) / 2.0**count for M in F[:4])
        off.append(np.max(np.abs(StateSpace(A, B, C, D, T).response(omega) / F.response(omega) - 1)))
    assert off[0] < 1e-3 <= off[1]


def test_a_reduced_order_keeps_the_integrator() -> None:
    C = discretised(GLOVER, T)
    assert np.max(np.abs(fitted(C, 4).poles)) == pytest.approx(1.0, abs=1e-12)
    assert largest_delay(fitted(C, 5), double_integrator()) == pytest.approx(2.06, abs=0.01)
    with pytest.raises(UsageError, match="at least 1, the poles on the unit circle, got 0"):
        fitted(C, 0)
