"""Every check of a board can fail: boards with one mistake each are found, and the one without is not."""

from __future__ import annotations

from collections.abc import Callable

import mistakes_at_the_end
import mistakes_in_config
import mistakes_in_flight
import mistakes_in_receiving
import mistakes_in_sessions
import pytest
import wrong_boards
from mistakes_at_the_end import Babbles, Dies
from wrong_boards import WRONG, Wrong

from sil.board_test import CHECKS, FAIL, GONE, PASS, SKIPPED, Checked, Order, examine
from sil.board_test.bench import Patience
from sil.boards import BOARDS

ALL = (mistakes_in_sessions, mistakes_in_config, mistakes_in_receiving, mistakes_in_flight, mistakes_at_the_end)
ELSEWHERE = ("timer: steps", "timer: drift", "baud", "config: other cut")  # test_timer.py, test_serial.py; never fails
QUICK = Patience(hello_s=0.3, answer_s=0.3, ready_s=10.0, boot_s=0.3, quiet_s=0.005)

Made = Callable[..., dict[str, Checked]]


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Made:
    """made(mistake, groups...): findings by name of the check."""

    def test(wrong: Wrong, *only: str, ticks: int = 45) -> dict[str, Checked]:
        monkeypatch.setitem(BOARDS, "process", "wrong_boards:Host")
        monkeypatch.setattr(wrong_boards.Host, "wrong", wrong, raising=False)
        order = Order("process", only=only, ticks=ticks, exchanges=6, patience=QUICK)
        return {named(each): each for each in examine(order, lambda text: None)}

    return test


def named(tested: Checked) -> str:
    name = tested.finding.check
    return tested.group if name == tested.group else f"{tested.group}: {name}"


def test_a_board_without_a_mistake_passes_everything(made: Made) -> None:
    groups = [name for name in dict.fromkeys(check.partition(":")[0] for check in CHECKS) if name != "timer"]
    findings = made(Wrong("nothing", ()), *groups)
    statuses = {name: (each.finding.status, each.finding.found) for name, each in findings.items()}
    assert {name for name, (status, _) in statuses.items() if status == SKIPPED} == {"baud"}
    assert {name: found for name, (status, found) in statuses.items() if status == FAIL} == {}
    assert set(CHECKS) - {"numbers", "timer: steps", "timer: drift"} <= set(statuses)


@pytest.mark.parametrize("wrong", WRONG, ids=[wrong.what for wrong in WRONG])
def test_a_mistake_is_found_by_the_checks_that_are_there_for_it(made: Made, wrong: Wrong) -> None:
    findings = made(wrong, *("numbers" if check.startswith("numbers") else check for check in wrong.checks))
    for check in wrong.checks:
        assert findings[check].finding.status == FAIL, {name: each.finding.found for name, each in findings.items()}
        assert findings[check].finding.found.count("\n") == 0


def test_every_check_is_failed_by_some_board() -> None:
    failed = {check.partition(": ")[0] if check.startswith("numbers") else check for w in WRONG for check in w.checks}
    assert set(CHECKS) - failed == set(ELSEWHERE)


def test_a_board_that_dies_is_started_again_once_and_then_given_up(made: Made) -> None:
    findings = list(made(Wrong("it dies", (), board=Dies), "states", "config", "ticks").values())
    statuses = [each.finding.status for each in findings]
    assert PASS in statuses
    skipped = [each.finding.found for each in findings if each.finding.status == SKIPPED]
    assert skipped
    assert set(skipped) == {GONE}


def test_what_is_wrong_is_said_in_words(made: Made) -> None:
    by_what = {wrong.what: wrong for wrong in WRONG}

    def said(what: str, check: str) -> str:
        wrong = by_what[what]
        return made(wrong, check.partition(":")[0])[check].finding.found

    assert said("STOP is ignored", "states: running") == ("STOP, then TICK(0): expected HELLO (nonce 0); got nothing")
    assert said("the index of a bad word is one too high", "config: bad words").startswith(
        "pd: form -1: expected status 1, index 2, hash 00000000, got status 1, index 3, hash 00000000; and "
    )
    assert "COMMAND(37): expected torque" in said("a torque is off by one count in one tick", "numbers: pd")
    assert said("the frame behind garbage is lost", "receiver: garbage") == (
        "three bytes: expected 1 of 1 SAMPLEs answered, got 0"
    )


def test_a_board_that_answers_anything_fails_and_breaks_nothing(made: Made) -> None:
    """Whatever frames come, every check ends as pass, fail or skipped, never with a traceback."""
    groups = [name for name in dict.fromkeys(check.partition(":")[0] for check in CHECKS) if name != "timer"]
    for seed in range(3):
        Babbles.rng.seed(seed)
        findings = made(Wrong("it babbles", (), board=Babbles), *groups, ticks=10)
        assert sum(each.finding.status == FAIL for each in findings.values()) > 10
