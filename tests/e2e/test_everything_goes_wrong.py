"""The link, the board and the instruments at once: one decision per frame, the same bytes everywhere; it replays.

Row 8 of the issue: a run with loss, corruption and two restarts replays identically.
"""

from __future__ import annotations

import pytest

from protocol.frames import Type
from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_values

SCENARIO = {
    "duration_s": 60,
    "seed": 8,
    "link": {
        "url": "pty",
        "baud": 115200,
        "faults": {
            "drop": 0.05,
            "bit_error_rate": 1e-4,
            "duplicate": 0.05,
            "jitter": {"distribution": "exponential", "mean_s": 0.02, "max_s": 0.15},
        },
    },
    "events": [
        {"at_s": 10, "do": "link.disconnect", "for_s": 8},
        {"at_s": 24.8, "do": "board.restart", "for_s": 6},
        {"at_s": 30, "do": "link.disconnect", "for_s": 3},
        {"at_s": 40, "do": "board.restart", "for_s": 6},
        {"at_s": 50, "do": "setpoint", "deg": [5, 0, 0]},
    ],
    "sensors": {"attitude": {"noise_deg": 0.02, "faults": [{"kind": "intermittent", "fraction": 0.05}]}},
    "actuators": {"wheels": {"faults": [{"kind": "wrong", "scale": 0.8, "axis": "z"}]}},
    "metrics": {"diverged_deg": None},
}


def fly(folder, url="pty", **values):
    return run_scenario(load_values({**SCENARIO, "link": {**SCENARIO["link"], "url": url}, **values}), folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("everything") / "run"
    return fly(folder, board="inproc"), open_run(folder)


@pytest.mark.parametrize(("board", "url"), [("process", "pty"), ("native", "pty"), ("cortex-m", "pty")])
def test_every_board_leaves_the_same_bytes(tmp_path, recorded, board, url):
    made = fly(tmp_path, url, board=board)
    assert (made["exit_code"], made["failure"]) == (0, "")
    assert made["sha256"] == recorded[0]["sha256"]


@pytest.mark.parametrize("board", ["process", "native"])
def test_a_paced_run_without_a_real_miss_does_too(tmp_path, recorded, board):
    for attempt in range(3):
        made = fly(tmp_path / str(attempt), board=board, clock="scaled:20")
        assert made["failure"] == ""
        if made["reproducible"]:
            assert made["sha256"] == recorded[0]["sha256"]
            return
    pytest.skip("not shown: real misses in three runs (this machine is too busy)")


def test_it_replays_identically_in_three_sessions(recorded):
    summary, run = recorded
    report = replay(run)
    assert report.first is None
    assert (report.sessions, run.sessions) == (3, [0, 62, 92])
    assert summary["reproducible"] is True
    assert summary["link"]["real_misses"] == 0


def test_every_frame_has_one_fate_and_a_lost_one_its_cause(recorded):
    _, run = recorded
    own = [row for row in run.packets if not row.copy]
    assert len({(row.tick, row.direction, row.type, row.sequence) for row in own}) == len(own)
    lost = {(row.tick, row.cause) for row in own if row.fate == "dropped"}
    assert {tick for tick, cause in lost if cause == "disconnect"} == {*range(20, 36), *range(62, 66)}
    assert all(cause for _, cause in lost)
    assert {cause for _, cause in lost} >= {"drop", "disconnect"}
    assert any(row.fate == "corrupted" for row in own)
    sampled = {row.tick for row in own if row.type == Type.SAMPLE}
    assert sampled == set(range(120)) - set(range(50, 62)) - set(range(80, 92))
