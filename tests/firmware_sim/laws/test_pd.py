"""pd: rate from the readings or sensed, error of angles or in body axes, periods down to a millisecond; both forms."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from firmware_sim.controllers import inputs, new_law
from firmware_sim.controllers.attitude_error import error_float
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, parse_configuration
from protocol.laws.pd import PD

KP, KD = (0.5, -0.25, 2.0), (0.125, 0.5, 0.0625)
BAM = 2.0 * math.pi / 2**32


def flown(form: str, wire: np.ndarray, **values: object) -> np.ndarray:
    """Torque, N m (ticks, 3), of readings and set-points in wire units."""
    given = {"form": form, "kp": KP, "kd": KD, "reference_kind": "none", "torque_limit": 7.9, "torque_bits": 28}
    configuration = parse_configuration(config_words(PD, given | values))
    is_float = form == "float"
    law, reference = new_law("pd", configuration), Reference(configuration.common, is_float)
    scale = inputs.si_scale(configuration.common) if is_float else np.ones(inputs.SIZE)
    dtype = np.float64 if is_float else np.int64
    out, rows = np.zeros(4, dtype), []
    for row in wire:
        inp = (row * scale).astype(dtype)
        reference.advance(inp)
        law.step(inp, reference.state, out)
        rows.append(out[:3] * (1.0 if is_float else 2.0**-28))
    return np.array(rows)


def readings(period_s: float, ticks: int = 60) -> np.ndarray:
    """A slow turn through large angles, its rate as sensed, a set-point that jumps."""
    wire, t = np.zeros((ticks, inputs.SIZE)), np.arange(ticks) * period_s
    wire[:, :3], wire[:, inputs.TICK] = 1, np.arange(ticks)
    for i, (angle, rate) in enumerate(((2.9, 0.4), (0.7, -0.3), (-3.1, 0.2))):
        wire[:, 3 + i] = np.round((np.remainder(angle + rate * t + math.pi, 2 * math.pi) - math.pi) / BAM)
        wire[:, 10 + i] = round(rate * 2**28)
    wire[ticks // 2 :, inputs.SETPOINT] = np.round(np.array((2.8, 0.9, 3.0)) / BAM)
    return wire


@pytest.mark.parametrize("period_s", [0.001, 0.5])
@pytest.mark.parametrize(("rate", "error", "sequence"), [*product((0, 1), (0, 1), (0, 1))])
def test_it_is_its_equation_in_both_forms(rate: int, error: int, sequence: int, period_s: float) -> None:
    words = {"rate": rate, "error": error, "attitude_sequence": sequence, "period_us": round(period_s * 1e6)}
    wire = readings(period_s)
    y, r = wire[:, inputs.EULER] * BAM, wire[:, inputs.SETPOINT] * BAM
    expected = []
    for k in range(len(wire)):
        e = error_float(error, sequence, tuple(r[k]), tuple(y[k]))
        change = np.array(error_float(error, sequence, tuple(y[k]), tuple(y[k - 1]))) / period_s if k else np.zeros(3)
        w = wire[k, inputs.RATE] * 2.0**-28 if rate else change
        expected.append(np.array(KP) * e - np.array(KD) * w)
    assert flown("float", wire, **words) == pytest.approx(np.array(expected), abs=1e-12)
    coarse = 3e-8 / period_s  # of the difference of two angles of 32 bits
    assert np.abs(flown("fixed", wire, **words) - expected).max() < 1e-7 + (0 if rate else coarse)


@pytest.mark.parametrize("rate_bits", [8, 28, 30])
def test_a_sensed_rate_of_any_scale(rate_bits: int) -> None:
    """Also where kd and the rate together have fewer bits than a torque."""
    wire = readings(0.5, 4)
    wire[:, inputs.RATE] = np.round(np.array((1.5, -0.75, 0.5)) * 2**rate_bits)
    kd = {"kd_bits": 5, "kp": 0, "kd": (3.0, 1.0, 0.5)}
    got = flown("fixed", wire, rate="sensed", rate_bits=rate_bits, **kd)
    assert got == pytest.approx(np.tile((-4.5, 0.75, -0.25), (4, 1)), abs=1e-8)


def test_a_sensed_rate_is_not_looked_at_without_a_reading() -> None:
    wire = readings(0.5, 3)
    wire[2, inputs.FRESH], wire[2, inputs.RATE] = 0, 2**28
    got = flown("fixed", wire, rate="sensed")
    assert (got[2] == got[1]).all()
