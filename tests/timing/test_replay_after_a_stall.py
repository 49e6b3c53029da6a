"""A lab that stood still leaves a log whose stale samples have their place; replay puts them there: identical."""

from __future__ import annotations

import pytest
from benches import StallingClock

from protocol import events
from sil.replay import replay
from sil.rig import assemble, record_config
from sil.runner import host_facts, identity
from sil.runs import open_run
from sil.scenario import load_values
from sil.sinks.journal import Journal
from sil.sinks.recorder import JournalRecorder
from sil.sinks.seal import seal

PERIOD_NS = 500_000_000


@pytest.mark.parametrize("ahead", [1, 3, 12])
def test_a_run_whose_board_was_ahead_replays_identically(tmp_path, ahead):
    scenario = load_values({"board": "inproc", "duration_s": 30.0, "sensors": {"attitude": {"noise_deg": 0.02}}})
    recorder = JournalRecorder(Journal(tmp_path / "run.journal"))

    def at_wait(t_ns):
        if t_ns == 20 * PERIOD_NS:
            for _ in range(ahead):
                rig.host.board.on_timer()

    rig = assemble(scenario, recorder, None, lambda line: None, clock=StallingClock(at_wait=at_wait))
    recorder.start(identity(scenario, rig), host_facts(scenario, rig))
    recorder.session(0)
    record_config(rig, recorder, 0)
    ticks, reason = rig.loop.run(lambda: False, lambda tick, motion: None)
    rig.stop(0)
    recorder.end(ticks - 1, reason, ticks)
    seal(tmp_path)
    run = open_run(tmp_path)
    assert sum(event.code == events.STALE_SAMPLE for event in run.events) == ahead
    assert rig.window.real_misses == ahead
    report = replay(run)
    assert report.identical
    assert report.ticks == 60
