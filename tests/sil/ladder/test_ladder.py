"""The ladder in one process: what is compared with what, what counts as wrong, what table, lines and JSON say."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from made_boards import WRONG_AT
from rich.console import Console

from sil.boards import BOARDS
from sil.budget.measure import Budget, Cost, Instructions
from sil.ladder import climb as climbing
from sil.ladder.climb import Step, climb, exit_code_of
from sil.ladder.rungs import RUNGS, USUAL, chosen, scenarios
from sil.ladder.table import as_dict, found, last_line, legend, table
from sil.scenario_errors import ScenarioInvalid
from sil.trouble import UsageError
from sil.watch import Watch

SETS = ("duration_s=30", "require=[]")
Flown = Callable[..., list[Step]]


@pytest.fixture
def flown(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Flown:
    """flown(native=CLASS, ...): a ladder with these classes of made_boards as boards; fixed flies in process, too."""
    counted = Instructions(60, 100, 150.0, 200)
    cost = Cost(counted, counted, counted, counted, 512)
    monkeypatch.setattr(climbing, "measure", lambda flights: Budget("made", 60, {}, {flights[0].law: cost}))

    def fly(*more: str, sets: Sequence[str] = (), **boards: str) -> list[Step]:
        monkeypatch.setitem(BOARDS, "process", "sil.boards.inproc:InprocBoard")
        for name, made in boards.items():
            monkeypatch.setitem(BOARDS, name.replace("_", "-"), f"made_boards:{made}")
        rungs = ("float", "fixed", *(name.replace("_", "-") for name in boards), *more)
        flights = scenarios("appc-rs232", [*SETS, *sets], chosen(",".join(rungs)))
        return list(climb(flights, tmp_path / "ladder", lambda name: None, Watch()))

    return fly


def printed(steps: list[Step], width: int) -> str:
    console = Console(file=io.StringIO(), width=width, highlight=False)
    console.print(table(steps, width))
    for line in legend(steps, width):
        console.print(line)
    for text in (*found(steps), last_line(steps, "appc-rs232", Path("here"))):
        console.print(text)
    return console.file.getvalue()  # type: ignore[attr-defined]


def test_right_boards_are_identical_and_float_differs_by_quantisation(flown: Flown) -> None:
    steps = flown(native="Right", cortex_m="Right")
    assert [step.below for step in steps] == ["", "float", "fixed", "native"]
    assert [step.same_form for step in steps] == [False, False, True, True]
    quantised = steps[1].difference
    assert quantised is not None and quantised.truth is not None
    assert 0 < quantised.truth.max_attitude_deg < 1e-2
    assert {step.summary["sha256"] for step in steps[1:]} == {steps[1].summary["sha256"]}
    assert exit_code_of(steps) == 0
    assert "fixed = native = cortex-m, bit for bit" in printed(steps, 80)


def test_a_board_that_is_off_by_a_count_fails_though_its_requirements_are_met(flown: Flown) -> None:
    steps = flown(native="Wrong", cortex_m="Right")
    assert [step.exit_code for step in steps] == [0, 0, 0, 0]
    assert [step.differs for step in steps] == [False, False, True, True]
    assert exit_code_of(steps) == 1
    said = printed(steps, 80)
    assert f"differs at tick {WRONG_AT}: COMMAND, down" in said
    assert "* torque" in said
    assert "cortex-m is fixed, bit for bit, but not native" in said
    assert said.count("differs at tick 37") == 1
    native = as_dict(steps, "appc-rs232", Path("here"))["rungs"][2]
    assert (native["identical"], native["first_differing_tick"]) == (False, WRONG_AT)
    assert native["first_difference"]["differing"] == ["torque"]
    assert 0 < native["max_torque_Nm"] < 1e-4


def test_a_requirement_that_is_not_met_fails_its_rung(flown: Flown) -> None:
    steps = flown(native="Right", sets=["require=[{metric: rms_error_deg.roll, below: 1e-9}]"])
    assert exit_code_of(steps) == 1
    assert "native: not met: rms_error_deg.roll < 1e-09" in printed(steps, 120)


def test_a_rung_that_cannot_be_flown_is_not_shown_and_the_next_is_held_against_the_one_below_it(flown: Flown) -> None:
    steps = flown(native="Right", cortex_m="Missing", qemu="Right")
    assert (steps[3].why_not, steps[3].summary) == (
        "board cortex-m: expected unicorn, got none: pip install 'attitude-sil[pil]'",
        {},
    )
    assert steps[4].below == "native"
    assert exit_code_of(steps) == 3
    said = printed(steps, 160)
    assert "pip install 'attitude-sil[pil]'" in said
    assert said.splitlines()[-2].startswith("not shown")


def test_what_is_wrong_for_certain_is_said_before_what_is_not_shown(flown: Flown) -> None:
    steps = flown(native="Wrong", cortex_m="Missing")
    content = as_dict(steps, "appc-rs232", Path("here"))
    assert (content["exit_code"], content["verdict"]) == (3, "failed")


def test_a_board_that_dies_in_flight_is_a_failure_of_the_link(flown: Flown) -> None:
    steps = flown(native="Dying")
    assert exit_code_of(steps) == 3
    assert "out of order" in printed(steps, 160)
    assert steps[2].difference is not None  # as far as it went


def test_instructions_are_those_of_the_rung_that_can_be_counted(flown: Flown) -> None:
    steps = flown(native="Right", cortex_m="Right")
    assert [step.instructions is not None for step in steps] == [False, False, False, True]
    assert "150" in printed(steps, 80).splitlines()[5]


@pytest.mark.parametrize("width", [80, 160])
def test_the_table_fits(flown: Flown, width: int) -> None:
    steps = flown(native="Right", cortex_m="Missing")
    lines = printed(steps, width).splitlines()
    assert max(map(len, lines)) <= width
    assert any(RUNGS["native"].about in line for line in lines)


def test_json_is_plain(flown: Flown) -> None:
    steps = flown(native="Wrong", cortex_m="Missing")
    content: dict[str, Any] = json.loads(json.dumps(as_dict(steps, "appc-rs232", Path("x")), allow_nan=False))
    assert [rung["rung"] for rung in content["rungs"]] == ["float", "fixed", "native", "cortex-m"]
    assert content["rungs"][3]["times_real_time"] is None


def test_which_rungs() -> None:
    assert tuple(rung.name for rung in chosen(None)) == USUAL
    assert [rung.name for rung in chosen(None, ["qemu"])] == [*USUAL, "qemu"]
    assert [rung.name for rung in chosen("native, fixed")] == ["fixed", "native"]
    (*_, top) = chosen("fixed", ["serial:///dev/ttyUSB0?baud=9600"])
    assert (top.board, top.folder, top.form) == ("serial:///dev/ttyUSB0?baud=9600", "hardware", "fixed")


@pytest.mark.parametrize(
    ("rungs", "more", "said"),
    [("fixed,natve", (), "--rungs: expected one of float, fixed, native, cortex-m, qemu (did you mean native?)"),
     (None, ("tower",), "--with: expected one of float, "), ("", (), "--rungs: expected one of"),
     ("fixed", ("udp://a:1", "udp://b:2"), "expected one board that already runs")],
)  # fmt: skip
def test_rungs_that_are_none(rungs: str | None, more: tuple[str, ...], said: str) -> None:
    with pytest.raises(UsageError) as error:
        chosen(rungs, more)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "sets", "said"),
    [("appc-rs232", ["law.form=float"], "--set law.form: each rung has its own"),
     ("appc-rs232", ["clock=realtime"], "--set clock: each rung has its own"),
     ("rigid-open-loop", [], "got board none: there is no ladder to climb"),
     ("mrac-as-printed", [], "rung fixed: ")],
)  # fmt: skip
def test_scenarios_without_a_ladder(name: str, sets: list[str], said: str) -> None:
    with pytest.raises(UsageError) as error:
        scenarios(name, sets, chosen("float,fixed"))
    assert said in str(error.value)


def test_a_law_of_your_own_has_a_float_form_only(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("class Mine:\n    PARAMS = {}\n")
    (tmp_path / "mine.yaml").write_text("law: {name: ./law.py:Mine, form: float}\n")
    with pytest.raises(UsageError, match="a law of your own has a float form only, got rungs fixed"):
        scenarios(str(tmp_path / "mine.yaml"), [], chosen("float,fixed"))


def test_a_scenario_that_does_not_load_is_no_ladder() -> None:
    with pytest.raises(ScenarioInvalid):
        scenarios("appc-rs232", ["law.nonsense=1"], chosen(None))
