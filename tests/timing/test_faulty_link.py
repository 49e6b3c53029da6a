"""Faults on the modelled link: every sent frame has exactly one fate, and what the loop does follows from the fates."""

from __future__ import annotations

from collections import Counter

import pytest
from benches import LabBench, Rows, StallingClock, events_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from protocol import events, frames
from protocol.channel import TO_BOARD, TO_LAB, Damage, Fate
from protocol.codec import encode
from protocol.faulty import Burst, Faults, Faulty, Jitter
from protocol.frames import FRESH, PROPAGATED, USED, Type
from sil.fates import STALE_LIMIT
from sil.sinks.journal import Fate as Outcome

TICKS = 40
T_NS = 500_000_000
TIMEOUT_NS = 100_000_000
UP, DOWN = 0, 1


class Scripted:
    """A clear channel but for the fates that a test lists: (direction, tick, type) to a function of (size, t_ns)."""

    def __init__(self, told):
        self.told = told

    def fates(self, direction, tick, frame_type, number, encoded_len, t_ns):
        say = self.told.get((direction, tick, frame_type))
        return say(encoded_len, t_ns) if say else (Fate(True, t_ns),)


def arrives(*after_ns: int):
    """One copy for each, so long after it was sent; None: lost."""
    return lambda size, t_ns: tuple(
        Fate(False, t_ns, "drop") if each is None else Fate(True, t_ns + each, slow="delay" if each else "")
        for each in after_ns
    )


def damaged(*bits: int, lost: tuple[int, ...] = ()):
    return lambda size, t_ns: (Fate(True, t_ns, "bit errors", Damage(bits, lost)),)


def fly(told=None, clock=None, **values):
    bench = LabBench(Scripted(told or {}), clock=clock, **values)
    rows = bench.run()
    return bench, rows


def used(rows: Rows) -> dict[int, int]:
    return {command.tick: command.used for command in rows.commands()}


def stale(rows: Rows) -> list[tuple[int, int]]:
    """(tick whose answer reports it, tick of the SAMPLE)."""
    sent = [
        frames.unpack(packet).frame for _, way, _, packet in rows.packets if way == DOWN and packet[1] == Type.EVENT
    ]
    return [(event.tick, event.a) for event in events_of(sent) if event.code == events.STALE_SAMPLE]


def outcomes(rows: Rows, way: int, kind: int) -> dict[tuple[int, int], tuple[int, str]]:
    """(tick, copy) to fate and cause."""
    return {
        (tick, copy): (fate, cause)
        for (tick, direction, fate, packet), (cause, copy, _) in zip(rows.packets, rows.copies, strict=True)
        if (direction, packet[1]) == (way, kind)
    }


# -- up ----------------------------------------------------------------------------------------------------------------


def test_a_sample_is_in_time_up_to_sample_timeout():
    told = {(TO_BOARD, 10, Type.SAMPLE): arrives(TIMEOUT_NS), (TO_BOARD, 20, Type.SAMPLE): arrives(TIMEOUT_NS + 1)}
    bench, rows = fly(told)
    assert [used(rows)[tick] for tick in (9, 10, 11, 19, 20, 21)] == [USED, USED, USED, USED, PROPAGATED, USED]
    fates = outcomes(rows, UP, Type.SAMPLE)
    assert (fates[10, 0], fates[20, 0]) == ((Outcome.DELIVERED, ""), (Outcome.LATE, "delay"))
    assert [sample.transit_us for sample in rows.samples()][9:12] == [0, 100_000, 0]
    assert bench.rig.window.missed == 0


@pytest.mark.parametrize(
    ("after_ns", "reported"), [(TIMEOUT_NS + 1, 11), (T_NS, 11), (T_NS + 1, 12), (3 * T_NS, 13), (100 * T_NS, None)]
)
def test_a_late_sample_is_stale_at_the_first_sample_not_before_its_arrival(after_ns, reported):
    _, rows = fly({(TO_BOARD, 10, Type.SAMPLE): arrives(after_ns)})
    assert stale(rows) == ([] if reported is None else [(reported, 10)])
    assert [tick for tick, how in used(rows).items() if how != USED] == [10]


def test_stale_samples_wait_for_a_sample_that_is_in_time_and_keep_their_order():
    """On a clock nothing else would put the board's timer right again."""
    told = {(TO_BOARD, tick, Type.SAMPLE): arrives(T_NS + 1000 - tick) for tick in (10, 11, 12)}
    told |= {(TO_BOARD, tick, Type.SAMPLE): arrives(None) for tick in (13, 14)}
    _, rows = fly(told)
    assert stale(rows) == [(15, 10), (15, 11), (15, 12)]


def test_a_further_copy_is_stale_and_the_first_to_arrive_counts():
    told = {
        (TO_BOARD, 10, Type.SAMPLE): arrives(0, 0),
        (TO_BOARD, 20, Type.SAMPLE): arrives(None, 5_000_000),
        (TO_BOARD, 30, Type.SAMPLE): arrives(50_000_000, 20_000_000),
    }
    _, rows = fly(told)
    assert set(used(rows).values()) == {USED}
    assert stale(rows) == [(11, 10), (31, 30)]
    transits = [rows.samples()[place].transit_us for place in (10, 11, 21, 22, 32, 33)]
    assert transits == [0, 0, 5000, 5000, 20_000, 20_000]
    fates = outcomes(rows, UP, Type.SAMPLE)
    assert (fates[20, 0], fates[20, 1]) == ((Outcome.DROPPED, "drop"), (Outcome.DELIVERED, ""))


def test_corrupted_bytes_really_go_to_the_board_which_discards_them():
    told = {(TO_BOARD, tick, Type.SAMPLE): damaged(100 + tick) for tick in (10, 11, 20)}
    bench, rows = fly(told)
    counters = bench.rig.host._port.counters
    assert counters.crc_errors + counters.cobs_errors + counters.too_short + counters.too_long >= 3
    assert [tick for tick, how in used(rows).items() if how != USED] == [10, 11, 20]
    assert outcomes(rows, UP, Type.SAMPLE)[10, 0] == (Outcome.CORRUPTED, "bit errors")


def test_a_lost_delimiter_does_no_harm():
    def both_ends(size, t_ns):
        return (Fate(True, t_ns, "byte loss", Damage((), (0, size - 1))),)

    _, rows = fly({(TO_BOARD, 10, Type.SAMPLE): both_ends, (TO_LAB, 12, Type.COMMAND): both_ends})
    assert set(used(rows).values()) == {USED}
    assert rows.sources()[1:] == [FRESH] * (TICKS - 1)
    assert outcomes(rows, UP, Type.SAMPLE)[10, 0] == (Outcome.DELIVERED, "byte loss")


@pytest.mark.parametrize("lost", [[0], [0, 1, 2, 3, 4, 5, 6], range(TICKS)], ids=["first", "first seven", "all"])
def test_before_the_first_sample_a_paced_board_gets_tick(lost):
    """Its timer does not run yet: without TICK it would stand still, and the bytes would not be those of lockstep."""
    told = {(TO_BOARD, tick, Type.SAMPLE): arrives(None) for tick in lost}
    _, lockstep = fly(told)
    bench, paced = fly(told, clock=StallingClock())
    assert paced.packets == lockstep.packets
    assert bench.rig.window.real_misses == 0


def test_samples_that_are_always_late_do_not_pile_up():
    bench, rows = fly({(TO_BOARD, tick, Type.SAMPLE): arrives(TIMEOUT_NS + 1) for tick in range(300)}, duration_s=151.0)
    reported = stale(rows)
    assert [command.used for command in rows.commands()][300:] == [USED, USED]
    assert reported[0] == (300, 300 - STALE_LIMIT)
    assert bench.rig.window.missed == 0


# -- down --------------------------------------------------------------------------------------------------------------


def test_the_first_whole_copy_of_a_command_acts():
    told = {
        (TO_LAB, 10, Type.COMMAND): arrives(None, 0),
        (TO_LAB, 20, Type.COMMAND): arrives(2 * T_NS, 1000),
        (TO_LAB, 30, Type.COMMAND): arrives(None, None),
    }
    bench, rows = fly(told)
    assert (bench.rig.window.missed, bench.rig.window.late) == (1, 0)
    assert rows.events_with(events.COMMAND_MISSED) == [(31, 30, 1)]
    fates = outcomes(rows, DOWN, Type.COMMAND)
    assert fates[20, 0] == (Outcome.LATE, "delay")
    assert fates[20, 1] == (Outcome.DELIVERED, "")
    assert bench.rig.answers.strays == 0


def test_a_corrupted_command_is_a_miss_and_no_real_one():
    bench, rows = fly({(TO_LAB, 10, Type.COMMAND): damaged(77, 90)})
    assert (bench.rig.window.missed, bench.rig.window.real_misses) == (1, 0)
    assert outcomes(rows, DOWN, Type.COMMAND)[10, 0] == (Outcome.CORRUPTED, "bit errors")


def test_a_collision_of_the_crc_is_taken_as_it_is():
    """The altered bytes are a COMMAND of the same tick with a right CRC: nothing can tell."""
    bench, rows = fly()
    packet = next(p for tick, way, _, p in rows.packets if (tick, way, p[1]) == (10, DOWN, Type.COMMAND))
    opened = frames.unpack(packet)
    other = frames.pack(
        opened.frame._replace(torque=tuple(value ^ 64 for value in opened.frame.torque)), opened.sequence
    )
    one, two = encode(packet), encode(other)
    assert len(one) == len(two)
    differ = int.from_bytes(one, "little") ^ int.from_bytes(two, "little")
    bits = tuple(bit for bit in range(len(one) * 8) if differ >> bit & 1)
    bench, rows = fly({(TO_LAB, 10, Type.COMMAND): damaged(*bits)})
    unit = 2.0**-bench.scenario.torque_bits
    assert rows.truths[11][1] == tuple(value * unit for value in frames.unpack(other).frame.torque)
    assert outcomes(rows, DOWN, Type.COMMAND)[10, 0] == (Outcome.DELIVERED, "bit errors")


def test_why_a_command_is_late():
    told = {(TO_LAB, 10, Type.COMMAND): arrives(T_NS)}
    _, rows = fly(told)
    assert outcomes(rows, DOWN, Type.COMMAND)[10, 0] == (Outcome.LATE, "delay")
    _, rows = fly(period_s=0.3, duration_s=12.0, answer_delay_s=0.345)
    assert {cause for fate, cause in outcomes(rows, DOWN, Type.COMMAND).values()} == {"execution"}


# -- anything ----------------------------------------------------------------------------------------------------------

CHANCE = st.sampled_from([0.0, 0.0, 0.05, 0.3, 0.9])
WAYS = st.builds(
    Faults,
    drop=CHANCE,
    burst=st.none()
    | st.builds(lambda bad, good, loss: Burst(bad, good, loss), CHANCE, st.sampled_from([0.1, 0.5]), CHANCE),
    bit_error_rate=st.sampled_from([0.0, 1e-4, 1e-2]),
    byte_loss=st.sampled_from([0.0, 1e-3]),
    duplicate=CHANCE,
    reorder=CHANCE,
    delay_ns=st.sampled_from([0, 90_000_000, 450_000_000]),
    jitter=st.none() | st.sampled_from([Jitter("uniform", 20_000_000), Jitter("uniform", 3 * T_NS)]),
    disconnect_ns=st.sampled_from([(), ((0, 2 * T_NS),), ((5 * T_NS, 30 * T_NS),)]),
    baud=st.sampled_from([None, 9600]),
)


@given(WAYS, WAYS, st.integers(0, 2**64 - 1), st.sampled_from([0, 1, 2]), st.sampled_from(["appc", "pd"]))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_sent_frame_has_exactly_one_fate(up, down, seed, delay, law):
    law = "pd" if delay != 1 else law
    channel = Faulty(seed, T_NS, up, down)
    bench = LabBench(channel, transport_delay_ticks=delay, law={"name": law})
    rows = bench.run()
    seen = Counter((tick, way, packet[1], packet[2:4], copy) for (tick, way, _, packet), (_, copy, _) in _both(rows))
    assert set(seen.values()) == {1}
    own = Counter((way, packet[1]) for (_, way, _, packet), (_, copy, _) in _both(rows) if not copy)
    assert own[UP, Type.SAMPLE] == own[DOWN, Type.COMMAND] == own[DOWN, Type.TELEMETRY] == TICKS
    assert own[DOWN, Type.EVENT] == sum(command.follows for command in _own_commands(rows)) - TICKS
    for (_, _, fate, packet), (cause, _, arrival_ns) in _both(rows):
        if packet[1] != Type.CONFIG:
            assert bool(cause) >= (fate != Outcome.DELIVERED)  # whatever went wrong says why
            assert arrival_ns >= 0
    _check_the_loop(bench, rows, delay)
    _check_the_board(rows)


def _both(rows: Rows):
    return list(zip(rows.packets, rows.copies, strict=True))


def _own_commands(rows: Rows):
    return [
        frames.unpack(packet).frame
        for (_, way, _, packet), (_, copy, _) in _both(rows)
        if (way, packet[1], copy) == (DOWN, Type.COMMAND, 0)
    ]


def _check_the_loop(bench: LabBench, rows: Rows, delay: int) -> None:
    """A command acts exactly where a copy of it was delivered."""
    good = {tick for (tick, _), (fate, _) in outcomes(rows, DOWN, Type.COMMAND).items() if fate == Outcome.DELIVERED}
    decided = TICKS - delay
    assert bench.rig.window.missed == sum(tick not in good for tick in range(decided))
    assert [source == FRESH for tick, _, source in rows.truths if tick >= delay] == [t in good for t in range(decided)]
    assert bench.rig.window.real_misses == 0


def _check_the_board(rows: Rows) -> None:
    """It uses a SAMPLE exactly where a copy was delivered, and counts those that came once more or too late."""
    fates = outcomes(rows, UP, Type.SAMPLE)
    good = {tick for (tick, _), (fate, _) in fates.items() if fate == Outcome.DELIVERED}
    assert {command.tick for command in _own_commands(rows) if command.used == USED} == good
    arrivals = [
        (arrival, tick, copy)
        for (tick, way, fate, packet), (_, copy, arrival) in _both(rows)
        if (way, packet[1]) == (UP, Type.SAMPLE) and fate in (Outcome.DELIVERED, Outcome.LATE)
    ]
    firsts = {min(each for each in arrivals if each[1] == tick) for tick in good}
    others = [each for each in arrivals if each not in firsts]
    reach = [any(m > tick and m * T_NS >= arrival for m in good) for arrival, tick, _ in others]
    if sum(reach) < 16:  # an answer has room for no more
        assert len(stale(_own(rows))) == sum(reach)


def _own(rows: Rows) -> Rows:
    own = Rows()
    own.packets = [row for row, (_, copy, _) in _both(rows) if not copy]
    return own
