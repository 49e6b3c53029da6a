"""Every kind of fault of every instrument in one run: the same bytes on every board, link and clock; it replays."""

from __future__ import annotations

import pytest

from protocol import events
from sil import open_run
from sil.replay import replay
from sil.runner import run_scenario
from sil.scenario import load_values


def each_kind(bias, **own):
    """Seven faults, 5 s each, one after the other from 5 s on."""
    keys = {
        "wrong": {bias: 0.01},
        "slow": {"period_s": 1.7},
        "delayed": {"delay_s": 1.2},
        "intermittent": {"fraction": 0.4},
    }
    kinds = ("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
    axis = {} if own.get("whole") else {"axis": "y"}
    return [{"kind": kind, "at_s": 5 + 6 * n, "for_s": 5, **keys.get(kind, {}), **axis} for n, kind in enumerate(kinds)]


SCENARIO = {
    "duration_s": 60,
    "seed": 3,
    "sensors": {
        "attitude": {"noise_deg": 0.02, "faults": each_kind("bias_deg")},
        "quaternion": {"enabled": True, "faults": each_kind("bias_deg", whole=True)},
        "rate": {"enabled": True, "noise_degps": 0.001, "faults": each_kind("bias_degps")},
    },
    "actuators": {"wheels": {"faults": [*each_kind("bias_Nm")]}},
    "events": [{"at_s": 22.5, "do": "board.restart", "for_s": 6}],
    "metrics": {"diverged_deg": None},
}


def fly(folder, **values):
    return run_scenario(load_values({**SCENARIO, **values}), folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faults") / "run"
    return fly(folder, board="inproc"), open_run(folder)


@pytest.mark.parametrize(("board", "link"), [("process", "udp"), ("native", "pty"), ("cortex-m", "pty")])
def test_every_board_leaves_the_same_bytes(tmp_path, recorded, board, link):
    made = fly(tmp_path, board=board, link={"url": link})
    assert (made["exit_code"], made["failure"]) == (0, "")
    assert made["sha256"] == recorded[0]["sha256"]


def test_a_paced_run_without_a_real_miss_does_too(tmp_path, recorded):
    for attempt in range(3):
        made = fly(tmp_path / str(attempt), board="native", link={"url": "pty"}, clock="scaled:20")
        if made["reproducible"]:
            assert made["sha256"] == recorded[0]["sha256"]
            return
    pytest.skip("not shown: real misses in three runs (this machine is too busy)")


def test_another_seed_is_another_garbage(tmp_path, recorded):
    """The comparisons above can fail."""
    quiet = {**SCENARIO["sensors"], "attitude": {"faults": [{"kind": "garbage", "at_s": 50}]}}
    shas = {fly(tmp_path / str(seed), board="inproc", sensors=quiet, seed=seed)["sha256"] for seed in (3, 4, 5)}
    assert len(shas) == 3


def test_it_replays_identically(recorded):
    _, run = recorded
    report = replay(run)
    assert report.first is None
    assert (report.ticks, report.sessions, report.lost) == (120 - 12, 2, 0)


def test_every_fault_is_in_the_log(recorded):
    _, run = recorded
    begins, ends = (
        [(event.tick, event.a, event.b) for event in run.events if event.code == code]
        for code in (events.FAULT_BEGINS, events.FAULT_ENDS)
    )
    assert begins == [(10 + 12 * kind, instrument, kind) for kind in range(7) for instrument in range(4)]
    assert ends == [(tick + 10, instrument, kind) for tick, instrument, kind in begins]
    invalid = {event.tick for event in run.events if event.code == events.READING_INVALID}
    assert set(range(10, 20)) <= invalid < set(range(10, 20)) | set(range(82, 92))
