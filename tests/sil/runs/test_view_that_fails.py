"""A view that fails costs the view and never the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from sil import open_run
from sil.runner import run_scenario
from sil.scenario import load_scenario
from sil.watch import Watch

CALLS = ("stage", "plugged", "tick", "event")


@pytest.mark.parametrize("broken", CALLS)
def test_a_watch_that_raises_does_not_end_the_run(broken: str, tmp_path: Path, capsys) -> None:
    calls: list[str] = []

    def raising(*_: object) -> None:
        calls.append(broken)
        raise TypeError("cannot draw")

    watch = Watch()
    setattr(watch, broken, raising)
    watch.close = lambda: calls.append("close")  # type: ignore[method-assign]
    # an answer delay beyond the period gives events
    sets = ["duration_s=10", "require=[]", "board=inproc", "answer_delay_s=0.6", "expect_missed=true"]
    summary = run_scenario(load_scenario("appc-rs232", sets), tmp_path / "run", watch)
    assert summary["exit_code"] == 0 and len(open_run(tmp_path / "run")) == 20
    said = capsys.readouterr().err
    assert calls == [broken, "close"], "called again after it failed, or not closed"
    assert said == "view: TypeError: cannot draw; the run goes on without it\n"
