"""One session on the board, stepped by hand, with a law that keeps a diary: what it is asked, what is sent for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from firmware_sim.controllers.user import load_user_law
from firmware_sim.flight import Flight
from protocol import events, frames
from protocol.frames import Command, Event, Reading, Sample
from protocol.law_tables import config_words, law_by_name

DIARY = """
class Law:
    PARAMS = {"k": (1.0, "", 1e-3)}
    MODEL = True
    diary = []
    def init(self, params):
        self.diary.append("init")
    def step(self, s):
        self.diary.append((s.tick, round(s.applied_Nm[0], 6)))
        return (0.001 * (s.tick + 1), 0.0, 0.0)
"""
NOT_A_NUMBER = """
class Law:
    def step(self, s):
        return (0.5, float("nan") if s.tick < 2 else 0.25, 0.0)
"""


def flight(tmp_path: Path, body: str, **values: object) -> tuple[Flight, Any]:
    file = tmp_path / "their_law.py"
    file.write_text(body)
    table, cls = load_user_law(f"{file}:Law")
    return Flight(config_words(table, values), (table, cls)), cls


def sample(tick: int) -> Sample:
    zero = (0, 0, 0)
    return Sample(tick, zero, zero, zero, frames.NO_TICK, 0, frames.ZERO, 1, (Reading(0, zero), None, None))


def command(answer: list[Any]) -> Command:
    assert isinstance(answer[0], Command)
    return answer[0]


@pytest.mark.parametrize("form", ["fixed", "float"])
def test_a_users_law_has_init_once_and_sees_no_sample_before_tick_0(tmp_path: Path, form: str) -> None:
    flown, law = flight(tmp_path, DIARY, form=form)
    assert law.diary == ["init"]
    flown.step(0, sample(0))
    assert law.diary == ["init", (0, 0.0)]


@pytest.mark.parametrize("delay", [0, 1, 2, 3])
def test_without_a_sample_the_boards_own_command_of_n_ticks_ago_acts(tmp_path: Path, delay: int) -> None:
    """SPEC B5; with n = 0 what acted until t_k is the command of the tick before."""
    flown, law = flight(tmp_path, DIARY, form="float", transport_delay_ticks=delay)
    for tick in range(6):
        flown.step(tick, sample(tick))
    flown.step(6, None)
    source = 6 - max(delay, 1)
    assert law.diary[-1] == (6, pytest.approx(0.001 * (source + 1)))


@pytest.mark.parametrize(
    ("law", "form", "field", "place"),
    [("appc", "fixed", "applied", 0), ("appc", "float", "applied", 0), ("mrac", "fixed", "input", 0),
     ("mrac", "float", "input", 0), ("predictor", "float", "sent", 1)],
)  # fmt: skip
def test_a_model_takes_the_watchdogs_zero_for_what_acts(law: str, form: str, field: str, place: int) -> None:
    """SPEC B5: a law that went on with its own command came back from an outage with twice the error."""
    mask = 5 if law == "predictor" else 1
    flown = Flight(config_words(law_by_name(law), {"form": form, "link_limit": 3, "readings_mask": mask}))
    away = (Reading(0, (2**26, 2**26, 2**26)), None, Reading(0, (0, 0, 0)))
    for tick in range(40):
        flown.step(tick, sample(tick)._replace(readings=away, valid=5, setpoint=(0, 0, 0)))
    torques = [command(flown.step(tick, None)).torque for tick in range(40, 46)]
    assert all(torques[0]) and torques[2:] == [(0, 0, 0)] * 4
    assert flown._law.field(field)[place] == 0


@pytest.mark.parametrize("form", ["fixed", "float"])
def test_a_torque_that_is_not_a_number_is_sent_as_zero_with_event_nan(tmp_path: Path, form: str) -> None:
    """SPEC B16, in either arithmetic; a tick that repeats such a command says so again."""
    flown, _ = flight(tmp_path, NOT_A_NUMBER, form=form)
    answers = [flown.step(0, sample(0)), flown.step(1, None), flown.step(2, sample(2))]
    assert [command(answer).torque for answer in answers] == [(2**29, 0, 0), (2**29, 0, 0), (2**29, 2**28, 0)]
    nan = [[f.a for f in answer if isinstance(f, Event) and f.code == events.NAN] for answer in answers]
    assert nan == [[1], [1], []]
