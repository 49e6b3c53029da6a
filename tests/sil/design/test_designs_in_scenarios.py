"""The compensators in delay-comparison.yaml are those that `sil design` makes, which anybody can make again."""

from __future__ import annotations

import numpy as np
import pytest

from sil.design.discrete import discretised
from sil.design.glover import Shape, glover
from sil.design.linear import StateSpace, state_space
from sil.design.printed import PRINTED
from sil.scenario import load_scenario

LQG = PRINTED["lqg-5.1"]
DESIGNS = {
    "glover": glover(Shape(0.985, 3.78), 0.293).compensator,
    "glover_integral": glover(Shape(0.8, integral=0.03), 0.6).compensator,
    "lqg": state_space(LQG.used.expanded).scaled(1.0 / LQG.inertia),
}


@pytest.mark.parametrize("variant", list(DESIGNS))
def test_a_variants_matrices_are_the_design_by_tustin(variant: str) -> None:
    """Tustin at 0.1 s, as the study's table was made."""
    params = load_scenario("delay-comparison", [f"variant={variant}"]).resolved()["law"]["params"]
    A, B, C = (np.array(params[name], float) for name in "ABC")
    flown = StateSpace(A, B[:, None], C[None], np.array([[params["D"]]]), 0.1)
    omega = np.geomspace(1e-3, 30.0, 60)
    made = discretised(DESIGNS[variant], 0.1, "tustin")
    np.testing.assert_allclose(flown.response(omega), made.response(omega), rtol=1e-8)
