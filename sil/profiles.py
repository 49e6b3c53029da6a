"""Guidance profiles: named manoeuvres as tables of (tick, set-point); the board flies the table.

A set-point holds from its tick until the next row; before the first row it is zero. Triples are [roll, pitch, yaw] in
deg. A and B are the manoeuvres of the study of paper 004 (section 0); their timing is a guess, the paper's figure is
lost (docs/ASSUMPTIONS.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from sil.scenario_sections import Guidance, Numbers3

Change = tuple[float, Numbers3]  # (t_s, set-point in deg): from t_s on


class SetpointRow(NamedTuple):
    """From `tick` on the set-point is `xyz_deg`."""

    tick: int
    xyz_deg: Numbers3


def setpoints(
    guidance: Guidance, period_s: float, ticks: int, more: Sequence[SetpointRow] = ()
) -> tuple[SetpointRow, ...]:
    """Rows for ticks 0..ticks-1: a change at t_s acts from the first tick not before it on; equal rows merge.

    more: rows beside the profile's; in a tick where both have one, it is theirs that counts.
    """
    profile = PROFILES[guidance.profile](guidance, period_s * ticks)
    changes = [SetpointRow(math.ceil(t_s / period_s - 1e-9), xyz_deg) for t_s, xyz_deg in profile]
    rows: list[SetpointRow] = []
    for tick, xyz_deg in sorted([*changes, *more], key=lambda row: row.tick):
        if tick >= ticks:
            break
        if rows and rows[-1].tick == tick:
            rows.pop()
        if xyz_deg != (rows[-1].xyz_deg if rows else (0.0, 0.0, 0.0)):
            rows.append(SetpointRow(tick, xyz_deg))
    return tuple(rows)


def _manoeuvre_a(guidance: Guidance, duration_s: float) -> Iterator[Change]:
    """Roll +-25 deg square from 60 s, pitch +-30 deg square from 110 s, half-period 100 s each: they overlap. Yaw 0."""
    changes = sorted({start + 100.0 * n for start in (60.0, 110.0) for n in range(int(duration_s / 100.0) + 1)})
    for t_s in changes:
        yield t_s, (_square(25.0, t_s - 60.0), _square(30.0, t_s - 110.0), 0.0)


def _square(amplitude_deg: float, t_s: float) -> float:
    return 0.0 if t_s < 0 else amplitude_deg * (-1.0) ** int(t_s // 100.0)


def _manoeuvre_b(guidance: Guidance, duration_s: float) -> Iterator[Change]:
    """Every 600 s: roll +25 at 60, -25 at 150, 0 at 240 s; then pitch +30 at 330, -30 at 420, 0 at 510 s; yaw 0."""
    once = (
        (60.0, 25.0, 0.0),
        (150.0, -25.0, 0.0),
        (240.0, 0.0, 0.0),
        (330.0, 0.0, 30.0),
        (420.0, 0.0, -30.0),
        (510.0, 0.0, 0.0),
    )
    for cycle in range(int(duration_s / 600.0) + 1):
        for t_s, roll, pitch in once:
            yield 600.0 * cycle + t_s, (roll, pitch, 0.0)


def _hold(guidance: Guidance, duration_s: float) -> Iterator[Change]:
    """guidance.hold_deg from the start."""
    yield 0.0, guidance.hold_deg


def _steps(guidance: Guidance, duration_s: float) -> Iterator[Change]:
    """guidance.rows as they stand."""
    for row in guidance.rows:
        yield row.t_s, row.attitude_deg


PROFILES: dict[str, Callable[[Guidance, float], Iterator[Change]]] = {
    "A": _manoeuvre_a,
    "B": _manoeuvre_b,
    "hold": _hold,
    "steps": _steps,
}
