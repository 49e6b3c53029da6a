"""What the firmware costs may not grow unnoticed: limits, and the baseline in tests/firmware/budget.json + 2 %.

When a change is worth its price: `sil pil-report --json > tests/firmware/budget.json`, and say so in the commit.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from sil.budget import SCENARIOS
from sil.budget.flight import Flight, flight_of, fly_manoeuvre_a
from sil.budget.judge import beyond_limits, figures, grown, read_baseline
from sil.budget.measure import Budget, measure
from sil.budget.table import Core, below
from sil.cli import invoke
from sil.runner import run_scenario
from sil.runs import open_run
from sil.scenario import load_scenario
from sil.trouble import LinkFailure, UsageError

BASELINE = Path(__file__).resolve().parents[2] / "firmware" / "budget.json"
LAWS = tuple(SCENARIOS)


@pytest.fixture(scope="module")
def short() -> Flight:
    return fly_manoeuvre_a("pd", "duration_s=15")


@pytest.fixture(scope="module")
def budget(short: Flight) -> Budget:
    return measure([short])


def test_the_image_that_ships_is_within_limits_and_baseline() -> None:
    """All laws over the whole of manoeuvre A; one test, so that it is flown once."""
    whole = measure([fly_manoeuvre_a(law) for law in LAWS])
    assert list(beyond_limits(whole)) == []
    assert list(grown(whole, read_baseline(BASELINE))) == []
    now, then = figures(whole.plain()), read_baseline(BASELINE)
    assert then.keys() == now.keys()
    far_below = {name for name in now if now[name] < 0.9 * then[name]}
    assert far_below == set(), "it got cheaper: renew the baseline, or it lets everything through"
    for cost in whole.laws.values():
        assert cost.law_step.calls == cost.board_step.calls == whole.ticks == 1200
        assert (cost.answer.calls, cost.answer_bytewise.calls) == (1140, 60)
        assert 0 < cost.law_step.min <= cost.law_step.mean <= cost.law_step.max < cost.board_step.max
        assert cost.board_step.max < cost.answer.max < cost.answer_bytewise.max
        assert 64 < cost.stack_bytes < whole.image_bytes["stack_reserved"]


def test_counting_is_repeatable(short: Flight, budget: Budget) -> None:
    assert measure([short]) == budget


@pytest.mark.parametrize(("grown_by", "found"), [(1.015, 0), (1.03, 1)])
def test_two_percent_of_growth_is_the_limit(budget: Budget, grown_by: float, found: int) -> None:
    baseline = figures(budget.plain())
    baseline["pd.law_step.max"] /= grown_by
    excess = list(grown(budget, baseline))
    assert [each.what for each in excess] == ["pd.law_step.max"] * found
    assert all(str(each).startswith("pd.law_step.max: expected at most 2% above ") for each in excess)


def test_limits_are_judged(budget: Budget) -> None:
    cost = budget.laws["pd"]
    greedy = cost._replace(law_step=cost.law_step._replace(max=5_001), stack_bytes=2_049)
    bloated = budget._replace(laws={"pd": greedy}, image_bytes={**budget.image_bytes, "code": 32 * 1024 + 1})
    assert [each.what for each in beyond_limits(bloated)] == [
        "pd: instructions per law step", "pd: stack in bytes", "code in bytes"
    ]  # fmt: skip


def test_an_image_that_answers_otherwise_is_not_measured(short: Flight) -> None:
    sent, answer = short.ticks[7]
    spoilt = replace(short, ticks=(*short.ticks[:7], (sent, (answer[0][:-1] + b"\x00", *answer[1:])), *short.ticks[8:]))
    with pytest.raises(LinkFailure, match="the image answers otherwise than the recorded board at tick 7"):
        measure([spoilt])


def test_a_meter_ends_with_its_parent() -> None:
    """Whatever killed that: it has no link whose end would tell it. Its input stays open here."""
    script = (
        "import os, subprocess, sys\n"
        "command = [sys.executable, '-m', 'sil.pil.budget', '--parent', str(os.getpid())]\n"
        "child = subprocess.Popen(command, stdin=int(sys.argv[1]), stdout=subprocess.DEVNULL)\n"
        "print(child.pid, flush=True)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    reader, writer = os.pipe()
    done = subprocess.run(
        [sys.executable, "-c", script, str(reader)], stdout=subprocess.PIPE, text=True, pass_fds=[reader], timeout=60
    )
    place, give_up = Path(f"/proc/{int(done.stdout)}/stat"), time.monotonic() + 20.0
    while place.exists() and place.read_text().rpartition(")")[2].split()[0] != "Z":
        assert time.monotonic() < give_up, "it lives on"
        time.sleep(0.02)
    os.close(reader)
    os.close(writer)


def test_a_recorded_run_is_a_flight_too(tmp_path: Path, short: Flight) -> None:
    sets = ["duration_s=15", "sensors.attitude.noise_deg=0.02", "board=inproc", "require=[]"]
    scenario = load_scenario("pd-root-locus", sets)
    run_scenario(scenario, tmp_path / "run")
    assert flight_of(open_run(tmp_path / "run"), scenario) == short


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"laws": {"pd": 1}}'])
def test_a_baseline_that_is_none_is_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "b.json").write_text(content)
    with pytest.raises(UsageError, match=r"b\.json: expected what `sil pil-report --json` prints"):
        read_baseline(tmp_path / "b.json")


def test_milliseconds_state_their_assumption(budget: Budget) -> None:
    core = Core(84.0, 2.0)
    assert core.ms(42_000) == pytest.approx(1.0)
    text = "\n".join(below(budget, core))
    assert "Instructions are not cycles. Milliseconds assume 2 cycles per instruction (--cpi) at 84 MHz" in text
    assert "The paper's board took 345 ms per sample" in text


# -- the verb ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, short: Flight) -> None:
    """`sil pil-report` flies fifteen seconds of pd, whatever it is asked for."""
    monkeypatch.setattr("sil.budget.flight.fly_manoeuvre_a", lambda law: short)


@pytest.mark.usefixtures("quick")
def test_the_verb_judges_by_limits_and_baseline(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["pil-report", "pd", "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["beyond"] == []
    baseline = tmp_path / "before.json"
    baseline.write_text(json.dumps(plain))
    assert invoke(["pil-report", "pd", "--against", str(baseline)]) == 0
    assert "+0.0%" in capsys.readouterr().out
    plain["laws"]["pd"]["answer"]["max"] -= 1000
    baseline.write_text(json.dumps(plain))
    assert invoke(["pil-report", "pd", "--against", str(baseline)]) == 1
    assert "pd.answer.max: expected at most 2% above " in capsys.readouterr().out


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["mrak"], "LAWS: expected one of pd, appc, mrac, fvsc, state_space (did you mean mrac?), got 'mrak'"),
        (["pd", "--against", "nowhere.json"], "nowhere.json: cannot read: No such file or directory"),
        (["pd", "--image", "nowhere.elf"], "cortex-m: nowhere.elf: no such image: build it with `make firmware`"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert invoke(["pil-report", *arguments]) == 2
    assert capsys.readouterr() == ("", says + "\n")
