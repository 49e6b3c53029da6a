"""diff --close: another machine's last bits pass, another behaviour does not, and what is counted has to be equal."""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "sinks"))

import numpy as np
import pytest
from synthetic import synthetic_journal

from sil import cli
from sil.report import tolerance
from sil.report.tolerance import DEFAULTS, close, text, tolerances
from sil.runs import Run, open_run
from sil.sinks.seal import seal
from sil.trouble import UsageError


def made(folder: Path, **options: object) -> Run:
    seal(synthetic_journal(folder, **options))  # type: ignore[arg-type]
    return open_run(folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("close")


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return made(folder / "a")


def moved(run: Run, name: str, by: float, from_row: int = 0) -> Run:
    """The same log with one signal of truth moved from a row on."""
    other = open_run(run.path)
    values = other._columns[name].copy()
    values[from_row:] += by
    other._columns[name] = values
    return other


def departure(found: tolerance.Closeness, signal: str) -> tolerance.Departure:
    return next(each for each in found.departures if each.signal == signal)


def test_the_same_run_is_within(run: Run, folder: Path) -> None:
    found = close(run, made(folder / "again"))
    assert found.within
    assert found.frames_other_bytes == 0
    assert all(each.largest == 0 and each.tick is None for each in found.departures)
    assert {each.signal for each in found.departures} >= {"attitude_deg", "command_Nm", "reading_deg"}


def test_last_bits_of_the_plant_are_within_and_named_as_such(run: Run) -> None:
    found = close(run, moved(run, "attitude_deg", 1e-12))
    assert found.within
    assert departure(found, "attitude_deg").largest == pytest.approx(1e-12, rel=0.01)
    assert "every frame has the same bytes: only the plant's arithmetic departs" in text(found)


def test_a_command_of_one_lsb_is_within_and_counted(run: Run, folder: Path) -> None:
    """What a reading or torque rounded the other way leads to; bit for bit the runs differ."""
    found = close(run, made(folder / "lsb", alter={77: 1}))
    assert found.within
    assert departure(found, "command_Nm").largest >= 2.0**-30
    assert 0 < departure(found, "attitude_deg").largest < 1e-6
    assert 0 < found.frames_other_bytes < found.frames
    assert f"{found.frames_other_bytes} of {found.frames} frames have other bytes" in text(found)


@pytest.mark.parametrize("signal", ["attitude_deg", "omega_radps", "applied_Nm", "momentum_Nms", "setpoint_deg"])
def test_the_first_tick_beyond_is_found(run: Run, signal: str) -> None:
    limit = DEFAULTS[signal] or 0.0
    assert close(run, moved(run, signal, 0.9 * limit, 120)).within
    found = close(run, moved(run, signal, 1.5 * limit, 120))
    assert not found.within
    assert departure(found, signal).beyond_tick == 120
    assert text(found).startswith("BEYOND tolerances")
    assert "tick 120" in text(found)


def test_angles_are_held_against_each_other_modulo_a_turn(run: Run) -> None:
    assert close(run, moved(run, "attitude_deg", 360.0)).within


def test_not_a_number_in_one_run_only_is_beyond_every_tolerance(run: Run) -> None:
    other = moved(run, "attitude_deg", 0.0)
    other._columns["attitude_deg"][33, 1] = np.nan
    found = close(run, other, tolerances(["attitude_deg=1e9"]))
    assert departure(found, "attitude_deg").beyond_tick == 33
    assert "in one run only" in text(found)
    json.dumps(found.as_dict(), allow_nan=False)
    assert close(other, other).within


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"lose": (60,)}, "frames: 601 and 599, the first others are COMMAND down delivered at tick 60"),
        ({"late": (60,)}, "frames: 601 and 601, the first others are COMMAND down delivered at tick 60"),
        ({"telemetry_every": 2}, "CONFIG: telemetry_every: 1 and 2"),
        ({"kill_at": 100}, "ticks: 200 and 99"),
    ],
)
def test_what_is_counted_has_to_be_equal(run: Run, tmp_path: Path, options: dict[str, object], said: str) -> None:
    found = close(run, made(tmp_path / "b", **options), dict.fromkeys(DEFAULTS, 1e9))
    assert not found.within
    assert any(line.startswith(said) for line in found.unequal), found.unequal


def test_events_flags_and_counters_have_to_be_equal(run: Run) -> None:
    other = open_run(run.path)
    other.__dict__["events"] = [event._replace(b=event.b + 1) for event in run.events]
    other.commands = run.commands.copy()
    other.commands["flags"][5] ^= 1
    other.telemetry["saturations"] = run.telemetry["saturations"] + (run.tick >= 9)
    assert close(run, other).unequal == [
        "events: 1 and 1, the first other one at tick 0",
        "COMMAND flags: 1 times, first at tick 5",
        "TELEMETRY saturations: first at tick 9",
    ]


def test_other_periods_are_not_compared_tick_by_tick(run: Run) -> None:
    other = open_run(run.path)
    other.period_ns *= 2
    found = close(run, other)
    assert (found.within, found.departures) == (False, [])
    assert "nothing else was compared" in text(found)


def test_telemetry_is_shown_and_judged_only_where_asked(run: Run) -> None:
    other = open_run(run.path)
    other.telemetry["error_y"] = run.telemetry["error_y"] * 1.001
    found = close(run, other)
    assert found.within
    assert 0 < departure(found, "telemetry error").largest < 1.1e-3
    verdict = text(found).splitlines()[0]
    assert verdict == "within tolerances: 200 ticks, 601 frames; TELEMETRY departs and is not judged"
    assert "not judged" not in text(close(run, run))
    assert "not judged" not in text(close(run, other, tolerances(["telemetry=1e-2"])))
    assert not close(run, other, tolerances(["telemetry=1e-5"])).within
    assert close(run, other, tolerances(["telemetry=1e-2"])).within


def test_telemetry_departs_as_far_from_a_to_b_as_from_b_to_a(run: Run) -> None:
    """A fraction of the larger of both peaks: a verdict must not depend on which run is named first."""
    other = open_run(run.path)
    other.telemetry["error_y"] = run.telemetry["error_y"] * 3.0
    allowed = tolerances(["telemetry=0.8"])
    there, back = close(run, other, allowed), close(other, run, allowed)
    assert departure(there, "telemetry error").largest == departure(back, "telemetry error").largest
    assert (there.within, back.within) == (True, True)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("torque=1", "expected a signal, got 'torque'; known: attitude_deg"),
        ("attitude_deg", "attitude_deg: expected a number not below 0, got ''"),
        ("attitude_deg=-1", "got '-1'"),
        ("attitude_deg=nan", "got 'nan'"),
        ("attitude_deg=inf", "got 'inf'"),
    ],
)
def test_a_tolerance_that_is_none_is_one_line(given: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        tolerances([given])


def test_the_verb_and_its_exit_codes(run: Run, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = made(folder / "verb", alter={77: 1})
    a, b = str(run.directory), str(other.directory)
    assert cli.invoke(["diff", a, b]) == 1
    assert cli.invoke(["diff", a, b, "--close"]) == 0
    capsys.readouterr()
    assert cli.invoke(["diff", a, b, "--tolerance", "command_Nm=0", "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert content["departures"][6]["signal"] == "command_Nm"
    assert content["departures"][6]["beyond_tick"] == 77
    assert cli.invoke(["diff", a, b, "--tolerance", "x=0"]) == 2
