"""Faults of instruments as the board meets them: what SAMPLE says of a reading, and of the torque that really acts."""

from __future__ import annotations

import numpy as np
import pytest

from protocol import events
from protocol.frames import PROPAGATED, REPEATED, USED

TICKS = 40


def flown(lab, *, sensor=(), wheels=(), **values):
    sections = {"sensors": {"attitude": {"faults": sensor}}, "actuators": {"wheels": {"faults": wheels}}}
    bench = lab(**sections, **values)
    return bench, bench.run()


@pytest.mark.parametrize(("law", "used"), [("appc", PROPAGATED), ("pd", REPEATED)])
def test_a_sensor_that_is_off_is_a_lost_sample(lab, law, used):
    bench, rows = flown(lab, sensor=[{"kind": "off", "at_s": 5, "for_s": 3}], law={"name": law})
    assert [k for k, sample in enumerate(rows.samples()) if not sample.valid] == list(range(10, 16))
    assert [c.tick for c in rows.commands() if c.used == used] == list(range(10, 16))
    assert {c.used for c in rows.commands()} == {USED, used}
    assert rows.events_with(events.FAULT_BEGINS) == [(10, 0, 0)]
    assert rows.events_with(events.FAULT_ENDS) == [(16, 0, 0)]
    assert (bench.rig.window.missed, bench.rig.window.real_misses) == (0, 0)  # the board answers all the same


def test_the_present_mask_does_not_change(lab):
    """Nor does the length of SAMPLE, and with it its time on the wire."""
    _, rows = flown(lab, sensor=[{"kind": "off", "at_s": 5}], link={"url": "inproc", "baud": 115200})
    assert len({len(packet) for _, direction, _, packet in rows.packets if direction == 0 and packet[1] == 2}) == 1
    assert {sample.readings[0] is not None for sample in rows.samples()} == {True}


def test_a_silent_fault_is_used_and_an_old_reading_says_its_age(lab):
    _, stuck = flown(lab, sensor=[{"kind": "stuck", "at_s": 5}])
    _, late = flown(lab, sensor=[{"kind": "delayed", "at_s": 5, "delay_s": 1}])
    assert {(sample.valid, sample.readings[0].age_us) for sample in stuck.samples()} == {(1, 0)}
    assert [sample.readings[0].age_us for sample in late.samples()] == [0] * 10 + [1_000_000] * 30
    for rows in (stuck, late):
        assert {command.used for command in rows.commands()} == {USED}


@pytest.mark.parametrize("delay", [0, 1])
def test_applied_is_what_really_acts(lab, delay):
    """The board is told the truth about the torque, faults and limits included; the plant gets the same."""
    law = {"name": "mrac", "params": {"design": "printed"}} if delay == 0 else {"name": "appc"}
    fault = {"kind": "wrong", "scale": 0.5, "bias_Nm": 0.001, "axis": "x", "at_s": 5, "for_s": 5}
    bench, rows = flown(lab, wheels=[fault], transport_delay_ticks=delay, law=law)
    unit = 2.0**-bench.scenario.torque_bits
    commands, samples = {c.tick: c.torque for c in rows.commands()}, rows.samples()
    for k in range(2, TICKS):
        asked, acts = np.array(commands[k - delay]) * unit, np.array(rows.truths[k][1])
        faulty = 10 <= k < 20
        expected = np.clip(asked * [0.5, 1, 1] + [0.001, 0, 0] if faulty else asked, -0.1, 0.1)
        np.testing.assert_allclose(acts, expected, atol=1e-12)
        told = samples[k + 1 if delay == 0 else k].applied if k + 1 < TICKS else None
        if told is not None:
            np.testing.assert_allclose(np.array(told) * unit, acts, atol=unit)
    assert rows.events_with(events.FAULT_BEGINS) == [(10, 3, 3)]


def test_a_wheel_that_is_off_keeps_its_momentum(lab):
    _, rows = flown(lab, wheels=[{"kind": "off", "axis": "y", "at_s": 5}])
    momentum = np.array([sample.momentum for sample in rows.samples()])
    assert len(set(momentum[10:, 1])) == 1 and momentum[10, 1] != 0
    assert len(set(momentum[10:, 0])) > 20
