"""The fixed forms against the float forms, each in its own closed loop, with the same noise and CONFIG values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from law_loop import Case, Trace, run

from firmware_sim.checked import CheckedLaw

INNER = [(profile, noise, bits) for profile in "AB" for noise in (0.0, 0.02) for bits in (24, 32)]
ARITHMETIC = 1 << 3


def both(case: Case) -> tuple[Trace, Trace, float, float]:
    """Float and fixed loop, and their largest difference in attitude (deg) and command (N m)."""
    reference, fixed = run(replace(case, form="float")), run(replace(case, form="fixed"))
    angle = float(np.abs(fixed.attitude - reference.attitude).max())
    return reference, fixed, angle, float(np.abs(fixed.command - reference.command).max())


@pytest.mark.parametrize("gyro", [0, 1])
@pytest.mark.parametrize(("profile", "noise", "bits"), INNER)
def test_appc(profile: str, noise: float, bits: int, gyro: int) -> None:
    _, fixed, angle, torque = both(Case("appc", profile=profile, noise_deg=noise, bits=bits, values={"gyro": gyro}))
    print(f"appc gyro={gyro} {profile} noise {noise} {bits} bit: {angle:.1e} deg, {torque:.1e} N m")
    assert angle <= 1e-4 and torque <= 5e-6
    assert not (fixed.flags & ARITHMETIC).any()


@pytest.mark.parametrize("decouple", [0, 1])
@pytest.mark.parametrize(("profile", "noise", "bits"), INNER)
def test_mrac(profile: str, noise: float, bits: int, decouple: int) -> None:
    _, fixed, angle, torque = both(
        Case("mrac", profile=profile, noise_deg=noise, bits=bits, values={"decouple": decouple, "trace_max": 100.0})
    )
    print(f"mrac decouple={decouple} {profile} noise {noise} {bits} bit: {angle:.1e} deg, {torque:.1e} N m")
    assert angle <= 5e-3
    assert not (fixed.flags & ARITHMETIC).any()


@pytest.mark.parametrize(("profile", "noise", "bits"), INNER)
def test_pd(profile: str, noise: float, bits: int) -> None:
    _, fixed, angle, torque = both(Case("pd", profile=profile, noise_deg=noise, bits=bits))
    print(f"pd {profile} noise {noise} {bits} bit: {angle:.1e} deg, {torque:.1e} N m")
    assert angle <= 1e-4 and torque <= 5e-6
    assert not (fixed.flags & ARITHMETIC).any()


@pytest.mark.parametrize("values", [{}, {"gyro": 1}], ids=["appc", "appc gyro"])
def test_long_regulation_does_not_drift(values: dict[str, Any]) -> None:
    """Two hours at rest with noise: the integer filters neither stick nor walk away."""
    _, fixed, angle, torque = both(Case("appc", profile="B", noise_deg=0.02, bits=24, ticks=14400, values=values))
    assert angle <= 1e-4 and torque <= 5e-6
    assert np.abs(fixed.error[1000:]).max() < 0.2


CHECKED = [
    Case("pd", bits=24, noise_deg=0.02),
    Case("appc", bits=24, noise_deg=0.02, values={"gyro": 1}),
    Case("appc", profile="B", bits=32),
    Case("mrac", bits=24, noise_deg=0.02, values={"decouple": 1}),
    Case("mrac", profile="B", bits=32),
    Case("mrac", bits=24, values={"design": "printed", "reference_kind": "paper"}, wn=0.05, delay=0, profile="B"),
]


@pytest.mark.parametrize("case", CHECKED, ids=lambda case: f"{case.law}-{case.profile}-{case.values}")
def test_checked_mode_never_overflows_and_gives_the_same_numbers(case: Case) -> None:
    """Whole manoeuvres over Python integers: no intermediate beyond int64, no field beyond int32, same commands."""
    compiled = run(replace(case, form="fixed"))
    checked = run(replace(case, form="fixed", swap=CheckedLaw))
    assert np.array_equal(compiled.command, checked.command)
    assert [int(x) for x in compiled.law.state] == list(checked.law.state)
    use = checked.law.register_use()
    print(case.law, {name: f"{share:.2g}" for name, share in use.items()})
    assert max(use.values()) <= 1.0
    assert use["intermediate64"] < 0.9
