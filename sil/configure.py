"""Scenario to CONFIG: what the board is told before a run, as the int32 words of protocol/law_tables.py.

The lab resolves what needs a transcendental function or a name (poles, profiles, limits); the board gets integers.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

from protocol import law_tables
from protocol.law_tables import Configuration, LawTable
from sil.scenario import Scenario

TURN_BAM = 2**32

Row = tuple[int, int, int, int]  # tick, x, y, z in 2^-32 turn


class Orders(NamedTuple):
    """Everything the board is told: CONFIG words, and what both ends read out of them.

    rows: the set-points; the board has them in CONFIG too, unless it takes them from each SAMPLE.
    """

    table: LawTable
    words: tuple[int, ...]
    configuration: Configuration
    rows: tuple[Row, ...]


def row_at(rows: tuple[Row, ...], tick: int) -> tuple[int, int, int]:
    """The x, y, z of the last row at or before `tick`; zero before the first."""
    place = bisect_right(rows, tick, key=lambda row: row[0])
    return rows[place - 1][1:] if place else (0, 0, 0)


def orders(scenario: Scenario) -> Orders:
    """CONFIG of a scenario. Raises ConfigError where a value does not fit its word."""
    period_s, table = scenario.period_s, scenario.law_table
    guidance, wire = scenario.guidance, scenario.wire
    limits = scenario.actuators.command_max
    values: dict[str, law_tables.Value] = {
        "form": scenario.law.form,
        "period_us": scenario.period_us,
        "transport_delay_ticks": scenario.transport_delay_ticks,
        "hold_limit": scenario.hold_limit,
        "link_limit": scenario.link_limit,
        "sample_timeout_us": scenario.sample_timeout_us,
        "answer_delay_us": round(scenario.answer_delay_s * 1e6),
        "telemetry_every": scenario.telemetry_every,
        "torque_bits": scenario.torque_bits,
        "momentum_bits": wire.momentum_bits,
        "rate_bits": wire.rate_bits,
        "torque_limit": tuple(math.inf if limit is None else limit for limit in limits),
        "reference_kind": guidance.reference,
        "reference_pole": math.exp(-guidance.wn_radps * period_s),
        "rate_limit": _bam(guidance.rate_limit_degps or 0.0, period_s),
        "accel_limit": _bam(guidance.accel_limit_degps2 or 0.0, period_s**2),
        "setpoint_source": guidance.setpoint_source,
        "stale": scenario.stale,
        "attitude_sequence": str(scenario.attitude.sequence),
        **scenario.law_values(),
    }
    rows = guidance_rows(scenario)
    words = law_tables.config_words(table, values, rows if guidance.setpoint_source == "table" else ())
    return Orders(table, words, law_tables.parse_configuration(words, table), rows)


def guidance_rows(scenario: Scenario) -> tuple[Row, ...]:
    """The named profile as (tick, x, y, z) in 2^-32 turn."""
    return tuple((row.tick, *(_bam(angle, 1.0) for angle in row.xyz_deg)) for row in scenario.setpoints())  # type: ignore[misc]


def _bam(angle_deg: float, factor: float) -> int:
    """`angle_deg` * factor in 2^-32 turn, wrapped to int32."""
    counts = round(angle_deg / 360.0 * factor * TURN_BAM)
    return (counts + TURN_BAM // 2) % TURN_BAM - TURN_BAM // 2
