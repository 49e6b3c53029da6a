"""appc learns from the wheels' momentum what torque acted while no SAMPLE came: as if it had been told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from law_loop import Case

from firmware_sim.controllers import inputs, new_law
from firmware_sim.controllers.appc_observer import GAP, H, V, Y
from firmware_sim.guidance.reference import Reference

FORMS = ["float", "fixed"]
HELD = np.array([0.03, -0.02, 0.01])  # N m, acts in the whole gap
UNIT = {"float": (1.0, 1.0, 1.0), "fixed": (np.pi / 2**31, np.pi / 2**35, 2.0**-28)}  # y rad, v rad/sample, N m


class Gap:
    """A law that is told all for 40 ticks, then hears nothing for `lost` ticks, then the next SAMPLE comes."""

    def __init__(self, form: str, lost: int, told: bool = False, momentum: float = 0.05, **values: Any) -> None:
        self.configuration = Case("appc", form, values=values).configuration()
        self.is_float, self.k, self.good = form == "float", 0, 0
        self.scale = inputs.si_scale(self.configuration.common)
        self.law: Any = new_law("appc", self.configuration)
        self.reference = Reference(self.configuration.common, self.is_float)
        dtype = np.float64 if self.is_float else np.int64
        self.inp, self.out = np.zeros(inputs.SIZE, dtype), np.zeros(4, dtype)
        self.momentum = np.full(3, momentum)
        self.step(True, True, np.zeros(3))
        for _ in range(39):
            self.step(True, True, np.array([0.001, 0.002, -0.001]))
        for _ in range(lost):
            self.step(False, told, HELD)
        self.before = self.law.state.copy()
        self.step(True, True, np.zeros(3))

    def step(self, fresh: bool, known: bool, applied: np.ndarray) -> None:
        """`applied` acts from now on and shows in the next tick's momentum."""
        si = np.zeros(inputs.SIZE)
        self.good = self.good + 1 if fresh else 0
        si[[inputs.FRESH, inputs.GOOD_RUN, inputs.APPLIED_KNOWN, inputs.TICK]] = fresh, self.good, known, self.k
        si[inputs.EULER] = 0.2, -0.3, 0.1
        si[inputs.APPLIED], si[inputs.MOMENTUM] = applied, np.clip(self.momentum, -7.999999998, 7.999999997)
        self.inp[:] = np.round(si / self.scale) * (self.scale if self.is_float else 1)
        self.reference.advance(self.inp)
        self.law.step(self.inp, self.reference.state, self.out)
        self.momentum = self.momentum - applied * 0.5
        self.k += 1

    def observed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y^ rad, v^ rad/sample and u(k-1) N m after the SAMPLE."""
        y, v, u = UNIT["float" if self.is_float else "fixed"]
        fields = (self.law.field("y") * y, self.law.field("v") * v, self.law.field("applied_before") * u)
        return fields[0], fields[1], fields[2]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("lost", [1, 2])
def test_a_gap_ends_as_if_its_torque_had_been_told(form: str, lost: int) -> None:
    """After one lost SAMPLE it is all recovered, after two the sum of both errors."""
    told, guessed = Gap(form, lost, told=True), Gap(form, lost)
    blind = Gap(form, lost, recover_torque=False)
    for i in range(3):  # y, v, u(k-1)
        expected = told.observed()[i]
        off, left = np.abs(blind.observed()[i] - expected).max(), np.abs(guessed.observed()[i] - expected).max()
        print(form, lost, i, f"{off:.2e} without, {left:.2e} with")
        assert left < (0.01 if lost == 1 else 0.5) * off


@pytest.mark.parametrize("form", FORMS)
def test_only_differences_of_the_momentum_count(form: str) -> None:
    """And its sign or size at the start do not."""
    at_rest, turning = Gap(form, 3, momentum=0.0), Gap(form, 3, momentum=-3.0)
    for one, other in zip(at_rest.observed(), turning.observed(), strict=True):
        assert one == pytest.approx(other, abs=2e-8)


@pytest.mark.parametrize("form", FORMS)
def test_a_momentum_at_the_end_of_its_scale_is_not_believed(form: str) -> None:
    """It stands still there while torque acts."""
    blind, wheels = Gap(form, 3, momentum=20.0, recover_torque=False), Gap(form, 3, momentum=20.0)
    assert (blind.law.state == wheels.law.state).all()
    believed = Gap(form, 3, momentum=7.0)
    assert (believed.law.state[Y : Y + 3] != wheels.law.state[Y : Y + 3]).all()


@pytest.mark.parametrize("form", FORMS)
def test_without_losses_nothing_is_recovered(form: str) -> None:
    """Not even what rounding of the momentum leaves."""
    on, off = Gap(form, 0), Gap(form, 0, recover_torque=False)
    assert (on.law.state == off.law.state).all()
    assert on.law.state[GAP] == 0


@pytest.mark.parametrize("form", FORMS)
def test_a_reading_that_is_no_sample_recovers_nothing(form: str) -> None:
    """With `stale: reuse` a reading passes for this tick's, but the momentum is the old one."""
    gap = Gap(form, 2)
    states = []
    for recover in (True, False):
        bench = Gap(form, 2, recover_torque=recover)
        bench.law.state[:] = gap.before
        bench.step(True, False, np.zeros(3))
        states.append(bench.law.state.copy())
    assert (states[0][[*range(Y, Y + 3), *range(V, V + 3), *range(H, H + 3)]]
            == states[1][[*range(Y, Y + 3), *range(V, V + 3), *range(H, H + 3)]]).all()  # fmt: skip
