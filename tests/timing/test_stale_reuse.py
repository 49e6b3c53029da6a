"""`stale: reuse` (B5, B6): a harm that is shown on purpose, and what COMMAND, counters and events say of it."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest
from benches import LabBench, Script, commands, events_of, make_sample, telemetry

from protocol import events, frames
from protocol.law_tables import TELEMETRY_COMMON

LOST = [word.name for word in TELEMETRY_COMMON].index("samples_lost")
LAWS = ("pd", "mrac", "appc")
STEPS = 40


def moving(tick: int, reading_of: int, applied: tuple[int, ...]) -> frames.Sample:
    """SAMPLE(tick) with the reading of tick `reading_of`; it is another one in every tick."""
    values = (11930465 + 40_000 * reading_of * reading_of, 7000 * reading_of, -5000 * reading_of)
    sample = make_sample(tick)
    readings = (sample.readings[0]._replace(values=values), *sample.readings[1:])
    return sample._replace(readings=readings, applied=applied)


def used(answer: list[Any]) -> list[tuple[int, int]]:
    return [(command.tick, command.used) for command in commands(answer)]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("form", "counts"), [("fixed", 0), ("float", 100)])
def test_the_law_is_given_the_last_reading_as_if_it_came_again(bench, law, form, counts):
    """Another board does get it again, in a SAMPLE that says that the command before acts.

    counts: a float law knows its own command unrounded, SAMPLE's in 2^-30 N m.
    """
    lossy, deceived = bench(law, form=form, stale="reuse"), bench(law, form=form)
    torque = (0, 0, 0)
    for tick in range(STEPS):
        lost = tick > 8 and tick % 5 in (0, 1)
        sample = moving(tick, tick - (tick % 5 + 1 if lost else 0), torque)
        got = commands(lossy.tick(tick) if lost else lossy.send(sample))
        expected = commands(deceived.send(sample))
        assert got[0].used == (frames.REUSED if lost else frames.USED)
        assert got[0].torque == pytest.approx(expected[0].torque, rel=0, abs=counts), tick
        assert got[0].flags == expected[0].flags
        torque = got[0].torque
    assert torque != (0, 0, 0)


@pytest.mark.parametrize("law", LAWS)
def test_it_is_a_lost_sample_all_the_same(bench, law):
    board = bench(law, stale="reuse")
    for tick in range(6):
        board.sample(tick)
    answer = board.tick(6)
    assert used(answer) == [(6, frames.REUSED)]
    assert [(event.code, event.a, event.b) for event in events_of(answer)] == [(events.SAMPLE_LOST, 6, 1)]
    assert telemetry(answer)[0].words[LOST] == 1
    invalid = board.sample(7, valid=6)
    assert used(invalid) == [(7, frames.REUSED)]
    assert [event.code for event in events_of(invalid)] == [events.READING_INVALID, events.SAMPLE_LOST]
    assert telemetry(invalid)[0].words[LOST] == 2


@pytest.mark.parametrize(("law", "without"), [("pd", 3), ("mrac", 2), ("appc", 2)])
def test_before_the_first_reading_and_after_a_restart_there_is_nothing_to_reuse(bench, law, without):
    board = bench(law, stale="reuse")
    assert used(board.tick(0)) == [(0, without)]
    assert used(board.sample(1, valid=6)) == [(1, without)]
    board.sample(2)
    assert used(board.tick(3)) == [(3, frames.REUSED)]
    assert used(board.tick(9)) == [(9, frames.RESTARTED)]
    assert used(board.tick(10)) == [(10, without)]
    board.sample(11)
    assert used(board.tick(12)) == [(12, frames.REUSED)]


@pytest.mark.parametrize("law", ["mrac", "appc"])
def test_identification_goes_on(bench, law):
    """B6: without the option it pauses, with the lost sample and two more."""

    def paused(stale: str) -> list[bool]:
        board = bench(law, stale=stale)
        for tick in range(30):
            board.sample(tick)
        answers = [*board.tick(30), *(frame for tick in range(31, 34) for frame in board.sample(tick))]
        return [bool(command.flags & frames.FLAG_IDENTIFICATION_PAUSED) for command in commands(answers)]

    assert paused("propagate") == [True, True, True, False]
    assert paused("reuse") == [False] * 4


def test_the_link_watchdog_still_counts(bench):
    board = bench(stale="reuse", link_limit=3)
    for tick in range(10):
        board.sample(tick)
    answers = [commands(board.tick(tick))[0] for tick in range(10, 14)]
    assert [bool(command.flags & frames.FLAG_WATCHDOG) for command in answers] == [False, False, True, True]
    assert [command.used for command in answers] == [frames.REUSED] * 4


def test_in_a_run_it_harms(lab):
    """The same losses: with the model the law stays on course, with stale readings it does not."""
    random = Random(1)
    lost = [tick for tick in range(20, 240) if random.random() < 0.2]

    def spread(stale: str) -> float:
        bench: LabBench = lab(Script(lose_up=lost), duration_s=120.0, stale=stale)
        torques = [applied for _, applied, _ in bench.run().truths]
        used_at = {command.tick: command.used for command in bench.rows.commands()}
        expected = frames.REUSED if stale == "reuse" else frames.PROPAGATED
        assert {used_at[tick] for tick in lost} == {expected}
        return sum(x * x + y * y + z * z for x, y, z in torques)

    assert spread("reuse") > 1.5 * spread("propagate")
