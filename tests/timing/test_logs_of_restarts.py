"""The log of a run whose board restarted: its order, its replay, what is left of it when the laboratory is killed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from benches import StallingClock
from reset_boards import AFTER, BEFORE, COMMAND, install

from firmware_sim.flight import Flight
from protocol import events
from protocol.frames import Type
from sil import rejoin as lab_rejoin
from sil import session as lab_session
from sil.replay import replay
from sil.report.info import info, text
from sil.rig import assemble, record_config
from sil.runner import host_facts, identity
from sil.runs import open_run
from sil.scenario import load_values
from sil.sinks.journal import Journal, Kind, read_journal
from sil.sinks.recorder import JournalRecorder
from sil.sinks.seal import recover, seal
from sil.trouble import LinkFailure

TICKS = 40


FAULTS = {
    "drop": 0.15, "bit_error_rate": 2e-4, "byte_loss": 2e-4, "duplicate": 0.2, "reorder": 0.1,
    "jitter": {"max_s": 1.2}, "burst": {"share": 0.1, "mean_ticks": 3},
}  # fmt: skip


def fly(folder: Path, script, clock=None, limit=5, law="appc", faults=None, seed=0, **how):
    """A run of 20 s into `folder`, sealed; the message when the board ended it, else ""."""
    values = {"board": "inproc", "duration_s": TICKS * 0.5, "restart_limit": limit, "law": {"name": law}}
    link = {"url": "udp", "faults": faults or {}}
    scenario = load_values({**values, "seed": seed, "link": link, "sensors": {"attitude": {"noise_deg": 0.02}}})
    folder.mkdir(exist_ok=True)
    recorder = JournalRecorder(Journal(folder / "run.journal"))
    rig = assemble(scenario, recorder, None, lambda line: None, clock=clock)
    board = install(rig, script, **how)
    if clock is not None:
        clock.board = board
    recorder.start(identity(scenario, rig), host_facts(scenario, rig))
    recorder.session(0)
    record_config(rig, recorder, 0)
    failure, reason = "", "failed"
    try:
        _, reason = rig.loop.run(lambda: False, lambda tick, motion: None)
    except LinkFailure as error:
        failure = str(error)
    rig.stop(0)
    ticks = rig.loop.ticks_done
    recorder.end(ticks - 1, reason, ticks)
    seal(folder)
    return failure


SCRIPTS = {
    **{f"before the answer to tick {k}": ({k: [BEFORE]}, [0, k + 1], TICKS - 1) for k in (0, 1, 2, 3, 4, 5, 10)},
    **{f"behind COMMAND({k})": ({k: [COMMAND]}, [0, k + 1], TICKS) for k in (0, 3, 10)},
    "between ticks": ({10: [AFTER]}, [0, 12], TICKS - 1),
    "twice": ({10: [BEFORE], 20: [COMMAND]}, [0, 11, 21], TICKS - 1),
    "twice running": ({10: [BEFORE], 11: [BEFORE]}, [0, 11, 12], TICKS - 2),
    "early and again": ({1: [COMMAND], 2: [BEFORE]}, [0, 2, 3], TICKS - 1),
    "before the last answer": ({TICKS - 1: [BEFORE]}, [0], TICKS - 1),
    "behind the last COMMAND": ({TICKS - 1: [COMMAND]}, [0], TICKS),
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_run_with_restarts_replays_identically(tmp_path, name):
    script, sessions, compared = SCRIPTS[name]
    assert fly(tmp_path, script) == ""
    run = open_run(tmp_path)
    assert run.sessions == sessions
    report = replay(run)
    assert report.first is None
    assert (report.ticks, report.sessions, report.lost) == (compared, len(sessions), TICKS - compared)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("ticks", [(0, 1), (3, 20), (10, 11), (12, 30)], ids=str)
def test_restarts_on_a_link_with_every_fault_replay_identically(tmp_path, ticks, seed):
    """A board restarts at the first SAMPLE that it gets of these ticks, be it in time or stale."""
    first, second = ticks
    script = {first: [BEFORE], second: [COMMAND if second > 4 else BEFORE]}
    assert fly(tmp_path, script, faults=FAULTS, seed=seed) == ""
    run = open_run(tmp_path)
    assert {row.fate for row in run.packets} >= {"dropped", "late", "corrupted"}
    report = replay(run)
    assert report.first is None
    assert report.sessions == len(run.sessions)
    assert report.ticks + report.lost == TICKS


@pytest.mark.parametrize("law", ["pd", "mrac"])
def test_other_laws_too(tmp_path, law):
    assert fly(tmp_path, {2: [BEFORE], 20: [BEFORE]}, law=law) == ""
    assert replay(open_run(tmp_path)).identical


def test_replay_sees_a_difference_in_the_second_session(tmp_path, monkeypatch):
    honest = Flight.step

    def other(self, tick, sample):
        command, *rest = honest(self, tick, sample)
        x, y, z = command.torque
        return [command._replace(torque=(x + (tick == 15), y, z)), *rest]

    with monkeypatch.context() as patch:
        patch.setattr(Flight, "step", other)
        fly(tmp_path, {10: [BEFORE]})
    report = replay(open_run(tmp_path))
    assert report.first is not None
    assert (report.first.tick, report.ticks, report.sessions) == (15, 14, 2)


def test_a_board_that_boots_slowly_on_a_clock_leaves_ticks_without_frames(tmp_path, monkeypatch):
    monkeypatch.setattr(lab_session, "HELLO_EVERY_S", 0.0)
    monkeypatch.setattr(lab_rejoin, "BACK_WITHIN_S", 60.0)
    assert fly(tmp_path, {10: [BEFORE]}, clock=StallingClock(), boots=12) == ""
    run = open_run(tmp_path)
    start = run.sessions[1]
    assert start > 13
    assert {row.tick for row in run.packets if row.type == Type.SAMPLE} == {*range(11), *range(start, TICKS)}
    report = replay(run)
    assert report.identical
    assert (report.ticks, report.lost) == (TICKS - (start - 10), 1)


def test_a_hang_that_a_reset_ends_leaves_samples_without_answers(tmp_path):
    clock = StallingClock()
    clock.at_wait = lambda t_ns: clock.board.reset() if t_ns == 16 * 500_000_000 else None
    assert fly(tmp_path, {10: ["hang"]}, clock=clock) == ""
    report = replay(open_run(tmp_path))
    assert report.identical
    assert report.lost == 6  # 10 to 15, or one more: the reset comes as the lab goes to sleep before 16
    assert report.sessions == 2


def test_a_run_that_a_restart_ended_replays_up_to_it(tmp_path):
    assert "restarted at tick 10" in fly(tmp_path, {10: [COMMAND]}, limit=0)
    run = open_run(tmp_path)
    assert run.end["reason"] == "failed"
    report = replay(run)
    assert report.identical
    assert report.ticks == 11


def test_the_order_of_the_log_is_that_of_the_contract(tmp_path):
    fly(tmp_path, {10: [BEFORE], 11: [COMMAND], 12: [BEFORE]})
    keys = [(row.tick, row.direction == "down", row.type, row.sequence) for row in open_run(tmp_path).packets]
    assert keys == sorted(keys)
    assert len(keys) == len(set(keys))  # no tick has frames of two sessions


def test_info_names_the_sessions(tmp_path):
    fly(tmp_path, {10: [BEFORE]})
    content = info(open_run(tmp_path))
    assert content["sessions"] == [0, 11]
    assert content["metrics"]["restarts"] == 1
    assert "board sessions            2, from ticks 0, 11: the board restarted" in text(content)
    assert "BOARD_RESTARTED (laboratory)" in text(content)


def test_the_recomputed_reference_starts_anew_with_the_board(tmp_path):
    fly(tmp_path, {10: [BEFORE], 13: [COMMAND]})
    assert info(open_run(tmp_path))["metrics"]["reference_mismatch_deg"] < 1e-5


def test_a_journal_cut_off_anywhere_is_recovered_with_its_sessions(tmp_path):
    whole = tmp_path / "whole"
    fly(whole, {3: [BEFORE], 10: [COMMAND], 20: [BEFORE], 21: [BEFORE]})
    commits = [record for record in read_journal(whole / "run.journal") if record.kind == Kind.COMMIT]
    starts = open_run(whole).sessions
    for number, record in enumerate(commits[5:-1:3]):
        cut = tmp_path / str(number)
        cut.mkdir()
        shutil.copy(whole / "run.journal", cut)
        with open(cut / "run.journal", "r+b") as file:
            file.truncate(record.offset + 13 + 7)  # its COMMIT, and a part of what follows
        report = recover(cut)
        assert report.ticks == record.tick + 1
        run = open_run(cut)
        assert run.sessions == [start for start in starts if start <= record.tick]
        restarts = sum(event.code == events.BOARD_RESTARTED for event in run.events)
        assert restarts == sum(tick <= record.tick for tick in (3, 10, 20, 21))
        assert replay(run).identical
