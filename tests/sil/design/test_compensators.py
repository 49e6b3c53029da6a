"""LQG and loop shaping against what is known in closed form, the paper's printed digits and our study's table 1.1."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sil.design.glover import Shape, glover, robust
from sil.design.linear import StateSpace, closed_loop, series, state_space, transfer_function
from sil.design.lqg import Weights, lqg, observer, regulator
from sil.design.margins import Margins, continuous, largest_delay
from sil.design.plants import double_integrator, pade
from sil.design.printed import PRINTED
from sil.design.sheet import loop_of, of_printed, written
from sil.trouble import UsageError


def poles(A: np.ndarray) -> list[complex]:
    return sorted(np.linalg.eigvals(A), key=lambda pole: (round(pole.real, 6), pole.imag))


def test_regulator_and_observer_of_a_double_integrator_are_butterworth_pairs() -> None:
    """K = [wc^2, sqrt(2) wc], L = [sqrt(2) wo, wo^2]: the textbook's."""
    plant = double_integrator()
    K = regulator(plant, np.diag([1.0, 0.0]), 0.7**-4)
    L = observer(plant, np.diag([0.0, 3.0**4]), 1.0)
    np.testing.assert_allclose(K, [[0.49, math.sqrt(2) * 0.7]], rtol=1e-9)
    np.testing.assert_allclose(L[:, 0], [math.sqrt(2) * 3.0, 9.0], rtol=1e-9)
    closed = poles(closed_loop(plant, lqg(Weights(0.7, 3.0))))
    r = math.sqrt(0.5)
    np.testing.assert_allclose(
        closed, [3 * complex(-r, -r), 3 * complex(-r, r), 0.7 * complex(-r, -r), 0.7 * complex(-r, r)], rtol=1e-6
    )


def test_integral_action_and_delay_end_up_in_the_compensator() -> None:
    C = lqg(Weights(0.3, 2.0, 0.5), 0.4, 2)
    assert C.order == 5
    assert np.min(np.abs(C.poles)) < 1e-9  # it has an integrator
    behind = series(state_space(pade(0.4, 2)), double_integrator())
    assert np.all(np.linalg.eigvals(closed_loop(behind, C)).real < 0.0)


@pytest.mark.parametrize("rate", [1e-5, 1e-3, 1e3])
def test_a_slow_design_is_a_fast_one_in_another_unit_of_time(rate: float) -> None:
    """C(s) = rate^2 C1(s / rate). Solved in seconds the LQG of 1e-3 rad/s had poles 20 % off, and nobody was told."""
    omega = np.geomspace(0.01, 30.0, 50)
    for made, unit in (
        (lqg(Weights(0.5 * rate, 2.0 * rate, 0.1 * rate), 0.4 / rate, 4), lqg(Weights(0.5, 2.0, 0.1), 0.4, 4)),
        (
            glover(Shape(0.5 * rate, 4.0, 8.0, 0.02 * rate), 0.4 / rate, 4).compensator,
            glover(Shape(0.5, 4.0, 8.0, 0.02), 0.4, 4).compensator,
        ),
    ):
        ratio = made.response(rate * omega) / (rate**2 * unit.response(omega))
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-7)


def test_a_delay_that_is_none_and_a_factor_without_margin_are_refused() -> None:
    with pytest.raises(UsageError, match=r"delay: expected 0, or at least 0.001 s beside these rates, got 1e-06"):
        lqg(Weights(0.5, 2.0), 1e-6)
    for factor in (1.0, float("nan"), float("inf")):
        with pytest.raises(UsageError, match=f"gamma: expected 1.0001 to 100 times the least.*got {factor}"):
            glover(Shape(0.5), factor=factor)


@pytest.mark.parametrize(("name", "J", "digits"), [("lqg-5.1", 0.01, 1e-5), ("lqg-5.3", 400.0, 1e-3)])
def test_the_papers_lqg_is_ours_with_the_same_weights_for_both_satellites(name: str, J: float, digits: float) -> None:
    """Gain to `digits`, time constants to the two digits that are printed."""
    C = lqg(Weights(math.sqrt(1e-3 / J), math.sqrt(1.0 / J), 1.0)).scaled(J)
    given = PRINTED[name].given
    numbers = [
        float(word)
        for word in written(C).replace("(", " ").replace(")", " ").split()
        if word[:1].isdigit() and word != "1"
    ]
    gain, a, b, c, d = [number for number in numbers if number != 1.0]
    assert gain == pytest.approx(given.gain, rel=digits)
    assert [float(f"{each:.2g}") for each in (a, b, c, d)] == [*given.above[0], *given.below[0]]


@pytest.mark.parametrize("gain", [1.0, 0.04])
def test_gamma_min_of_a_double_integrator_is_known(gain: float) -> None:
    """X = Z = [[sqrt 2, 1], [1, sqrt 2]] for gain 1; a gain is a change of the unit of time."""
    plant = double_integrator(1.0 / gain)
    K, least = robust(plant, 1.2)
    assert least == pytest.approx(math.sqrt(4.0 + 2.0 * math.sqrt(2.0)), rel=1e-9)
    assert np.all(np.linalg.eigvals(closed_loop(plant, K)).real < 0.0)


def test_the_loop_of_glover_is_as_robust_as_gamma_says() -> None:
    """||[K; 1] (1 + Gs K)^-1 M^-1|| <= gamma, as the four-block norm over frequency: what gamma means."""
    found = glover(Shape(0.985, 3.78), 0.293, 2, 1.1)
    omega = np.geomspace(1e-3, 1e3, 4000)
    Ws = found.weight(1j * omega)
    G = double_integrator().response(omega)[:, 0, 0] * pade(0.293, 2)(1j * omega) * Ws
    K = found.compensator.response(omega)[:, 0, 0] / Ws
    norm = np.sqrt((1 + np.abs(K) ** 2) * (1 + np.abs(G) ** 2)) / np.abs(1 + G * K)
    assert found.gamma_min < np.max(norm) <= found.gamma * (1 + 1e-6)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_pade_is_all_pass_and_agrees_with_the_delay_to_its_order(order: int) -> None:
    P = pade(0.3, order)
    assert np.abs(P(1j * np.geomspace(0.01, 100, 9))) == pytest.approx(1.0, abs=1e-12)
    error = [abs(P(1j * w) - np.exp(-0.3j * w)) for w in (0.5, 1.0)]
    assert math.log2(error[1] / error[0]) == pytest.approx(2 * order + 1, abs=0.05)


# -- our study ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "gain", "crossover", "phase", "delay", "down"),
    [
        ("pd-1", 1, 200, 89.9, 0.00784, None),
        ("pd-2", 1, 2.06, 76.4, 0.647, None),
        ("lqg-5.1", 1, 1.26, 63.6, 0.88, 0.149),
        ("ls-5.2", 1, 0.246, 88, 6.3, None),
        ("lqg-5.3", 1, 0.068, 58.7, 15, 0.0164),
        ("ls-5.4", 1, 0.81, 84, 1.8, None),
    ],
)  # fmt: skip
def test_margins_of_table_1_1(
    name: str, gain: float, crossover: float, phase: float, delay: float, down: float | None
) -> None:
    found = of_printed(name, None, gain, None).margins["continuous"]
    assert found.stable
    assert found.crossover_radps == pytest.approx(crossover, rel=6e-3)
    assert found.phase_deg == pytest.approx(phase, abs=0.2)
    assert found.delay_s == pytest.approx(delay, rel=1e-2)
    assert found.gain_down == (None if down is None else pytest.approx(down, rel=5e-3))
    assert found.drifts == name.startswith("ls")


@pytest.mark.parametrize(("name", "gain"), [("lqg-5.1", 0.01), ("lqg-5.3", 100.0), ("ls-5.4", 100.0)])
def test_rejected_readings_of_table_1_1_are_unstable(name: str, gain: float) -> None:
    sheet = of_printed(name, None, gain, None)
    assert sheet.margins["continuous"] == Margins(False)
    assert not sheet.stable


@pytest.mark.parametrize("name", sorted(set(PRINTED) - {"lqg-5.3-repaired", "ls-5.4-repaired"}))
def test_what_is_cancelled_does_not_matter(name: str) -> None:
    s = 1j * np.geomspace(1e-2, 1e2, 50)
    np.testing.assert_allclose(
        PRINTED[name].used.expanded(s), PRINTED[name].given.expanded(s), rtol=1e-4
    )  # above 0.01 rad/s


def on_grid(delay: float) -> float:
    """The study tried sensor delays of 0, 0.02, 0.04 s ..."""
    return math.floor(delay / 0.02) * 0.02


@pytest.mark.parametrize(
    ("shape", "delay", "published"), [(Shape(0.985, 3.78), 0.293, 1.50), (Shape(0.8, integral=0.03), 0.6, 2.04)]
)
def test_glovers_delay_margins_of_the_study(shape: Shape, delay: float, published: float) -> None:
    from sil.design.discrete import discretised

    C = glover(shape, delay).compensator
    assert on_grid(largest_delay(discretised(C, 0.1, "tustin"), double_integrator())) == pytest.approx(published)


@pytest.mark.parametrize(
    ("kp", "kd", "published"), [(0.983**2, 2 * 0.983 * 0.739, 0.68), (1.0, 2.0, 0.58)], ids=["tuned", "(1, 2)"]
)
def test_pds_delay_margins_of_the_study(kp: float, kd: float, published: float) -> None:
    pd = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.array([[kp, kd]]), 0.1)
    assert on_grid(largest_delay(pd, double_integrator(rate_too=True))) == pytest.approx(published)


# -- margins -----------------------------------------------------------------------------------------------------------


def test_margins_of_a_loop_in_closed_form() -> None:
    """L = k / (s (s + 1)^2): it crosses -180 deg at 1 rad/s with k / 2."""
    k = 0.5
    loop = state_space(transfer_function([k], [1.0, 2.0, 1.0, 0.0]))
    found = continuous(loop)
    assert found.gain_up == pytest.approx(4.0, rel=1e-6)
    assert found.gain_down is None
    w = found.crossover_radps
    assert w is not None and found.phase_deg is not None
    assert w * (w * w + 1) == pytest.approx(k, rel=1e-9)
    assert found.phase_deg == pytest.approx(90 - 2 * math.degrees(math.atan(w)), rel=1e-9)
    assert found.delay_s == pytest.approx(math.radians(found.phase_deg) / w, rel=1e-9)
    late = continuous(loop, 0.9 * found.delay_s)
    assert late.stable and late.delay_s == pytest.approx(0.1 * found.delay_s, rel=1e-6)
    assert not continuous(loop, 1.01 * found.delay_s).stable


def test_wrong_names_are_told_with_those_there_are() -> None:
    with pytest.raises(UsageError, match=r"one of pd-1.*got lqg-6"):
        of_printed("lqg-6", None, 1.0, None)
    assert loop_of(PRINTED["pd-2"].used.expanded).order == 2
