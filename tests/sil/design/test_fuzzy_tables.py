"""The exact centroid against the closed form, a fine numeric one and our study's figures for other sets."""

from __future__ import annotations

import numpy as np
import pytest

from sil.design.fuzzy import Triangle, aggregated, centroid, closed_form, half_table, one_input, plane_table, two_inputs

CHECKED = (0, 0.004858, 0.019048, 0.042408, 0.075362, 0.119048, 0.175610, 0.248786, 0.345098, 0.476471, 0.666667)


def test_the_exact_centroid_is_the_closed_form_at_the_studys_check_points() -> None:
    inference = one_input(0.386, 2.5)
    for step, value in enumerate(CHECKED):
        assert -inference(step / 10 * 0.386) / 2.5 == pytest.approx(value, abs=5e-7)
        assert inference(-step / 10 * 0.386) == pytest.approx(2.5 * closed_form(step / 10), abs=1e-14)
    assert inference(9.0) == inference(0.386)


@pytest.mark.parametrize(
    ("sets", "value"), [({"aggregation": "sum"}, 0.0459), ({"outputs": "matlab"}, 0.0259), ({"inputs": "matlab"}, 0.0)]
)
def test_other_sets_of_the_study_at_a_tenth(sets: dict[str, str], value: float) -> None:
    """MATLAB's inputs have a dead zone up to 0.2 E, and no further."""
    assert -one_input(1.0, 1.0, **sets)(0.1) == pytest.approx(value, abs=6e-5)
    if "inputs" in sets:
        assert one_input(1.0, 1.0, **sets)(0.19) == 0.0 > one_input(1.0, 1.0, **sets)(0.25)


@pytest.mark.parametrize("aggregation", ["max", "sum"])
def test_any_union_has_the_centroid_of_a_fine_grid(aggregation: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        fired = [
            (Triangle(p - a, p, p + b), h)
            for p, a, b, h in rng.uniform(0.1, 1.0, (4, 4)) * (1.6, 1, 1, 1) - (0.9, 0, 0, 0)
        ]
        x = np.linspace(-1.0, 1.0, 20001)
        y = np.array(
            [
                np.clip(np.minimum((x - t.left) / (t.peak - t.left), (t.right - x) / (t.right - t.peak)), 0, h)
                for t, h in fired
            ]
        )
        whole = y.max(axis=0) if aggregation == "max" else y.sum(axis=0)
        assert centroid(*aggregated(fired, 1.0, aggregation)) == pytest.approx(
            np.trapezoid(whole * x, x) / np.trapezoid(whole, x), abs=1e-6
        )


def test_the_table_is_as_near_as_the_study_says() -> None:
    table = half_table(one_input(0.5, 1.0))
    a = np.linspace(0.0, 1.0, 4001)
    error = np.max(np.abs(np.interp(a, np.linspace(0, 1, 65), table) - [closed_form(x) for x in a]))
    assert len(table) == 65 and error == pytest.approx(3.1e-4, abs=1e-5)


def test_experiment_1_is_odd_and_gives_a_torque_without_error() -> None:
    """Which is its steady error: the angle is an input of its own."""
    table = plane_table(two_inputs(0.5, 0.4, 1.0), 9)
    np.testing.assert_allclose(table, -table[::-1, ::-1], atol=1e-12)
    assert table[4, 4] == 0.0 and table[4, 8] < -0.1 < 0.1 < table[4, 0]
    corners = table[0, 0], table[0, 4], table[8, 0], table[8, 4]
    assert corners == pytest.approx((0.8333333, 0.5, 0.0, -0.5), abs=1e-6)  # VH, H, N, L
