"""Numbers: packets of a flight that the reference flew, into the board; its answers have to be the same bytes.

The flight is a scenario's first ticks in lockstep, with a noisy sensor and some SAMPLEs lost on the way, so that the
law's model is flown on too. Then how long an answer takes, SAMPLE by SAMPLE.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from protocol import frames
from protocol.channel import TO_BOARD, Clear, Fate, wire_time_ns
from protocol.codec import encode
from protocol.frames import Type, unpack
from protocol.law_tables import LAWS
from sil.board_test.bench import Bench
from sil.board_test.examinee import Examinee
from sil.board_test.made import sample, words_of
from sil.board_test.outcome import PASS, Failed, Skipped, passed
from sil.board_test.twin import difference
from sil.budget.flight import Flight, fly
from sil.doctor.findings import Finding
from sil.doctor.verdicts import PERCENTILES, histogram
from sil.scenario import Scenario, load_scenario
from sil.trouble import SilError, UsageError

LOST_EVERY, LOST_IN_A_ROW = 23, 2  # SAMPLEs: two of every 23
NOISE_DEG = 0.02
BARS, BAR_WIDTH = 10, 26
HEAVIEST = ("mrac", "appc", "pd")


class Gaps(Clear):
    """A clear channel that loses some SAMPLEs, always the same."""

    def fates(
        self, direction: str, tick: int, frame_type: int, number: int, encoded_len: int, t_ns: int
    ) -> tuple[Fate, ...]:
        if direction == TO_BOARD and frame_type == Type.SAMPLE and tick % LOST_EVERY >= LOST_EVERY - LOST_IN_A_ROW:
            return (Fate(False, t_ns, "gap"),)
        return super().fates(direction, tick, frame_type, number, encoded_len, t_ns)


def scenario_of(name: str, ticks: int) -> Scenario:
    """The first `ticks` ticks of a scenario, as flown here. Raises ScenarioInvalid, UsageError."""
    plain = load_scenario(name)
    if plain.board == "none" or (plain.law_table.law_id, plain.law_table.version) not in LAWS:
        raise UsageError(f"--flight: expected a scenario with a law of the product, got {name!r}")
    duration_s = min(ticks, plain.ticks) * plain.period_s
    noise = plain.sensors.attitude.noise_deg or NOISE_DEG
    sets = (f"duration_s={duration_s!r}", "board=inproc", "clock=lockstep", "law.form=fixed", "require=[]")
    return load_scenario(name, [*sets, f"sensors.attitude.noise_deg={noise}"])


def law_of(name: str) -> str:
    """The law of a scenario."""
    return load_scenario(name).law.name


# -- numbers -----------------------------------------------------------------------------------------------------------


def numbers(at: Examinee, name: str) -> Finding:
    """One flight into the board."""
    scenario = scenario_of(name, at.order.ticks)
    law = scenario.law_table
    if law.name not in [table.name for table in at.laws]:
        raise Skipped(f"{name}: the board has no law {law.name}")
    at.tell(f"flying {name} with the reference")
    try:
        flight = fly(scenario, Gaps(scenario.link.baud))
    except SilError as error:
        raise Failed(f"{name}: the reference does not fly it: {error}") from None
    _configure(at.bench, flight)
    frames_compared = 0
    for sent, answer in flight.ticks:
        tick, expected = unpack(sent).tick, [unpack(packet) for packet in answer]
        at.tell(f"{name}: tick {tick} of {len(flight.ticks)}")
        if said := difference(expected, at.bench.answer(sent, tick)):
            raise Failed(f"{law.name}: {said}", data={"scenario": name, "first_differing_tick": tick})
        frames_compared += len(expected)
    said = f"{name}: {len(flight.ticks)} ticks, {frames_compared} frames, the same bytes"
    return passed(said, scenario=name, law=law.name, ticks=len(flight.ticks), frames=frames_compared)


def _configure(bench: Bench, flight: Flight) -> None:
    """The recorded packets, numbers and all."""
    bench.greet()
    bench.port.write(*flight.config)
    ready = bench.ready()
    if ready.status != frames.READY_OK:
        raise Failed(f"CONFIG of the flight: expected READY status 0, got {ready.status}, index {ready.index}")


# -- how fast ----------------------------------------------------------------------------------------------------------


def latency(at: Examinee) -> Finding:
    """SAMPLE to the whole answer, with the heaviest law the board has."""
    table, bench = at.law_named(*HEAVIEST), at.bench
    words = words_of(table)
    bench.open(words)
    times_ns, size = [], 0
    for tick in range(at.order.exchanges):
        at.tell(f"SAMPLE {tick + 1} of {at.order.exchanges}")
        packet = bench.port.pack(sample(tick))
        began_ns = time.perf_counter_ns()
        got = bench.answer(packet, tick)
        times_ns.append(time.perf_counter_ns() - began_ns)
        size = sum(len(encode(each)) for each in (packet, *(answer.raw for answer in got)))
    return _timed(table.name, np.array(times_ns) / 1000.0, wire_time_ns(size, at.baud) / 1000, words[3])


def _timed(law: str, times_us: np.ndarray[Any, Any], wire_us: float, period_us: int) -> Finding:
    figures = {name: round(float(np.percentile(times_us, q)), 1) for name, q in PERCENTILES.items()}
    scale, unit = (1000.0, "ms") if figures["p50"] >= 1000.0 else (1.0, "us")
    shown = ", ".join(f"{name.replace('_', '.')} {figure(value / scale)}" for name, value in figures.items())
    wire = f", of which {figure(wire_us / scale)} on the wire" if wire_us else ""
    said = f"{law}, {len(times_us)} SAMPLEs: {shown} {unit}{wire}"
    counts, edges = histogram(times_us, BARS)
    data = {"law": law, "us": figures, "wire_us": round(wire_us, 1), "exchanges": len(times_us),
            "histogram": {"edges_us": [round(edge, 1) for edge in edges], "counts": counts}}  # fmt: skip
    lines = chart(counts, [edge / scale for edge in edges], unit)
    if figures["max"] > period_us:
        raise Failed(f"{said}; T_s is {period_us / scale:g} {unit}: an answer after that is late", lines, data)
    return Finding(PASS, said, lines=tuple(lines), data=data)


def chart(counts: list[int], edges: list[float], unit: str) -> list[str]:
    """A bar for each bin, `   41.2 -    57 us  ████  12`; a bin with any at all shows a mark."""
    most = max(counts)
    rows = []
    for count, low, high in zip(counts, edges, edges[1:], strict=False):
        bar = "█" * max(round(count / most * BAR_WIDTH), int(count > 0))
        rows.append(f"{figure(low):>7} - {figure(high):>6} {unit}  {bar} {count or ''}".rstrip())
    return rows


def figure(value: float) -> str:
    """Three digits or more, never an exponent."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"
