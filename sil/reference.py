"""The reference model once more, in float64 and apart from the board: what the board reported is held against this.

Per axis, angles in rad, rates per sample, r(k) the set-point, d the lead, p = exp(-wn T_s) the double pole; the state
(ym, vm) at index j moves to j + 1 with the set-point of tick j + 1 - d:

    a = k1 (r - ym) - k2 vm       |a| <= accel_limit, |vm + a| <= rate_limit, r - ym modulo a turn
    zoh:    ym += vm + a / 2      k1 = (1-p)^2, k2 = (1-p)(3+p)/2   C1 ym = q^-d (1-p)^2 (1 + q^-1)/2 r
    paper:  ym += vm + a          k1 = (1-p)^2, k2 = 1 - p^2        C1 ym = q^-d (1-p)^2 r
    vm += a                       C1 = (1 - p q^-1)^2
    none:   ym(k) = ym(k-1) + wrap(r(k) - ym(k-1)), the last term within +-rate_limit; without one ym = r

Where it starts (y is the reference the board reported at tick s):
    model start (REFERENCE_RESTART with b = 1): ym = y up to s + d - 1, where with zoh the rate is
        vm0 = 2 ((1-p)/(1+p))^2 (r - y), as after r(s-1) = r(s), and 0 with paper; r(s) acts from there on;
    bumpless start by the law (b = 0): ym = y up to s + d; it goes on from there at the rate the law found, which
        TELEMETRY first shows at s + d + 1; r(s+1) is the first that acts;
    none, with a rate limit: from the first TELEMETRY at or after the start on; without one there is nothing to start.
Source: study of paper 004, sections 0 and 3.1; protocol/SPEC.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from protocol.law_tables import INT32_MAX, REFERENCE_NONE, REFERENCE_ZOH

Array = npt.NDArray[np.float64]
TURN = 2.0 * math.pi
RAD_PER_BAM = TURN / 2**32
UNLIMITED = INT32_MAX * RAD_PER_BAM  # rad per sample


class Model(NamedTuple):
    """The reference model as CONFIG describes it."""

    kind: int
    lead: int
    pole: float
    rate_limit: float  # rad per sample
    accel_limit: float  # rad per sample^2

    @property
    def gains(self) -> tuple[float, float, float]:
        """(k1, k2, share of `a` that goes into the position at once)."""
        p = self.pole
        if self.kind == REFERENCE_ZOH:
            return (1 - p) ** 2, (1 - p) * (3 + p) / 2, 0.5
        return (1 - p) ** 2, 1 - p * p, 1.0

    @property
    def start_rate(self) -> float:
        """vm0 / (r - y) of a model start."""
        return 2 * ((1 - self.pole) / (1 + self.pole)) ** 2 if self.kind == REFERENCE_ZOH else 0.0


def model_of(words: Mapping[str, int]) -> Model:
    """The model from COMMON's words by name."""
    return Model(
        words["reference_kind"],
        words["reference_lead"],
        words["reference_pole"] * 2.0**-30,
        words["rate_limit"] * RAD_PER_BAM or UNLIMITED,
        (words["accel_limit"] or INT32_MAX) * RAD_PER_BAM,
    )


class Start(NamedTuple):
    """Where the reference began anew: row (tick index) and whether the model started there (else the law)."""

    row: int
    by_model: bool


def recompute(model: Model, setpoint: Array, reported: Array, rate: Array, starts: Sequence[Start]) -> Array:
    """ym (N, 3) in rad, NaN before the first start that TELEMETRY shows.

    setpoint (N, 3): r(k), rad. reported, rate (N, 3): ym(k) and vm(k) from TELEMETRY, rad and rad per sample, NaN where
    there was none. Each start is seeded from the first TELEMETRY at or after it. Without starts, the first TELEMETRY is
    taken for one in mid-run.
    """
    result = np.full_like(setpoint, np.nan)
    if model.kind == REFERENCE_NONE and model.rate_limit >= UNLIMITED:
        return setpoint.copy()
    seen = np.flatnonzero(np.isfinite(reported).all(axis=1))
    if not seen.size:
        return result
    begins = list(starts) or [Start(-model.lead - 1, True)]
    for number, start in enumerate(begins):
        stop = begins[number + 1].row if number + 1 < len(begins) else len(setpoint)
        later = seen[(seen >= start.row) & (seen < stop)]
        if not later.size:
            continue
        if model.kind == REFERENCE_NONE:
            _follow(model.rate_limit, setpoint, reported, int(later[0]), stop, result)
        else:
            _segment(model, setpoint, reported, rate, start, int(later[0]), stop, result)
    return result


def _follow(limit: float, setpoint: Array, reported: Array, seed: int, stop: int, result: Array) -> None:
    """Fill result[seed:stop]: the set-point, from what was reported at `seed` on, by no more than `limit` a sample."""
    result[seed] = reported[seed]
    for k in range(seed + 1, stop):
        for axis in range(3):
            step = _wrap(float(setpoint[k, axis] - result[k - 1, axis]))
            arrived = abs(step) <= limit
            result[k, axis] = setpoint[k, axis] if arrived else result[k - 1, axis] + math.copysign(limit, step)


def _segment(
    model: Model, setpoint: Array, reported: Array, rate: Array, start: Start, seed: int, stop: int, result: Array
) -> None:
    """Fill result[seed:stop] from what TELEMETRY said at row `seed`."""
    still_until = start.row + model.lead - (1 if start.by_model else 0)  # the last index at which ym is still y
    if not start.by_model and seed <= still_until:
        result[seed : min(still_until + 1, stop)] = reported[seed]
        later = np.flatnonzero(np.isfinite(reported[still_until + 1 : stop]).all(axis=1))
        if not later.size:
            return
        seed = still_until + 1 + int(later[0])
    for axis in range(3):
        r = setpoint[:, axis].tolist()
        y, v, head = float(reported[seed, axis]), float(rate[seed, axis]), seed
        if seed <= still_until:
            result[seed : min(still_until, stop - 1) + 1, axis] = y
            v = model.start_rate * _wrap(r[start.row] - y)
            v = min(max(v, -model.rate_limit), model.rate_limit)
            head = still_until
        if head < stop:
            result[head:stop, axis] = _run(model, r, y, v, head, stop)


def _run(model: Model, r: list[float], y: float, v: float, head: int, stop: int) -> list[float]:
    """ym at head .. stop - 1, from (y, v) at index head."""
    k1, k2, share = model.gains
    a_max, v_max, lag = model.accel_limit, model.rate_limit, model.lead - 1
    rows = [y]
    for j in range(head, stop - 1):
        a = min(max(k1 * _wrap(r[max(j - lag, 0)] - y) - k2 * v, -a_max), a_max)
        v_new = min(max(v + a, -v_max), v_max)
        a = v_new - v
        y += v + share * a
        v = v_new
        rows.append(y)
    return rows


def _wrap(angle: float) -> float:
    """Modulo a turn, in [-pi, pi]; unchanged where it is there already."""
    return angle if -math.pi <= angle <= math.pi else angle - TURN * math.floor(angle / TURN + 0.5)
