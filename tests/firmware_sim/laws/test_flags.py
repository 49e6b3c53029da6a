"""What a law says of itself in COMMAND's flags: starting, at its limit, identification paused, arithmetic limited."""

from __future__ import annotations

import numpy as np
import pytest
from test_lost_samples import Bench

from firmware_sim.controllers import inputs

FORMS = ["float", "fixed"]


@pytest.mark.parametrize("form", FORMS)
def test_appc_starts_with_four_ticks_of_zero_torque(form: str) -> None:
    bench = Bench("appc", form)
    rows = [bench.step(0.1) for _ in range(6)]
    assert [bool(flags & inputs.STARTING) for _, flags in rows] == [True] * 4 + [False] * 2
    assert [torque == 0.0 for torque, _ in rows] == [True] * 4 + [False] * 2


@pytest.mark.parametrize("form", FORMS)
def test_the_reference_restarts_while_appc_starts(form: str) -> None:
    bench = Bench("appc", form)
    restarted = []
    for _ in range(6):
        bench.step(0.1)
        restarted.append(bench.law.reference_restarted)
    assert restarted == [True] * 4 + [False] * 2
    assert not Bench("mrac", form).law.reference_restarted


@pytest.mark.parametrize("form", FORMS)
def test_decoupled_torques_keep_their_direction_at_the_limit(form: str) -> None:
    free, limited = (Bench("mrac", form, decouple=1, torque_limit=limit) for limit in (2.0 - 1e-8, 0.004))
    for bench in (free, limited):
        flags = bench.step(np.array([0.2, 0.1, 0.05]))[1]
    assert flags & inputs.SATURATED
    wanted, given = free.out[:3].astype(float), limited.out[:3].astype(float)
    assert given / np.abs(given).max() == pytest.approx(wanted / np.abs(wanted).max(), abs=1e-5)
    assert np.abs(given).max() * limited.scale[inputs.APPLIED][0] == pytest.approx(0.004, rel=1e-5)


def test_mrac_beyond_its_range_saturates_and_says_so() -> None:
    """Fixed form: attitudes are unwrapped and held to +-8 rad; nothing wraps silently."""
    bench = Bench("mrac", "fixed")
    flagged_at = None
    for k in range(400):
        angle = 0.05 * k
        _, flags = bench.step((angle + np.pi) % (2 * np.pi) - np.pi, applied=0.0)
        unwrapped = bench.field("y")[0] * 2.0**-28
        assert unwrapped == pytest.approx(min(angle, 8.0), abs=1e-6) or flagged_at is not None
        if flags & inputs.ARITHMETIC and flagged_at is None:
            flagged_at = angle
    assert flagged_at == pytest.approx(8.0, abs=0.2)


def test_appc_says_when_a_register_is_full() -> None:
    """Fixed form: readings that jump by half a turn every tick drive the rate estimate to the end of its register."""
    bench = Bench("appc", "fixed", torque_limit=1.0)
    flags = [bench.step(3.0 * (k % 2) - 1.5 + 0.1 * k % 1)[1] for k in range(60)]
    assert any(flag & inputs.ARITHMETIC for flag in flags)
