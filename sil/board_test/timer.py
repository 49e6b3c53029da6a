"""SPEC B3, the board's own timer: when it fires, how a SAMPLE sets it, and how its clock runs against this one.

The lab's clock is faster than real time here (HELLO says so), so that a board that does not divide by it is found too.
Nothing but the board's timer makes it step then, and its COMMANDs arrive at

    t_j = t_SAMPLE + (j - k) T + sample_timeout + way,    T = T_s / rate

A straight line through (j, t_j) has the slope T (1 - e), e being how much too fast the board's clock is. Arrivals can
be late, for many ticks in a row where this machine is busy, but never early. So only the least late one of each block
of ticks counts (`fit`), and how these scatter about their line is the uncertainty. The measure is this machine's
CLOCK_MONOTONIC, which NTP may slew by some ten ppm.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from protocol import frames
from protocol.frames import Type
from protocol.law_tables import LawTable
from sil.board_test.bench import Bench
from sil.board_test.examinee import Examinee
from sil.board_test.made import sample, words_of
from sil.board_test.outcome import USED, Failed, Silent, Skipped, called, passed
from sil.doctor.findings import Finding

TIMEOUT = 0.5  # sample_timeout in periods: so long that a timer without it is found
FEWEST = 20  # ticks
WORST_PPM = 10_000.0  # sample_timeout, by default 0.2 T_s, is used up within the 20 ticks of the link watchdog
CRYSTAL_PPM = 200.0
MOST_BLOCKS, SMALLEST_BLOCK = 20, 4  # of ticks, of which the least late one counts
STALE_BY = 4
ARRIVES_WITHIN_S = 4.0


class Pace(NamedTuple):
    """Simulated period T_s and simulated seconds per wall second; every law flies these."""

    period_s: float
    rate: int

    @property
    def wall_s(self) -> float:
        """A period on the wall."""
        return self.period_s / self.rate


PACE = Pace(0.2, 4)
PACES = (PACE, Pace(0.2, 2), Pace(0.4, 2))  # tried in turn: this machine may be late, a wrong timer is wrong each time


class Fit(NamedTuple):
    """t = at_s + slope_s * n; error_s: standard error of the slope; rms_s: about the line; used: points."""

    at_s: float
    slope_s: float
    error_s: float
    rms_s: float
    used: int


def fit(numbers: np.ndarray[Any, Any], times_s: np.ndarray[Any, Any]) -> Fit:
    """The line below arrivals: through the least late of each block of ticks; numbers, times_s: (n,), n >= FEWEST."""
    slope, at = np.polyfit(numbers, times_s, 1)
    late_s = times_s - (at + slope * numbers)
    blocks = np.array_split(np.arange(len(numbers)), min(MOST_BLOCKS, len(numbers) // SMALLEST_BLOCK))
    least = np.array([block[np.argmin(late_s[block])] for block in blocks])
    n, t = numbers[least], times_s[least]
    slope, at = np.polyfit(n, t, 1)
    left = t - (at + slope * n)
    rms = float(np.sqrt(np.sum(left**2) / (len(n) - 2)))
    return Fit(float(at), float(slope), rms / float(np.sqrt(np.sum((n - n.mean()) ** 2))), rms, len(n))


def _needs_a_timer(at: Examinee) -> LawTable:
    table = at.law
    hello = at.bench.greet()
    if not hello.flags & frames.HELLO_OWN_TIMER:
        raise Skipped("the board has no timer of its own (HELLO): it is fit for lockstep only")
    return table


def steps(at: Examinee) -> Finding:
    """When the timer fires: T_s + sample_timeout behind a SAMPLE, later behind a stale one, by as much as it is old."""
    table = _needs_a_timer(at)
    for pace in PACES:
        at.tell(f"the timer's steps, {pace.wall_s * 1000:g} ms each")
        try:
            _steps(at.bench, table, pace)
            break
        except Failed:
            if pace == PACES[-1]:
                raise
            at.bench.settle()
    return passed(f"T_s + sample_timeout, then every T_s; a SAMPLE sets it, a stale one too; {pace.rate} x real time")


def _steps(bench: Bench, table: LawTable, pace: Pace) -> None:
    """One session of it, all times in periods of the wall."""
    wall_s, patient = pace.wall_s, 1.0 + TIMEOUT

    def expect_at(what: str, since_s: float, tick: int, periods: float) -> float:
        arrived_s = _arrival(bench, tick)
        if abs(arrived_s - since_s - periods * wall_s) > wall_s / 4:
            got_ms = (arrived_s - since_s) * 1000
            raise Failed(f"{what}: expected {periods * wall_s * 1000:.0f} ms, got {got_ms:.0f} ms")
        return arrived_s

    _open(bench, table, pace)
    first_s = expect_at("the first step of the timer behind SAMPLE(0)", _send(bench, 0), 1, patient)
    expect_at("its second step, behind the first", first_s, 2, 1.0)
    time.sleep(wall_s / 2)  # a timer that is not set goes off in the middle
    expect_at("its step behind SAMPLE(3)", _send(bench, 3), 4, patient)
    for tick in range(5, 3 + STALE_BY):
        _arrival(bench, tick)
    sent_s = _send(bench, 3, stale=True)
    expect_at(f"its step behind a stale SAMPLE, {STALE_BY} old", sent_s, 3 + STALE_BY, STALE_BY - 1 + patient)
    _silent_after_stop(bench, wall_s)


def drift(at: Examinee) -> Finding:
    """How fast the board's clock runs, from ticks that its timer alone makes it step."""
    bench, table = at.bench, _needs_a_timer(at)
    wall_s = PACE.wall_s
    _open(bench, table, PACE)
    count = max(FEWEST, round(at.order.drift_s / wall_s))
    _send(bench, 0)
    times = []
    for tick in range(1, count + 1):
        at.tell(f"watching the board's timer: {(count - tick) * wall_s:.0f} s left")
        times.append(_arrival(bench, tick))
    _silent_after_stop(bench, wall_s)
    found = fit(np.arange(1, count + 1), np.array(times))
    ppm, error = (1.0 - found.slope_s / wall_s) * 1e6, found.error_s / wall_s * 1e6  # a fast clock has short periods
    said = f"{abs(ppm):.1f} ± {2 * error:.1f} ppm {'fast' if ppm >= 0 else 'slow'} against this machine's clock"
    data = {"ppm": round(ppm, 3), "two_sigma_ppm": round(2 * error, 3), "ticks": count, "blocks": found.used,
            "rms_us": round(found.rms_s * 1e6, 1), "seconds": round(count * wall_s, 3)}  # fmt: skip
    line = (
        f"2 sigma; the least late of {found.used} blocks of {count} ticks, {found.rms_s * 1e6:.1f} us rms about a line"
    )
    if abs(ppm) - 2 * error > WORST_PPM:
        why = "within 20 ticks it is off by sample_timeout"
        raise Failed(f"{said}: expected at most {WORST_PPM:.0f} ppm: {why}", [line], data)
    note = "; more than a crystal has" if abs(ppm) - 2 * error > CRYSTAL_PPM else ""
    return passed(said + note, [line], **data)


def _open(bench: Bench, table: LawTable, pace: Pace) -> None:
    period_us = round(pace.period_s * 1e6)
    words = words_of(
        table,
        period_us=period_us,
        sample_timeout_us=round(TIMEOUT * period_us),
        link_limit=1_000_000,
        telemetry_every=0,
    )
    ready = bench.open(words, pace.rate * 65536)
    if ready.status != frames.READY_OK:
        raise Failed(f"CONFIG at {pace.rate} x real time: expected READY status 0, got {ready.status}")


def _send(bench: Bench, tick: int, stale: bool = False) -> float:
    """SAMPLE(tick), answered at once unless it is stale; when it left, s."""
    packet = bench.port.pack(sample(tick))
    sent_s = time.monotonic()
    if stale:
        bench.port.write(packet)
    else:
        bench.answer(packet, tick)
    return sent_s


def _arrival(bench: Bench, tick: int) -> float:
    """When the COMMAND came that the timer made, s of CLOCK_MONOTONIC."""
    got = bench.until(lambda packet: packet.type == Type.COMMAND, ARRIVES_WITHIN_S, f"timer, tick {tick}")
    arrived_s, packet = time.monotonic(), got[-1]
    if packet.tick != tick:
        raise Failed(f"steps of the timer: expected COMMAND({tick}), got {called(packet)}")
    if packet.frame.used == frames.USED:
        raise Failed(f"COMMAND({tick}) of the timer: expected propagated or repeated, got {USED[packet.frame.used]}")
    return arrived_s


def _silent_after_stop(bench: Bench, wall_s: float) -> None:
    """STOP stops the timer."""
    bench.send(frames.Stop(frames.STOP_DONE))
    bench.settle()
    try:
        got = bench.until(lambda packet: packet.type == Type.COMMAND, 3 * wall_s, "STOP")
    except Silent:
        return
    raise Failed(f"after STOP: expected no step of the timer, got {called(got[-1])}")
