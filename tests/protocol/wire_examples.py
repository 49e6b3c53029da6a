"""Frames to test with: one of every type, and hypothesis strategies for all that a type can hold."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from protocol import frames as f

i32 = st.integers(-(2**31), 2**31 - 1)
u8, u16, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
u64 = st.integers(0, 2**64 - 1)
tick = st.integers(0, f.NO_TICK - 1)
triple = st.tuples(i32, i32, i32)
text = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=24)

ONE_OF_EACH: tuple[f.Frame, ...] = (
    f.Config(1, 3, 54, (1, -1, 2**31 - 1, -(2**31))),
    f.Sample(7, (1, -2, 3), (4, 5, -6), (7, 8, 9), 6, 7031, f.FRESH, 1, (f.Reading(25, (11, -12, 13)), None, None)),
    f.Sample(
        8,
        (0, 0, 0),
        (0, 0, 0),
        (0, 0, 0),
        f.NO_TICK,
        0,
        f.ZERO,
        5,
        (f.Reading(1, (1, 2, 3)), f.Reading(2, (2**30, 0, 0, 0)), f.Reading(3, (4, 5, 6))),
    ),
    f.Sample(9, (0, 0, 0), (0, 0, 0), (0, 0, 0), 8, 0, f.HELD, 0, (None, None, None)),
    f.Command(7, (100, -200, 300), f.FLAG_SATURATED, 2, f.USED),
    f.Telemetry(7, 3, 1, tuple(range(-5, 40))),
    f.Event(7, 2, 7, -1),
    f.Hello(1, f.ROLE_LAB, 0, f.LAYOUT_HASH, 0x0123456789ABCDEF, 0x140000, "sil 0.1"),
    f.Ready(f.READY_OK, f.NO_INDEX, 0xCAFEF00D),
    f.Tick(7),
    f.Timing(7, 1000, 512, 0, 3),
    f.Stop(f.STOP_DONE),
)


def _reading(count: int) -> st.SearchStrategy[f.Reading | None]:
    return st.none() | st.builds(f.Reading, u32, st.tuples(*[i32] * count))


@st.composite
def samples(draw: Any) -> f.Sample:
    """Any SAMPLE: every subset of readings, valid a subset of those present."""
    readings = (draw(_reading(3)), draw(_reading(4)), draw(_reading(3)))
    present = sum(1 << bit for bit, reading in enumerate(readings) if reading is not None)
    valid = draw(st.integers(0, 7)) & present
    numbers = draw(st.tuples(tick, triple, triple, triple, u32, u32, st.integers(0, 2)))
    return f.Sample(*numbers, valid, readings)


@st.composite
def configs(draw: Any) -> f.Config:
    """Any CONFIG part."""
    parts = draw(st.integers(1, 0xFFFF))
    words = tuple(draw(st.lists(i32, max_size=f.MAX_CONFIG_WORDS)))
    return f.Config(draw(st.integers(0, parts - 1)), parts, draw(u16), words)


any_frame = st.one_of(
    configs(),
    samples(),
    st.builds(f.Command, tick, triple, u16, u8, st.integers(1, 4)),
    st.builds(f.Telemetry, tick, u16, u16, st.lists(i32, max_size=f.MAX_TELEMETRY_WORDS).map(tuple)),
    st.builds(f.Event, tick, u16, i32, i32),
    st.builds(f.Hello, u16, st.integers(0, 1), u8, u32, u64, u32, text),
    st.builds(f.Ready, u16, u16, u32),
    st.builds(f.Tick, tick),
    st.builds(f.Timing, tick, u32, u32, u32, u32),
    st.builds(f.Stop, u16),
)
