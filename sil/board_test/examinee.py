"""The board under test: how it is reached and started, what is known of it so far, and a reference board beside it.

The reference is the Python board of this installation, in this process and through frames like any other. Rather than
recorded answers, because it always speaks of the law tables that are installed here, takes any frame that a check
invents and any scenario of the user's, and leaves no file that has to be renewed with every change of a law.
"""

from __future__ import annotations

import os
import signal
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from protocol.frames import Hello
from protocol.law_tables import LawTable
from protocol.link import Link, LinkError
from protocol.links import open_link
from protocol.links.serial import SerialLink
from sil.board_test.bench import Bench, Patience
from sil.board_test.outcome import Silent, Skipped
from sil.boards import BOARDS, WITHOUT_TIMER, BoardHost, BoardOrder, plug_in
from sil.doctor.device import Device
from sil.doctor.findings import Surroundings
from sil.doctor.link import Examination, link_url
from sil.doctor.talk import Talk
from sil.doctor.verdicts import FAULTS
from sil.trouble import LinkFailure, SilError, UsageError

WITH_BUTTON = WITHOUT_TIMER  # emulated processors, whose processes take SIGUSR1 for their reset button
KINDS = tuple(kind for kind in BOARDS if kind not in ("inproc", "wired"))  # inproc is the reference itself
FLIGHTS = ("pd-root-locus", "mrac-rs232", "appc-rs232")

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Order:
    """What to test and how. target: a kind of board that is started for it, or the URL of one that runs.

    link: of a board that is started. flights: scenarios whose first `ticks` ticks it has to fly. reset: ask for the
    reset button, and it has to be pressed; reset_offered: ask, and it may be. drift_s: how long its timer is watched.
    """

    target: str
    link: str = "pty"
    only: tuple[str, ...] = ()
    skip: tuple[str, ...] = ()
    flights: tuple[str, ...] = FLIGHTS
    ticks: int = 200
    exchanges: int = 300
    reset: bool = False
    reset_offered: bool = False
    reset_within_s: float = 30.0
    drift_s: float = 10.0
    patience: Patience = field(default_factory=Patience)
    around: Surroundings = field(default_factory=Surroundings)

    @property
    def launched(self) -> bool:
        """Whether the board is ours to start."""
        return self.target in KINDS

    @property
    def url(self) -> str:
        """Of the board that runs already. Raises UsageError."""
        try:
            url = link_url(self.target)
        except LinkError:
            url = ""
        if not url.startswith(("serial:", "udp:")):
            known = f"{', '.join(KINDS)}, serial:///dev/X?baud=N, /dev/X or udp://HOST:PORT"
            raise UsageError(f"board-test: expected {known}, got {self.target!r}")
        return url

    def examination(self) -> Examination:
        """The same for the doctor, who looks at the device."""
        return Examination(self.url, around=self.around)


class Examinee:
    """The board that is examined. `bench` talks to it; `laws` are those it has; `first` is its first HELLO.

    tell(text): what is going on; ask(text): something that a person has to do.
    """

    def __init__(self, order: Order, tell: Tell, ask: Tell) -> None:
        self.order, self.tell, self.ask = order, tell, ask
        self.device: Device | None = None
        self.laws: list[LawTable] = []
        self.first: Hello | None = None
        self.restarts = 0  # boards of ours that had to be started again
        self.faults: Counter[str] = Counter()  # what came and was no frame, or out of order, on links now closed
        self.strays: list[str] = []
        self.received = 0
        self._host: BoardHost | None = None
        self._bench: Bench | None = None
        self._reference: Bench | None = None
        self._reference_host: BoardHost | None = None

    # -- plugging ------------------------------------------------------------------------------------------------------

    def plug(self) -> None:
        """Start the board, or open its link. Raises SilError, LinkError."""
        link = self._launch() if self.order.launched else open_link(self.order.url, listen=False)
        self._bench = Bench(Talk(link, self._baud(link)), self._baud(link), self.order.patience)

    def replug(self) -> None:
        """The same once more, with a board of ours that has forgotten everything."""
        self.unplug()
        self.plug()

    def press(self) -> bool:
        """The reset button of an emulated processor; False where there is none that we can reach."""
        if self.order.target not in WITH_BUTTON or self._host is None or self._host.pid is None:
            return False
        os.kill(self._host.pid, signal.SIGUSR1)
        return True

    def unplug(self) -> None:
        """STOP, close the link, end what we started."""
        bench, self._bench = self._bench, None
        host, self._host = self._host, None
        try:
            if bench is not None:
                self._count(bench)
                bench.close()
        finally:
            if host is not None:
                host.close()

    def _count(self, bench: Bench) -> None:
        counters = bench.port.counters
        self.faults.update({name: getattr(counters, name) for name in FAULTS})
        self.received += counters.received
        self.strays += bench.strays

    def close(self) -> None:
        """The board and its reference."""
        try:
            self.unplug()
        finally:
            if self._reference_host is not None:
                self._reference_host.close()

    def _launch(self) -> Link:
        order = BoardOrder(self.order.link, "", None, self.tell, once=False)
        self._host = plug_in(self.order.target, order)
        return self._host.link

    def _baud(self, link: Link) -> int | None:
        is_wire = isinstance(link, SerialLink) and self.device is not None and not self.device.is_pty
        return link.baud if is_wire else None  # type: ignore[attr-defined]

    # -- what checks ask for -------------------------------------------------------------------------------------------

    @property
    def bench(self) -> Bench:
        """The end of the cable. Raises Silent where there is none any more."""
        if self._bench is None:
            raise Silent("the link is closed")
        return self._bench

    @property
    def baud(self) -> int | None:
        """Of the wire; None where bytes take no time."""
        return self.bench.baud

    @property
    def law(self) -> LawTable:
        """A law that the board has, for what is the same with any. Raises Skipped."""
        if not self.laws:
            raise Skipped("the board has none of the laws that are known here")
        return self.laws[0]

    def law_named(self, *names: str) -> LawTable:
        """The first of these laws that the board has. Raises Skipped."""
        for name in names:
            for table in self.laws:
                if table.name == name:
                    return table
        raise Skipped(f"the board has no law {' or '.join(names)}")

    @property
    def reference(self) -> Bench:
        """The reference board."""
        if self._reference is None:
            order = BoardOrder("inproc", "", None, lambda line: None)
            self._reference_host = plug_in("inproc", order)
            self._reference = Bench(Talk(self._reference_host.link, None))
        return self._reference

    def why_gone(self) -> str:
        """What became of a board of ours that has died; "" where it lives, or is not ours."""
        try:
            if self._host is not None:
                self._host.check_alive()
        except LinkFailure as failure:
            return str(failure)
        return ""

    def revive(self) -> bool:
        """After a failure: whether the board answers HELLO again. A board of ours is started anew for that, once."""
        with suppress(Silent, LinkError):
            self.bench.settle()  # what the check that failed had left
            self.bench.greet()
            return True
        if not self.order.launched or self.restarts:
            return False
        self.restarts += 1
        with suppress(Silent, LinkError, SilError):
            self.replug()
            self.bench.greet()
            return True
        return False


def deadline(within_s: float) -> Callable[[], float]:
    """A function that says how many seconds are left, never below 0."""
    give_up = time.monotonic() + within_s
    return lambda: max(0.0, give_up - time.monotonic())
