"""What -v says of link, session and rig before a run, and what a plain line says of its progress."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from sil.screen.messages import State, error_deg

if TYPE_CHECKING:
    from sil.rig import Rig
    from sil.scenario import Scenario


def lines(scenario: Scenario, rig: Rig) -> Iterator[str]:
    """A fact a line: clock and period, board and session, link, law and its table, limits."""
    period_ms = scenario.period_ns * 1e-6
    wall = f", {period_ms / rig.clock.scale:g} ms on the wall" if rig.clock.paced else ""
    yield f"clock: {scenario.clock.mode}, period {period_ms:g} ms{wall}, {scenario.ticks} ticks"
    if rig.session is None or rig.orders is None or rig.session.board is None:
        yield "board: none; torque comes from a schedule"
        return
    kind, url = rig.plugged
    board, table = rig.session.board, rig.orders.table
    yield f"board: {kind}, build {board.build!r}, protocol {board.protocol_version}, layout {board.layout_hash:08x}"
    baud = f", modelled at {scenario.link.baud} baud" if scenario.link.baud else ""
    yield f"link: {url}{baud}, transport delay {scenario.transport_delay_ticks} ticks"
    configuration = rig.orders.configuration
    yield (
        f"session: law {table.name} version {table.version} ({scenario.law.form}), {len(rig.orders.words)} words in "
        f"{len(rig.config_packets)} CONFIG packets, table {configuration.hash:08x}"
    )
    yield (
        f"limits: hold {scenario.hold_limit} ticks, link watchdog {scenario.link_limit} ticks, "
        f"restarts {scenario.restart_limit}, "
        f"sample timeout {scenario.sample_timeout_us / 1000:g} ms, answer delay {scenario.answer_delay_s * 1000:g} ms"
    )


def progress(state: State, done: int, ticks: int) -> str:
    """` 62 %  t    372.5 s   attitude   -0.55    0.00   -0.03 deg   error ...   late ...`"""
    text = f"{100 * done // ticks:3d} %  t {state.t_s:8.1f} s   attitude {_three(state.attitude_deg, 2)} deg"
    error = error_deg(state.held_against) if state.held_against is not None else None
    if error is not None:
        text += f"   error {_three(error, 3)}"
    if state.late_ns:
        text += f"   late at most {max(state.late_ns) * 1e-6:.2f} ms"
    missed = state.counters.get("missed", 0)
    return text + (f"   missed {missed}" if missed else "")


def _three(values: tuple[float, float, float], decimals: int) -> str:
    return " ".join(f"{value:7.{decimals}f}" for value in values)
