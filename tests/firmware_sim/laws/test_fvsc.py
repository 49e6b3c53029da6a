"""fvsc, vsc, ifvsc: the fuzzy closed form against a numeric Mamdani inference, the sign of S, the law's equation."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from firmware_sim.checked import rebound
from firmware_sim.controllers import inputs, new_law
from firmware_sim.controllers.fuzzy import closed_fixed, closed_float, table_fixed, table_float
from firmware_sim.controllers.fvsc import sign_fixed
from firmware_sim.guidance.reference import Reference
from protocol.law_tables import config_words, law_by_name, parse_configuration
from protocol.laws.fvsc import DEFAULT_TABLE

Q15 = 2.0**-15
BAM = 2.0 * math.pi / 2**32
# Study of paper 000, section 3.1, a = 0, .1 .. 1.
CHECKED = (0, 0.004858, 0.019048, 0.042408, 0.075362, 0.119048, 0.175610, 0.248786, 0.345098, 0.476471, 0.666667)


# -- the fuzzy gain ----------------------------------------------------------------------------------------------------


def mamdani(e: float, E: float = 1.0, L: float = 1.0, points: int = 10001) -> float:
    """Centroid, by the trapezoid rule, of min-max inference with triangles at -E, 0, E and -L, 0, L."""

    def triangle(x: np.ndarray | float, peak: float, width: float) -> np.ndarray:
        return np.maximum(1.0 - np.abs(np.asarray(x) - peak) / width, 0.0)

    z, e = np.linspace(-L, L, points), min(max(e, -E), E)
    rules = ((-E, L), (0.0, 0.0), (E, -L))  # negative: high, zero: none, positive: low
    shape = np.max([np.minimum(triangle(e, peak, E), triangle(z, to, L)) for peak, to in rules], axis=0)
    return float(np.trapezoid(shape * z, z) / np.trapezoid(shape, z))


def test_check_points_of_the_study() -> None:
    assert [closed_float(i / 10) for i in range(11)] == pytest.approx(CHECKED, abs=5e-7)


def test_the_closed_form_is_the_centroid() -> None:
    """To 1e-7 of a centroid over 10001 points; the sum over 101 points that tools take by default is 8e-3 off."""
    for e in np.linspace(-1.5, 1.5, 61):
        assert -math.copysign(closed_float(min(abs(e), 1.0)), e) == pytest.approx(mamdani(e), abs=1e-7)
    assert mamdani(0.2, E=0.5, L=0.25) == pytest.approx(-0.25 * closed_float(0.4), abs=1e-7)


def test_the_form_in_15_bits() -> None:
    """Every a: 6.907e-5 at most (study: 2.3 LSB, 6.9e-5); at a = 1 the numerator is one more than int32 holds."""
    error = max(abs(closed_fixed(a) * Q15 - closed_float(a * Q15)) for a in range(32769))
    assert 5e-5 < error <= 6.95e-5
    assert (32768 * 32768 >> 15) * (98304 - 32768) == 2**31
    assert closed_fixed(32768) == 21845


def test_a_table_of_65_entries() -> None:
    """Straight lines between them: 3.1e-4 off the closed form, both forms; exact where an entry stands."""
    table, words = np.array(DEFAULT_TABLE), np.round(np.array(DEFAULT_TABLE) * 2**15).astype(np.int64)
    errors = [table_float(table, 0, a * Q15) - closed_float(a * Q15) for a in range(32769)]
    assert 2e-4 < np.abs(errors).max() <= 3.2e-4
    both = [table_fixed(words, 0, a) * Q15 - table_float(table, 0, a * Q15) for a in range(32769)]
    assert np.abs(both).max() < 1.01 * Q15
    assert [table_fixed(words, 0, 512 * i) for i in range(65)] == words.tolist()


# -- the sign of S -----------------------------------------------------------------------------------------------------

SAMPLES = 2_000_000
M = 0.45  # 1/s, experiment 3


def drawn(sigma_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """(e rad, w rad/s). The study's e: normal, sigma .05 or .2 deg; its w it does not say: normal, sigma m times e's.

    So m e and w are alike, as near the switching line; with it the study's other figures come out, too.
    """
    rng, sigma = np.random.default_rng(3), math.radians(sigma_deg)
    return rng.normal(0, sigma, SAMPLES), rng.normal(0, M * sigma, SAMPLES)


def wrong(e: np.ndarray, w: np.ndarray, sign: np.ndarray) -> float:
    """Share of signs that are not those of e (m e + w)."""
    return float(np.mean(sign != np.where(e * (M * e + w) >= 0, 1, -1)))


@numba.njit
def signs_fixed(m: int, e: np.ndarray, w: np.ndarray) -> np.ndarray:
    """sgn(S) as the law computes it: m Q24, e Q29, w Q28."""
    found = np.zeros(len(e), np.int64)
    for k in range(len(e)):
        found[k] = sign_fixed(e[k], ((m * e[k] + (1 << 22)) >> 23) + (w[k] << 2))
    return found


@pytest.mark.parametrize("sigma_deg", [0.05, 0.2])
def test_the_sign_of_S_is_right(sigma_deg: float) -> None:
    """At most 1 in 100,000 is wrong, from readings as fine as the wire's (study, section 3.1)."""
    e, w = drawn(sigma_deg)
    found = signs_fixed(round(M * 2**24), np.rint(e * 2**29).astype(np.int64), np.rint(w * 2**28).astype(np.int64))
    share = wrong(e, w, found)
    print(f"sigma {sigma_deg} deg: {share:.1e} of the signs wrong")
    assert share <= 1e-5


@pytest.mark.parametrize(("sigma_deg", "factored_most"), [(0.05, 0.03), (0.2, 0.01)])
def test_the_square_in_15_bits_is_bad(sigma_deg: float, factored_most: float) -> None:
    """What the law does not do: S = m e^2 + e w in Q15 is zero for small e, so its sign is wrong where it matters."""
    e, w = drawn(sigma_deg)
    e15, w15, m15 = (np.rint(x * 2**15).astype(np.int64) for x in (e, w, np.array(M)))
    S = (m15 * (e15 * e15 >> 15) >> 15) + (e15 * w15 >> 15)
    squared = wrong(e, w, np.where(S >= 0, 1, -1))
    sigma = (m15 * e15 >> 15) + w15
    factored = wrong(e, w, np.where(np.sign(e15) * np.sign(sigma) >= 0, 1, -1))
    print(f"sigma {sigma_deg} deg, Q15: squared {squared:.1%}, factored {factored:.1%} of the signs wrong")
    assert squared > 0.1
    assert 1e-3 < factored < factored_most


def test_the_sign_of_nothing_is_plus() -> None:
    assert [sign_fixed(e, s) for e, s in ((0, 5), (-3, 0), (0, 0), (2, 7), (-2, -7), (2, -7), (-2, 7))] == [
        1, 1, 1, 1, 1, -1, -1,
    ]  # fmt: skip


# -- the law -----------------------------------------------------------------------------------------------------------

GAINS = {"Ks": 3.6, "Kr": 1.48, "m": 0.1, "ka": (0.01, 0.02, 0.04)}
FUZZY = {"E": 0.5, "L": 0.5}


def flown(name: str, form: str, wire: np.ndarray, **values: object) -> tuple[np.ndarray, list[list[int]]]:
    """(torque N m, flags), telemetry; experiment 2's gains, angles 1-2-3."""
    given = {"form": form, "reference_kind": "none", "attitude_sequence": "123", "torque_bits": 28} | GAINS
    given |= {"error": "euler", "torque_limit": 7.0, "period_us": 100_000} | values
    configuration = parse_configuration(config_words(law_by_name(name), given))
    is_float = form == "float"
    law, reference = new_law(name, configuration), Reference(configuration.common, is_float)
    scale = inputs.si_scale(configuration.common) if is_float else np.ones(inputs.SIZE)
    dtype = np.float64 if is_float else np.int64
    out, rows, words = np.zeros(4, dtype), [], []
    for row in wire:
        inp = (row * scale).astype(dtype)
        reference.advance(inp)
        law.step(inp, reference.state, out)
        rows.append([*(out[:3] * (1.0 if is_float else 2.0**-28)), out[3]])
        words.append(law.telemetry())
    return np.array(rows), words


def readings(ticks: int = 200) -> np.ndarray:
    """Swings through both sides of the switching line, rate and angle not in step."""
    wire, t = np.zeros((ticks, inputs.SIZE)), np.arange(ticks) * 0.1
    wire[:, :3], wire[:, inputs.TICK] = 1, np.arange(ticks)
    for i, amplitude in enumerate((0.4, 0.1, 1.2)):
        wire[:, 3 + i] = np.round(amplitude * np.sin(0.7 * t + i) / BAM)
        wire[:, 10 + i] = np.round(amplitude * 0.3 * np.cos(1.1 * t + 2 * i) * 2**28)
    wire[ticks // 2 :, inputs.SETPOINT] = np.round(np.array((0.3, 0.3, -0.3)) / BAM)
    return wire


@pytest.mark.parametrize("difference", [0, 1])
@pytest.mark.parametrize("name", ["fvsc", "vsc", "ifvsc"])
def test_it_is_its_equation_in_both_forms(name: str, difference: int) -> None:
    wire = readings()
    e = (wire[:, inputs.EULER] - wire[:, inputs.SETPOINT]) * BAM
    rate = wire[:, inputs.RATE] * 2.0**-28
    w = np.vstack([np.zeros(3), np.diff(e, axis=0) / 0.1]) if difference else rate
    sign = np.where(e * (0.1 * e + w) >= 0, 1, -1)
    f = -e if name == "vsc" else -np.sign(e) * 0.5 * np.vectorize(closed_float)(np.minimum(np.abs(e) / 0.5, 1))
    integral = np.vstack([np.zeros(3), np.cumsum(e, axis=0)[:-1] * 0.1]) if name == "ifvsc" else 0 * e
    expected = np.array(GAINS["ka"]) * (3.6 * sign * f - 1.48 * rate - 0.03 * integral)
    more = ({} if name == "vsc" else FUZZY) | ({"Ki": 0.03} if name == "ifvsc" else {})
    got, _ = flown(name, "float", wire, rate_in_S=difference, **more)
    assert got[:, :3] == pytest.approx(expected, abs=1e-7)  # gains have 20 bits
    assert {-1, 1} <= set(sign.ravel())
    fixed, words = flown(name, "fixed", wire, rate_in_S=difference, **more)
    assert np.abs(fixed[:, :3] - expected).max() < 0.04 * (1e-5 if name == "vsc" else 3.6 * 0.5 * 1.2e-4)
    assert np.array(words)[:, 6:9].tolist() == sign.tolist()
    assert np.array(words)[:, :3] * 2.0**-29 == pytest.approx(e, abs=3e-9)


@pytest.mark.parametrize("form", ["float", "fixed"])
def test_without_a_reading_all_stands_still(form: str) -> None:
    """The last command again; no integral of an old error; the change of the error is over the gap."""
    wire = readings(20)
    wire[8:12, inputs.FRESH], wire[8:12, 3:13] = 0, 0
    more = {"rate_in_S": "difference", "Ki": 0.03, **FUZZY}
    got, words = flown("ifvsc", form, wire, **more)
    assert (got[8:12] == got[7]).all() and words[8:12] == [words[7]] * 4
    assert got[12].tolist() != got[7].tolist()
    start, _ = flown("ifvsc", form, wire[8:12], **more)
    assert (start == [0, 0, 0, inputs.STARTING]).all()


@pytest.mark.parametrize("form", ["float", "fixed"])
def test_the_integral_does_not_wind_up(form: str) -> None:
    """At the limit it waits, until the error turns; integral_limit holds in any case."""
    wire = readings(400)
    wire[:, 3:22] = 0
    wire[:200, inputs.SETPOINT] = round(0.3 / BAM)
    wire[200:, inputs.SETPOINT] = round(-0.05 / BAM)
    more = {"Ki": 1.0, "ka": 0.01, "Ks": 0.1, **FUZZY}
    _, words = flown("ifvsc", form, wire, torque_limit=0.005, **more)
    integral = np.array(words)[:, 9] * 2.0**-20
    assert -0.6 < integral[199] < -0.4 and integral[199] == integral[120]  # its own share of the limit: .5 V
    assert integral[-1] > integral[199]
    _, words = flown("ifvsc", form, wire, integral_limit=0.25, **more)
    assert (np.abs(np.array(words)[:, 9]) * 2.0**-20).max() == pytest.approx(0.25, abs=1e-6)


def test_the_closed_form_keeps_within_64_bits() -> None:
    peaks: dict[str, int] = {}
    checked = rebound(closed_fixed, peaks)
    assert [checked(a) for a in (0, 1, 16384, 32767, 32768)] == [closed_fixed(a) for a in (0, 1, 16384, 32767, 32768)]
    assert max(peaks.values()) >= 2**31
