"""The frames of /tf and how they are turned, tick by tick, from nothing but the journal.

    inertial (N)    the root
    orbital (O)     in inertial. attitude.frame lvlh: q_NO = q_NB (x) q_OB^-1 of TRUTH's quaternion and angles, so that
                    the body in it has just those angles, whatever the plant; inertial: by plant.orbit
    horizon         in orbital, half a turn about x: z up. Viewers draw z upwards, so in this one the Earth is below
    body (B)        in inertial: TRUTH's q_BN
    reference       where the body ought to point: in orbital, or in inertial where that is the frame of the angles

The reference of a tick is what the board's TELEMETRY of that tick says, from the tick on in which its reference model
began (a board that has read nothing yet reports zeros). Where the board has no reference model that differs from the
set-point, it is the set-point. Otherwise there is none: no transform rather than a wrong one. The same goes for a truth
that is not a number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from sil import pointing
from sil.pointing import Quaternion
from sil.sinks.journal import Truth

INERTIAL, ORBITAL, HORIZON, BODY, REFERENCE = "inertial", "orbital", "horizon", "body", "reference"
HORIZON_IN_ORBITAL: Quaternion = (0.0, 1.0, 0.0, 0.0)
_RAD_PER_BAM = 2.0 * math.pi / 2**32


class Frames:
    """Rotations by frame, sign continuous in time; without a scenario there is only the body's.

    Raises AttributeError, TypeError, ValueError or ArithmeticError for a scenario that makes no sense.
    """

    def __init__(self, scenario: Mapping[str, Any] | None) -> None:
        self._known = scenario is not None
        self._sequence = pointing.sequence_of(scenario or {})
        self._lvlh = pointing.frame_of(scenario or {}) == "lvlh"
        self._orbit = pointing.orbit_of(scenario or {})
        if not (math.isfinite(self._orbit.u_rad(1.0)) and math.isfinite(self._orbit.tilt_rad)):
            raise ValueError(f"plant.orbit: expected numbers, got {self._orbit}")
        self._before: dict[str, Quaternion] = {}
        self._running = False  # the board's reference model

    @property
    def parent_of_reference(self) -> str:
        """The frame that angles are relative to."""
        return ORBITAL if self._lvlh else INERTIAL

    @property
    def orbital_is_known(self) -> bool:
        """There is a frame `orbital`."""
        return self._known

    def session(self) -> None:
        """A board starts anew: its reference is unknown until its model begins."""
        self._running = False

    def reference_begins(self) -> None:
        """The board says that its reference model began."""
        self._running = True

    def body(self, truth: Truth) -> Quaternion | None:
        """q_BN."""
        return self._continued(BODY, truth.q_BN) if math.isfinite(sum(truth.q_BN)) else None

    def orbital(self, t_ns: int, truth: Truth) -> Quaternion | None:
        """q_ON."""
        if not self._known:
            return None
        if self._lvlh:
            if not math.isfinite(sum(truth.q_BN) + sum(truth.euler_rad)):
                return None
            q_BO = pointing.q_of_euler(truth.euler_rad, self._sequence)
            return self._continued(ORBITAL, pointing.times(truth.q_BN, pointing.inverse(q_BO)))
        half = self._orbit.u_rad(t_ns * 1e-9) / 2.0
        return pointing.q_of_orbit(math.cos(half), math.sin(half), self._orbit.tilt_rad)

    def reported(self, words: Sequence[int]) -> Quaternion | None:
        """Of TELEMETRY's words; None: the board's reference has not begun, or there are fewer than three words."""
        return self.pointed(words[:3]) if self._running and len(words) >= 3 else None

    def pointed(self, angles_bam: Sequence[int]) -> Quaternion | None:
        """Of the angles [x, y, z] in 2^-32 turn."""
        if not self._known:
            return None
        x, y, z = angles_bam
        angles = (x * _RAD_PER_BAM, y * _RAD_PER_BAM, z * _RAD_PER_BAM)
        return self._continued(REFERENCE, pointing.q_of_euler(angles, self._sequence))

    def _continued(self, frame: str, q: Sequence[float]) -> Quaternion:
        new = pointing.continued(q, self._before.get(frame, q))
        self._before[frame] = new
        return new
