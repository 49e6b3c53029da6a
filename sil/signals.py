"""The few value types and protocols shared inside the laboratory: what flows between plant, sensors, actuators, loop.

Frames: N inertial, O orbital (x along-track, y = -orbit normal, z nadir), B body. `q_BN` is scalar first and maps body
to inertial components, v_N = q v_B q* (Hamilton). Arrays are float64 of the shape given; nobody writes into an array
that was handed over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from protocol.frames import Reading, Sample
    from sil.lateness import Wake

Vector = npt.NDArray[np.float64]


class Motion(NamedTuple):
    """The truth at one instant; `R` is the reference frame named by `attitude.frame` (lvlh: O, inertial: N)."""

    t_ns: int  # ns, simulation time
    q_BN: Vector  # (4,) scalar first, continuous in sign
    omega_BN_B: Vector  # (3,) rad/s, body axes
    momentum_B: Vector  # (3,) N m s, absolute wheel momentum about the body axes
    euler_rad: Vector  # (3,) rad, [x, y, z] angles of B relative to R in `attitude.sequence`
    rate_rel: Vector  # (3,) rad/s, omega_BR_B: body rate relative to R, body axes


class Plant(Protocol):
    """The satellite. It knows no sample numbers: whoever calls it says from when to when."""

    def motion(self, t_ns: int) -> Motion:
        """Truth at t_ns, the instant the state has been integrated to. Fresh arrays every time."""

    def advance(self, torque_B: Vector, t_ns: int, period_ns: int) -> None:
        """Integrate from t_ns to t_ns + period_ns with `torque_B` (3,) N m on the body held constant."""


class Actuator(Protocol):
    """What stands between a commanded torque and the body."""

    def limit(self, command_Nm: Vector, momentum_B: Vector, period_s: float, tick: int) -> Vector:
        """Torque (3,) N m that really acts on the body for the period that `tick` begins, given the wheel momentum
        (3,) N m s. Called again for the same tick, with the command that acts after all, it answers anew.
        """


class Sensor(Protocol):
    """One instrument: truth in, integers in wire units out. The same (motion, tick) gives the same reading."""

    bit: int  # which reading of a SAMPLE it fills: 0 Euler angles, 1 quaternion, 2 rates
    valid: bool  # whether it vouches for the reading it gave last

    def read(self, motion: Motion, tick: int) -> Reading:
        """The reading that leaves at `tick`."""


class Observer(Protocol):
    """A sensor that looks at the truth at instants of its own, not only when it is read."""

    due_ns: int  # the next instant at which it looks

    def observe(self, motion: Motion) -> None:
        """The truth at `due_ns`; called there in the loop's integration, at a tick its `read` is enough."""


class Counterpart(Protocol):
    """The other end of the cable as the loop sees it: a board, or nobody."""

    last_answer_ns: int  # wall time from the newest SAMPLE to its COMMAND; -1 while there is none

    def send(self, sample: Sample, t_ns: int) -> None:
        """SAMPLE(k) leaves at t_k."""

    def drain(self, tick: int) -> None:
        """Take what has come; in lockstep wait until the whole answer to `tick` is here."""

    def listen(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` for one frame and take it."""

    def finish(self, tick: int, overdue: bool) -> None:
        """The run is over: the answer to `tick` is the last one that counts; `overdue`: it should be here by now.

        Not overdue: the run was interrupted, and the answer is waited for a moment only.
        """


class Recorder(Protocol):
    """Where a run's rows go. Nothing handed over here comes from a wall clock, except what its name says."""

    def packet(
        self,
        tick: int,
        direction: int,
        fate: int,
        packet: bytes,
        cause: str = "",
        copy: int = 0,
        arrival_ns: int = -1,
        encoded: bytes = b"",
    ) -> None:
        """A copy of a deterministic frame, header to CRC; direction and fate as in sil.sinks.journal.

        cause: why it was lost, altered or late. copy: 0 for the frame's own. arrival_ns: modelled; -1: not modelled.
        encoded: the bytes on the wire where a byte fault altered them.
        """

    def session(self, tick: int) -> None:
        """A board session starts at this tick; its CONFIG packets follow."""

    def housekeeping(self, direction: int, packet: bytes) -> None:
        """A frame outside every comparison; it is stamped with the host's time and filed under the present tick."""

    def event(self, tick: int, code: int, a: int, b: int) -> None:
        """Something the laboratory noticed; codes in protocol.events."""

    def truth(
        self, motion: Motion, applied_Nm: Vector, setpoint_bam: tuple[int, int, int], source: int, tick: int
    ) -> None:
        """The plant at t_k and the torque that acts from t_k on."""

    def timing(self, tick: int, wake: Wake, answer_ns: int) -> None:
        """How late the tick woke up on the wall clock and why; how long the board took to answer (-1: no answer)."""

    def commit(self, tick: int) -> None:
        """Everything of this tick has been handed over: one write."""
