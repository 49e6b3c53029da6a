"""Any frames in any order: the C board and the Python board send the same bytes, write for write, and wait alike.

Also where the clock, a datagram link, or a missing timer decides.
"""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from c_board import (
    DATAGRAM,
    HEALTH,
    NO_TIMER,
    ONCE,
    CBoard,
    Heard,
    Step,
    assert_same,
    heard,
    python_board,
    sanitized,
    script_of,
)
from hostile import Laboratory
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import config, frames
from protocol.codec import StreamDecoder, encode
from protocol.frames import LAYOUT_HASH, Command, Event, Hello, Stop, Tick, Timing, Type
from protocol.law_tables import config_words, law_by_name

LONG, COMPARED = 200_000, 60_000  # steps of the long run, a frame or a movement of the clock each


def frames_of(data: bytes) -> list[frames.Packet]:
    return [frames.unpack(packet) for packet in StreamDecoder().feed(data)]


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_any_session(c_board: CBoard, seed: int) -> None:
    steps = Laboratory(Random(seed)).steps(150)
    assert_same(c_board.serve(steps), python_board(steps))


def test_a_long_hostile_run(c_board: CBoard, sanitized_program: Path) -> None:
    """Nothing for a sanitizer to object to; the first part on the Python board, too. It visits what there is."""
    steps = Laboratory(Random(20)).steps(LONG)
    expected = python_board(steps[:COMPARED])
    assert_same(c_board.serve(steps[:COMPARED]), expected)
    assert_same(heard(sanitized(sanitized_program, "serve", 0, script_of(steps))), c_board.serve(steps))
    seen = [packet for data in expected.writes for packet in frames_of(data)]
    assert {packet.frame.status for packet in seen if packet.type == Type.READY} == {0, 1, 2, 3, 4}
    assert {packet.frame.used for packet in seen if isinstance(packet.frame, Command)} == {1, 2, 3, 4, 5}
    events = {packet.frame.code for packet in seen if isinstance(packet.frame, Event)}
    assert events == {1, 2, 3, 4, 5, 6, 7, 8, 10}  # NAN is for floats
    within = [packet.frame.flags & frames.FLAG_SATURATED for packet in seen if isinstance(packet.frame, Command)]
    assert within.count(0) > len(within) / 3
    assert expected.counters["unknown"] > 1000 < expected.counters["discarded_bytes"]


@pytest.mark.parametrize("cut", [1, 7, 255, 256, 257, 100_000])
def test_how_the_bytes_are_cut_changes_nothing(c_board: CBoard, cut: int) -> None:
    """Several frames in one read, one frame in several: the same answers."""
    steps = [step for step in Laboratory(Random(3)).steps(2000) if step.time_ns is None]
    whole = c_board.serve(steps)
    data = b"".join(step.data for step in steps)
    pieces = c_board.serve([Step(data[at : at + cut]) for at in range(0, len(data), cut)])
    assert (pieces.writes, pieces.counters) == (whole.writes, whole.counters)


def test_a_datagram_link(c_board: CBoard) -> None:
    """One packet each, both ways."""
    steps = [step._replace(data=unframed(step.data)) for step in Laboratory(Random(4)).steps(3000)]
    steps += [Step(b""), Step(b"\1" * 251), Step(b"\1" * 250), Step(b"\1" * 11)]
    assert_same(c_board.serve(steps, DATAGRAM), python_board(steps, DATAGRAM))


def unframed(data: bytes) -> bytes:
    packets = StreamDecoder().feed(data)
    return packets[0] if packets else data.strip(b"\0")[:250]


def test_a_board_without_a_timer_says_so_and_has_none(c_board: CBoard) -> None:
    heard = c_board.serve(flight(clock_rate_q16=65536) + [Step(time_ns=10**12)], NO_TIMER)
    assert [until for kind, until in heard.records if kind == "U" and until is not None] == []
    (hello,) = frames_of(heard.writes[1])
    assert hello.frame.flags == frames.HELLO_ECHO


def test_timing_follows_every_sixteenth_answer_in_the_same_write(c_board: CBoard) -> None:
    """busy: from before the step until its packets are made; this clock goes on 1000 ns whenever it is asked."""
    noise = [Step(b"noise\0"), *flight(ticks=40)]
    heard, without = c_board.serve(noise, HEALTH), c_board.serve(noise)
    last = [frames_of(data)[-1].frame for data in heard.writes[3:]]
    timings = [frame for frame in last if isinstance(frame, Timing)]
    assert timings == [Timing(15, 1000, 512, 3, 0), Timing(31, 1000, 512, 3, 0)]
    assert [sequence_free(data) for data in heard.writes] == [sequence_free(data) for data in without.writes]
    discarding = c_board.serve([*flight(ticks=10), Step(b"noise\0"), *flight(ticks=40)[2:]], HEALTH)
    timing = next(p.frame for data in discarding.writes for p in frames_of(data) if p.type == Type.TIMING)
    assert timing.discarded_bytes == 5


def sequence_free(data: bytes) -> list[object]:
    return [packet.frame for packet in frames_of(data) if packet.type != Type.TIMING]


def test_once_ends_with_the_session(c_board: CBoard) -> None:
    """What comes behind STOP is for the next board."""
    steps = [*flight(ticks=3), Step(stream(Stop(0), hello(8))), Step(stream(hello(9)))]
    assert echoed(c_board.serve(steps, ONCE)) == [7]
    assert echoed(c_board.serve(steps)) == [7, 8, 9]


def echoed(heard: Heard) -> list[int]:
    """The nonces of the sessions it opened."""
    hellos = [p.frame for data in heard.writes for p in frames_of(data) if p.type == Type.HELLO]
    return [hello.nonce for hello in hellos if hello.flags & frames.HELLO_ECHO]


@pytest.mark.parametrize(
    "build", ["", "fw native 01234567", "exactly twenty-four char", "more than 24 characters, far more"]
)
def test_the_build_is_what_the_hal_says(c_board: CBoard, build: str) -> None:
    (packet,) = frames_of(c_board.serve([], build=build).writes[0])
    assert packet.frame.build == build[:24]


# -- the ends of the ranges -------------------------------------------------------------------------------------------


def test_the_last_tick_there_is(c_board: CBoard) -> None:
    """After tick 0xFFFFFFFE nothing is left to step: neither by SAMPLE or TICK nor by the timer."""
    steps = flight(ticks=1, clock_rate_q16=65536)
    last = frames.NO_TICK - 1
    steps += [Step(stream(sample(last))), Step(stream(Tick(last))), Step(stream(sample(last)))]
    steps += [Step(time_ns=at * 10**18) for at in range(1, 4)]
    heard, expected = c_board.serve(steps), python_board(steps)
    assert_same(heard, expected)
    stepped = {p.tick for data in heard.writes for p in frames_of(data) if p.type == Type.COMMAND}
    assert stepped == {0, last}


def test_a_stale_sample_far_behind_sets_the_timer_far_ahead(c_board: CBoard) -> None:
    """With the slowest clock rate this is beyond what 64 bits hold: for ever, on either board."""
    for rate in (1, 65536, 2**32 - 1):
        steps = [*flight(ticks=1, clock_rate_q16=rate, period_us=1_000_000), Step(stream(sample(2**32 - 9)))]
        steps += [Step(stream(sample(0))), Step(time_ns=2**62)]
        assert_same(c_board.serve(steps), python_board(steps))


# -- a plain session --------------------------------------------------------------------------------------------------


def stream(*sent: frames.Frame) -> bytes:
    return b"".join(encode(frames.pack(frame, 0)) for frame in sent)


def hello(nonce: int, clock_rate_q16: int = 0) -> Hello:
    return Hello(1, 0, 0, LAYOUT_HASH, nonce, clock_rate_q16, "test")


def sample(tick: int) -> frames.Sample:
    reading = frames.Reading(0, (1000 * tick % 2**20, 0, 0))
    ack = tick - 1 if tick else frames.NO_TICK
    zero = (0, 0, 0)
    return frames.Sample(tick, zero, zero, zero, ack, 0, frames.FRESH, 1, (reading, None, None))


def flight(ticks: int = 5, law: str = "pd", clock_rate_q16: int = 0, **values: float) -> list[Step]:
    """HELLO, CONFIG and so many SAMPLEs."""
    words = config_words(law_by_name(law), values, [(0, 2**26, 0, 0)])
    sent = [hello(7, clock_rate_q16), *config.split(words), *map(sample, range(ticks))]
    return [Step(stream(frame)) for frame in sent]
