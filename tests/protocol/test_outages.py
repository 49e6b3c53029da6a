"""Outages of the modelled channel: what is on the wire at any time of one is lost, and every frame has one decision."""

from __future__ import annotations

import pytest

from protocol.channel import TO_BOARD, TO_LAB, Clear, Fate
from protocol.frames import Type
from protocol.outages import Disconnect, Disconnected, PowerOff

S = 1_000_000_000


def fate(channel, sent_ns, tick=0, direction=TO_BOARD, size=63):
    (one,) = channel.fates(direction, tick, Type.SAMPLE, 0, size, sent_ns)
    return one


@pytest.mark.parametrize("direction", [TO_BOARD, TO_LAB])
@pytest.mark.parametrize(
    ("sent_ns", "passes"), [(10 * S - 1, True), (10 * S, False), (12 * S - 1, False), (12 * S, True)]
)
def test_nothing_passes_either_way_while_the_link_is_down(direction, sent_ns, passes):
    channel = Disconnected(Clear(None), [Disconnect(10 * S, 12 * S)])
    assert fate(channel, sent_ns, direction=direction) == Fate(passes, sent_ns, "" if passes else "disconnect")


def test_a_frame_that_is_on_the_wire_when_the_link_goes_down_is_lost():
    channel = Disconnected(Clear(115200), [Disconnect(10 * S, 12 * S)])
    wire_ns = fate(Clear(115200), 0).arrival_ns
    assert not fate(channel, 10 * S - wire_ns).delivered
    assert fate(channel, 10 * S - wire_ns - 1).delivered


def test_each_copy_is_taken_by_its_own_arrival():
    class Twice:
        def fates(self, direction, tick, frame_type, number, encoded_len, t_ns):
            return Fate(True, t_ns + 1), Fate(True, t_ns + 5)

    channel = Disconnected(Twice(), [Disconnect(10 * S + 3, 12 * S)])
    assert [each.delivered for each in channel.fates(TO_BOARD, 0, Type.SAMPLE, 0, 63, 10 * S)] == [True, False]


def test_without_an_end_it_is_down_for_good():
    assert not fate(Disconnected(Clear(None), [Disconnect(10 * S)]), 10**9 * S).delivered


def test_what_was_on_its_way_to_a_board_that_is_switched_off_never_arrives():
    """However late: the board that comes back knows nothing of it. Later ticks belong to its next session."""
    channel = Disconnected(Clear(None), [PowerOff(10 * S, tick=20)])
    assert fate(channel, 10 * S - 1, tick=19).delivered
    assert fate(channel, 10 * S, tick=19) == Fate(False, 10 * S, "board.restart")
    assert not fate(channel, 99 * S, tick=19).delivered
    assert fate(channel, 12 * S, tick=24).delivered


class Lossy:
    """Loses everything, and counts how often it was asked."""

    def __init__(self):
        self.asked = 0

    def fates(self, direction, tick, frame_type, number, encoded_len, t_ns):
        self.asked += 1
        return (Fate(False, t_ns, "drop"),)


def test_one_decision_per_frame_and_the_outage_is_the_cause():
    lossy = Lossy()
    channel = Disconnected(lossy, [Disconnect(10 * S, 12 * S)])
    assert [fate(channel, t * S).cause for t in (9, 10, 11, 12)] == ["drop", "disconnect", "disconnect", "drop"]
    assert lossy.asked == 4
