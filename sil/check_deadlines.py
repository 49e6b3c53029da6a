"""Does a tick's work fit into its period: SAMPLE and COMMAND on the wire, their delays, the board's execution time."""

from __future__ import annotations

from collections.abc import Iterator

from protocol import codec, frames
from protocol.channel import wire_time_ns
from protocol.law_tables import TELEMETRY_COMMON
from sil.check_findings import Finding, error, warning
from sil.scenario import Scenario
from sil.scenario_errors import shown
from sil.sensors import SENSORS


def deadline(scenario: Scenario) -> Iterator[Finding]:
    """SAMPLE against sample_timeout, COMMAND against n T_s: wire, delay, execution; what fits into a period."""
    if scenario.expect_missed:
        return
    up_s, timeout_s = wire_times_s(scenario)[0], scenario.sample_timeout_us * 1e-6
    delay_s = scenario.link.models()[0].delay_ns * 1e-9
    if up_s + delay_s > timeout_s:
        expected = f"SAMPLE within sample_timeout_s ({timeout_s:g} s), or expect_missed: true"
        got = f"{_ms(up_s)} on the wire + {_ms(delay_s)} delay: every one is late"
        yield error(scenario, _said(scenario, "up", "delay_s") if delay_s > up_s else "link.baud", expected, got)
    else:
        yield from _command_deadline(scenario, up_s + delay_s)


def _command_deadline(scenario: Scenario, to_board_s: float) -> Iterator[Finding]:
    """`to_board_s`: wire and delay of SAMPLE."""
    up_s, command_s, answer_s = wire_times_s(scenario)
    back_s = scenario.link.models()[1].delay_ns * 1e-9
    busy_s, period_s, n = scenario.answer_delay_s, scenario.period_s, scenario.transport_delay_ticks
    wires_s, delays_s = up_s + answer_s, to_board_s - up_s + back_s
    key = "answer_delay_s" if busy_s > wires_s + delays_s else "link.baud"
    if delays_s > max(wires_s, busy_s):
        key = _said(scenario, "down" if back_s > to_board_s - up_s else "up", "delay_s")
    whole_s = to_board_s + busy_s + command_s + back_s
    if n and whole_s >= n * period_s:
        parts = f"{_ms(to_board_s)} up + {_ms(busy_s)} execution + {_ms(command_s + back_s)} down = {_ms(whole_s)}"
        yield error(scenario, key, f"COMMAND within {n} x {period_s:g} s, or expect_missed: true", parts)
    elif busy_s >= period_s:
        expected = f"a number in s below the period ({period_s:g}), or expect_missed: true"
        yield error(scenario, "answer_delay_s", expected, shown(busy_s))
    elif max(up_s, answer_s) >= period_s:
        got = f"{_ms(up_s)} up, {_ms(answer_s)} down"
        yield error(scenario, "link.baud", f"frames of one tick within {period_s:g} s each way", got)
    else:
        yield from _jitter(scenario, to_board_s, whole_s)


def _jitter(scenario: Scenario, up_s: float, whole_s: float) -> Iterator[Finding]:
    """Frames that are in time without jitter, and some of which are late with it."""
    up, down = (0.0 if each.jitter is None else each.jitter.max_ns * 1e-9 for each in scenario.link.models())
    timeout_s, n = scenario.sample_timeout_us * 1e-6, scenario.transport_delay_ticks
    if up_s <= timeout_s < up_s + up:
        got = f"up to {_ms(up_s + up)}: some are late"
        yield warning(
            scenario, _said(scenario, "up", "jitter"), f"SAMPLE within sample_timeout_s ({timeout_s:g} s)", got
        )
    if n and whole_s + min(up, max(timeout_s - up_s, 0.0)) + down >= n * scenario.period_s:
        got = f"up to {_ms(whole_s + up + down)}: some are late"
        way = "down" if down > up else "up"
        yield warning(scenario, _said(scenario, way, "jitter"), f"COMMAND within {n} x {scenario.period_s:g} s", got)


def _said(scenario: Scenario, way: str, key: str) -> str:
    """Where this fault of one direction is said."""
    own = getattr(getattr(scenario.link.faults, way), key) is not None
    return f"link.faults.{way}.{key}" if own else f"link.faults.{key}"


def wire_times_s(scenario: Scenario) -> tuple[float, float, float]:
    """Modelled time on the wire of SAMPLE, COMMAND, and COMMAND with TELEMETRY, in s; without events."""
    values = ((0,) * 3, (0,) * 4, (0,) * 3)
    on = [getattr(scenario.sensors, name).enabled for name in SENSORS]
    readings = tuple(frames.Reading(0, v) if flag else None for v, flag in zip(values, on, strict=True))
    zero = (0, 0, 0)
    up, down = scenario.link.models()
    sample = _wire_s(up.baud, frames.Sample(0, zero, zero, zero, 0, 0, 0, 0, readings))  # type: ignore[arg-type]
    command = _wire_s(down.baud, frames.Command(0, zero, 0, 0, frames.USED))
    words = (0,) * (len(TELEMETRY_COMMON) + len(scenario.law_table.telemetry))
    telemetry = _wire_s(down.baud, frames.Telemetry(0, 0, 0, words)) if scenario.telemetry_every else 0.0
    return sample, command, command + telemetry


def _wire_s(baud: int | None, frame: frames.Frame) -> float:
    return wire_time_ns(len(codec.encode(frames.pack(frame, 0))), baud) * 1e-9


def _ms(time_s: float) -> str:
    return f"{time_s * 1e3:.3g} ms"
