"""SPEC B3, the board's own timer: when it fires, how a SAMPLE sets it, and how its clock runs against this one.

The lab's clock is four times real time here (HELLO says so), so that a board that does not divide by it is found too.
Nothing but the board's timer makes it step then, and its COMMANDs arrive at

    t_j = t_SAMPLE + (j - k) T + sample_timeout + way,    T = T_s / rate

A straight line through (j, t_j) has the slope T (1 - e), e being how much too fast the board's clock is. Arrivals can
be late, never early, so the line is fitted again without those that are late by more than three typical deviations.
Its slope's standard error is the uncertainty; this machine's CLOCK_MONOTONIC, which NTP may slew, is the measure.
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

RATE = 4
PERIOD_S = 0.2  # every law flies it; 50 ms of the wall
TIMEOUT_S = 0.04  # a fifth of T_s, as it is by default
WALL_S = PERIOD_S / RATE
FEWEST = 20  # ticks
LINK_LIMIT = 20
WORST_PPM = 1e6 * TIMEOUT_S / PERIOD_S / LINK_LIMIT  # the timer stays within sample_timeout over link_limit ticks
CRYSTAL_PPM = 200.0
LATE = 3.0  # typical deviations
STALE_BY = 4


class Fit(NamedTuple):
    """t = at_s + slope_s * n; error_s: standard error of the slope; rms_s: of what is left; used: points."""

    at_s: float
    slope_s: float
    error_s: float
    rms_s: float
    used: int


def fit(numbers: np.ndarray[Any, Any], times_s: np.ndarray[Any, Any]) -> Fit:
    """The line through arrivals, those that are late apart; numbers, times_s: (n,)."""
    keep = np.ones(len(numbers), bool)
    for _ in range(3):
        n, t = numbers[keep], times_s[keep]
        slope, at = np.polyfit(n, t, 1)
        left = times_s - (at + slope * numbers)
        typical = 1.4826 * float(np.median(np.abs(left[keep] - np.median(left[keep])))) or 1e-9
        keep = left - np.median(left[keep]) <= LATE * typical
    n, t = numbers[keep], times_s[keep]
    slope, at = np.polyfit(n, t, 1)
    left = t - (at + slope * n)
    rms = float(np.sqrt(np.sum(left**2) / max(1, len(n) - 2)))
    return Fit(float(at), float(slope), rms / float(np.sqrt(np.sum((n - n.mean()) ** 2))), rms, len(n))


def _needs_a_timer(at: Examinee) -> LawTable:
    table = at.law
    hello = at.bench.greet()
    if not hello.flags & frames.HELLO_OWN_TIMER:
        raise Skipped("the board has no timer of its own (HELLO): it is fit for lockstep only")
    return table


def steps(at: Examinee) -> Finding:
    """When the timer fires: T_s + sample_timeout behind a SAMPLE, later behind a stale one, by as much as it is old."""
    bench, table = at.bench, _needs_a_timer(at)
    _open(bench, table)
    sent_s = _send(bench, 0)
    first = _arrival(bench, 1)
    _at("the first step of the timer behind SAMPLE(0)", first - sent_s, WALL_S + TIMEOUT_S / RATE)
    second = _arrival(bench, 2)
    _at("its second step, behind the first", second - first, WALL_S)
    sent_s = _send(bench, 3)
    _at("its step behind SAMPLE(3)", _arrival(bench, 4) - sent_s, WALL_S + TIMEOUT_S / RATE)
    for tick in range(5, 3 + STALE_BY):
        _arrival(bench, tick)
    sent_s = _send(bench, 3, stale=True)
    _at(f"its step behind a stale SAMPLE, {STALE_BY} ticks old", _arrival(bench, 3 + STALE_BY) - sent_s,
        STALE_BY * WALL_S + TIMEOUT_S / RATE)  # fmt: skip
    _silent_after_stop(bench)
    return passed(f"after T_s + sample_timeout, then every T_s; a SAMPLE sets it, a stale one too; {RATE} x real time")


def drift(at: Examinee) -> Finding:
    """How fast the board's clock runs, from ticks that its timer alone makes it step."""
    bench, table = at.bench, _needs_a_timer(at)
    _open(bench, table)
    count = max(FEWEST, round(at.order.drift_s / WALL_S))
    _send(bench, 0)
    times = []
    for tick in range(1, count + 1):
        at.tell(f"watching the board's timer: {(count - tick) * WALL_S:.0f} s left")
        times.append(_arrival(bench, tick))
    _silent_after_stop(bench)
    found = fit(np.arange(1, count + 1), np.array(times))
    fast = 1.0 - found.slope_s / WALL_S  # a fast clock has short periods
    ppm, error = fast * 1e6, found.error_s / WALL_S * 1e6
    word = "fast" if ppm >= 0 else "slow"
    said = f"{abs(ppm):.1f} ± {2 * error:.1f} ppm {word} against this machine's clock"
    data = {"ppm": round(ppm, 3), "two_sigma_ppm": round(2 * error, 3), "ticks": count, "used": found.used,
            "rms_us": round(found.rms_s * 1e6, 1), "seconds": round(count * WALL_S, 3)}  # fmt: skip
    line = f"{count} ticks of {WALL_S * 1000:g} ms, arrivals {found.rms_s * 1e6:.0f} us rms about the line (2 sigma)"
    if abs(ppm) - 2 * error > WORST_PPM:
        why = f"within {LINK_LIMIT} ticks it leaves sample_timeout, 0.2 T_s"
        raise Failed(f"{said}: expected at most {WORST_PPM:.0f} ppm, for {why}", [line], data)
    note = "; more than a crystal has" if abs(ppm) - 2 * error > CRYSTAL_PPM else ""
    return passed(said + note, [line], **data)


def _open(bench: Bench, table: LawTable) -> None:
    words = words_of(
        table, period_us=round(PERIOD_S * 1e6), sample_timeout_us=round(TIMEOUT_S * 1e6), link_limit=1_000_000,
        telemetry_every=0,
    )  # fmt: skip
    ready = bench.open(words, RATE * 65536)
    if ready.status != frames.READY_OK:
        raise Failed(f"CONFIG at {RATE} x real time: expected READY status 0, got {ready.status}")


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
    got = bench.until(lambda packet: packet.type == Type.COMMAND, 2.0 + 2 * STALE_BY * WALL_S, f"timer, tick {tick}")
    arrived_s, packet = time.monotonic(), got[-1]
    if packet.tick != tick:
        raise Failed(f"steps of the timer: expected COMMAND({tick}), got {called(packet)}")
    if packet.frame.used == frames.USED:
        raise Failed(f"COMMAND({tick}) of the timer: expected propagated or repeated, got {USED[packet.frame.used]}")
    return arrived_s


def _at(what: str, got_s: float, expected_s: float) -> None:
    """Within a quarter of a period; what is late by more, this machine may be to blame for, so it is said in ms."""
    if abs(got_s - expected_s) > WALL_S / 4:
        raise Failed(f"{what}: expected {expected_s * 1000:.0f} ms, got {got_s * 1000:.0f} ms")


def _silent_after_stop(bench: Bench) -> None:
    """STOP stops the timer."""
    bench.send(frames.Stop(frames.STOP_DONE))
    bench.settle()
    try:
        got = bench.until(lambda packet: packet.type == Type.COMMAND, 3 * WALL_S, "STOP")
    except Silent:
        return
    raise Failed(f"after STOP: expected no step of the timer, got {called(got[-1])}")
