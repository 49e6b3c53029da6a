"""A link that the scenario disconnects: what is held, what is zero, what the board does meanwhile; both ways."""

from __future__ import annotations

from protocol import events, frames
from protocol.frames import FRESH, HELD, PROPAGATED, USED, ZERO, Type

TICKS = 40
DROPPED = 2


def down(at_s, for_s=None):
    return {"at_s": at_s, "do": "link.disconnect", "for_s": for_s}


def flown(lab, *planned, **values):
    bench = lab(None, events=planned, **values)
    return bench, bench.run()


def test_nothing_passes_either_way(lab):
    bench, rows = flown(lab, down(5, 4))
    lost = sorted((frames.unpack(p).tick, d, p[1]) for _, d, fate, p in rows.packets if fate == DROPPED)
    kinds = {(0, Type.SAMPLE), (1, Type.COMMAND), (1, Type.TELEMETRY), (1, Type.EVENT)}
    assert {tick for tick, *_ in lost} == set(range(10, 18))
    assert {(direction, kind) for _, direction, kind in lost} == kinds
    assert bench.rig.window.missed == 8
    assert bench.rig.window.real_misses == 0
    assert rows.events_with(events.LINK_DOWN) == [(10, 10, 8)]
    assert rows.events_with(events.LINK_UP) == [(18, 18, 8)]
    assert rows.events_with(events.BOARD_RESTARTED) == []


def test_the_board_steps_every_tick_and_the_torque_is_held_and_then_zero(lab):
    _, rows = flown(lab, down(5, 8), hold_limit=4, link_limit=10)
    used = {command.tick: command.used for command in rows.commands()}
    assert [used[k] for k in range(TICKS)] == [PROPAGATED if 10 <= k < 26 else USED for k in range(TICKS)]
    assert rows.sources()[10:28] == [FRESH, *[HELD] * 4, *[ZERO] * 12, FRESH]
    watchdog = [c.tick for c in rows.commands() if c.flags & frames.FLAG_WATCHDOG]
    assert watchdog == list(range(19, 26))
    assert rows.events_with(events.HOLD_LIMIT) == [(15, 14, 5)]
    assert rows.events_with(events.RECOVERED) == [(27, 26, 16)]


def test_to_the_end(lab):
    _, rows = flown(lab, down(15))
    assert rows.sources()[30:] == [FRESH, *[HELD] * 9]
    assert rows.events_with(events.LINK_UP) == []


def test_a_command_on_the_wire_is_lost_with_the_link(lab):
    """COMMAND(9) leaves 0.345 s after t_9 and SAMPLE(9) came through; the link goes down 0.3 s after t_9."""
    _, rows = flown(lab, down(4.8, 0.04), answer_delay_s=0.345)
    lost = {(frames.unpack(p).tick, p[1]) for _, _, fate, p in rows.packets if fate == DROPPED}
    assert lost == set()
    _, rows = flown(lab, down(4.8, 0.1), answer_delay_s=0.345)
    lost = {(frames.unpack(p).tick, Type(p[1])) for _, _, fate, p in rows.packets if fate == DROPPED}
    assert lost == {(9, Type.COMMAND), (9, Type.TELEMETRY)}
    assert [tick for _, tick, _ in rows.events_with(events.COMMAND_MISSED)] == [9]
