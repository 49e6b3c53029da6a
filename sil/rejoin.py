"""A board that restarts in mid-run: how many of these a run survives, and the session that follows the lost one.

Rules: protocol/SPEC.md, L14 to L16 and L18. A restart is unasked, or planned by the scenario: then the laboratory
itself begins the next session, since a new nonce resets a board from any state, and it is no mishap that anybody
counts. Nothing here knows whether simulated time stands still meanwhile (lockstep) or goes on (a paced clock): whoever
waits for frames hands them in and polls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from protocol import events
from protocol.frames import Packet
from protocol.port import Port
from sil.session import Opening, Session
from sil.signals import Recorder
from sil.sinks.journal import Direction, Fate
from sil.timeline import Restart
from sil.trouble import LinkFailure

BACK_WITHIN_S = 10.0  # from the HELLO that says so to the echo of ours
SHOWN = 6  # ticks of a storm that a line names


class Rejoin:
    """Counts the restarts of one run's board; `under_way` from one until the next session is READY.

    limit: unasked restarts that the run survives. planned: those that the scenario asks for. notify: for a line when
    the board takes its time.
    """

    def __init__(
        self,
        port: Port,
        session: Session,
        limit: int,
        recorder: Recorder,
        notify: Callable[[str], None],
        planned: Sequence[Restart] = (),
    ) -> None:
        self._planned = tuple(planned)
        self._is_planned = False  # what is under way
        self._port, self._session, self._limit = port, session, limit
        self._recorder, self._notify = recorder, notify
        self._opening: Opening | None = None
        self.under_way = False  # there is no session: nothing may be sent but what opens one
        self._tick = 0  # the newest when the board restarted
        self._unrecorded = False  # the session has no tick yet
        self.ticks: list[int] = []  # of every restart so far

    @property
    def overdue(self) -> bool:
        """A planned restart is all that is under way: a board that is not READY when it is on again is too slow."""
        return self.under_way and self._is_planned

    def off(self, tick: int) -> bool:
        """The scenario has the board switched off at this tick."""
        return any(restart.off_tick <= tick < restart.on_tick for restart in self._planned)

    def switches_off(self, tick: int) -> bool:
        """... and this is the first tick of it."""
        return any(restart.off_tick == tick for restart in self._planned)

    def switch_off(self, tick: int) -> None:
        """Before SAMPLE(tick), as the scenario says: the board begins anew now, and is left alone until it is on."""
        self._begin(tick, planned=True)

    def restarted(self, tick: int) -> None:
        """The board said so after SAMPLE(tick). Raises LinkFailure when that is once too often."""
        self._tick = tick
        self._count()
        self._begin(tick, planned=False)

    def _begin(self, tick: int, planned: bool) -> None:
        self._tick, self._is_planned = tick, planned
        self._opening, self.under_way = self._session.again(BACK_WITHIN_S, self._waiting, self._count), True
        self.poll()

    def _count(self) -> None:
        self._is_planned = False
        self.ticks.append(self._tick)
        self._recorder.event(self._tick, events.BOARD_RESTARTED, self._tick, len(self.ticks))
        if len(self.ticks) > self._limit:
            raise LinkFailure(f"board: {self._so_often()} (it says HELLO unasked); restart_limit is {self._limit}")

    def poll(self) -> float:
        """Send what is due of the handshake; returns for how many seconds nothing else will be."""
        assert self._opening is not None
        try:
            return self._opening.poll()
        except LinkFailure as failure:
            raise self._not_back(failure) from None

    def take(self, packet: Packet) -> bool:
        """A frame that came meanwhile; True when the board is READY again."""
        assert self._opening is not None
        count = len(self.ticks)
        try:
            self._opening.take(packet)
        except LinkFailure as failure:
            raise (failure if len(self.ticks) > count else self._not_back(failure)) from None
        if not self._opening.done:
            return False
        self._opening, self.under_way, self._unrecorded = None, False, True
        return True

    def begins(self, tick: int) -> bool:
        """SAMPLE(tick) is about to leave; True where it is the first one of a later session, which is recorded here."""
        if not self._unrecorded:
            return False
        self._unrecorded = False
        self._recorder.session(tick)
        for packet in self._session.packets:
            self._recorder.packet(tick, Direction.UP, Fate.DELIVERED, packet)
        return True

    def ask(self) -> None:
        """Does the board know the session still? It answers CONFIG with READY, without one with HELLO."""
        self._port.write(*self._session.packets[:1])

    def _waiting(self, waited_s: float) -> None:
        why = f"switched off at tick {self._tick}" if self._is_planned else self._so_often()
        self._notify(f"board: {why}; not ready again after {waited_s:.0f} s")

    def _not_back(self, failure: LinkFailure) -> LinkFailure:
        if self._is_planned:
            return LinkFailure(f"{failure} (in the session after board.restart, at tick {self._tick})")
        reason = str(failure).removeprefix("board: ")
        return LinkFailure(f"board: {self._so_often()}, and did not come back: {reason}")

    def _so_often(self) -> str:
        """`restarted at tick 10`, `restarted 3 times, at ticks 10, 12, 12`; of a storm the first and the last ones."""
        if len(self.ticks) == 1:
            return f"restarted at tick {self.ticks[0]}"
        ticks = [str(tick) for tick in self.ticks]
        if len(ticks) > SHOWN:
            ticks[SHOWN // 2 : -SHOWN // 2] = ["..."]
        return f"restarted {len(self.ticks)} times, at ticks {', '.join(ticks)}"
