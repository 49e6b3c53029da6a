"""Faults in whole runs: the same seed gives the same bytes everywhere, and the log tells every fault and replays."""

from __future__ import annotations

import importlib.util
from collections import Counter

import pytest

from protocol import events
from protocol.channel import Damage
from protocol.codec import encode
from protocol.frames import Type
from sil import open_run
from sil.replay import replay
from sil.report.info import info, text
from sil.rig import channel_of
from sil.runner import run_scenario
from sil.scenario import load_scenario
from sil.screen.reading import Reader
from sil.sinks.journal import Fate
from sil.watch import Watch

FAULTS = [
    "link.faults.drop=0.08",
    "link.faults.burst={share: 0.05, mean_ticks: 4}",
    "link.faults.bit_error_rate=1e-4",
    "link.faults.byte_loss=1e-4",
    "link.faults.duplicate=0.1",
    "link.faults.delay_s=0.02",
    "link.faults.jitter={distribution: exponential, mean_s: 0.05, max_s: 0.4}",
    "link.faults.disconnect=[[0, 2], [20, 30]]",
    "link.baud=115200",
    "sensors.attitude.noise_deg=0.02",
    "require=[]",
]
EMULATOR = all(importlib.util.find_spec(name) for name in ("unicorn", "elftools"))


def fly(folder, *sets, law="appc-rs232", faults=FAULTS):
    return run_scenario(load_scenario(law, [*faults, "duration_s=100", *sets]), folder)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """(run directory, summary) of the flight in lockstep, in process."""
    folder = tmp_path_factory.mktemp("faulty") / "run"
    return folder, fly(folder, "board=inproc", "link.url=inproc")


@pytest.mark.parametrize(
    "sets",
    [
        ["link.url=pty"],
        ["link.url=udp"],
        ["board=native"],
        ["board=native", "link.url=udp"],
        pytest.param(["board=cortex-m"], marks=pytest.mark.skipif(not EMULATOR, reason="no emulator here")),
    ],
    ids=["pty", "udp", "native", "native over udp", "cortex-m"],
)
def test_the_same_bytes_over_every_link_and_on_every_board(recorded, tmp_path, sets):
    assert fly(tmp_path / "run", *sets)["sha256"] == recorded[1]["sha256"]


@pytest.mark.parametrize("sets", [["link.url=pty"], ["link.url=udp"]], ids=["pty", "udp"])
def test_the_same_bytes_on_a_clock(recorded, tmp_path, sets, record_property):
    """A real miss makes the comparison inconclusive: repeated at most three times, then reported as not shown."""
    for attempt in range(3):
        summary = fly(tmp_path / str(attempt), "clock=scaled:20", *sets)
        if summary["reproducible"]:
            assert summary["sha256"] == recorded[1]["sha256"]
            return
    record_property("inconclusive", "real misses in three runs on scaled:20: not shown")
    pytest.skip("not shown: real misses in three runs (this machine is too busy)")


def test_another_seed_gives_other_losses(recorded, tmp_path):
    """The comparisons above can fail."""
    other = fly(tmp_path / "run", "board=inproc", "seed=1")
    assert other["sha256"] != recorded[1]["sha256"]
    assert other["fates"] != recorded[1]["fates"]


def test_two_laws_lose_the_same_frames(recorded, tmp_path):
    fly(tmp_path / "run", "board=inproc", law="pd-root-locus")
    told = []
    for folder in (recorded[0], tmp_path / "run"):
        kinds = (Type.SAMPLE, Type.COMMAND)
        rows = [row for row in open_run(folder).packets if row.type in kinds]
        told.append({(r.tick, r.type, r.copy): r.cause if r.fate == "dropped" else "" for r in rows})
    assert len(told[0]) > 400
    assert told[0] == told[1]


TIMELINE = (
    "events=[{at_s: 12, do: link.disconnect, for_s: 3}, {at_s: 40.2, do: board.restart, for_s: 6}, "
    "{at_s: 42, do: link.disconnect, for_s: 5}, {at_s: 70, do: board.restart, for_s: 5}]"
)


def test_with_restarts_and_disconnections_on_the_timeline_too(tmp_path, record_property):
    """Replay of a run with loss, corruption and two restarts: identical; and the same bytes on another board."""
    expected = fly(tmp_path / "lockstep", "board=inproc", TIMELINE)
    run = open_run(tmp_path / "lockstep")
    assert len(run.sessions) == 3
    assert {row.cause for row in run.packets} > {"board.restart", "disconnect", "drop", "burst", "bit errors"}
    report = replay(run)
    assert report.first is None
    assert report.sessions == 3
    assert fly(tmp_path / "native", "board=native", TIMELINE)["sha256"] == expected["sha256"]
    for attempt in range(3):
        summary = fly(tmp_path / str(attempt), "board=native", "clock=scaled:10", TIMELINE)
        if summary["reproducible"]:
            assert summary["sha256"] == expected["sha256"]
            return
    record_property("inconclusive", "real misses in three runs on scaled:10: not shown")


# -- the log -----------------------------------------------------------------------------------------------------------


def test_every_frame_of_the_log_has_one_fate_and_its_cause(recorded):
    folder, summary = recorded
    packets = open_run(folder).packets
    once = Counter((row.tick, row.direction, row.type, row.sequence, row.copy) for row in packets)
    assert set(once.values()) == {1}
    causes = Counter((row.fate, row.cause) for row in packets)
    for cause in ("drop", "burst", "disconnect"):
        assert causes["dropped", cause]
    assert causes["corrupted", "bit errors"]
    assert causes["late", "jitter"]
    assert not [row for row in packets if row.fate != "delivered" and not row.cause]
    ways = summary["fates"]
    for way in ("up", "down"):
        counts = ways[way]
        assert counts["frames"] == sum(counts[fate.name.lower()] for fate in Fate)
        own = [row for row in packets if row.direction == way and not row.copy]
        assert counts["frames"] == len(own)
        assert counts["copies"] == sum(row.direction == way and row.copy > 0 for row in packets)
        assert counts["causes"]["dropped"]["drop"] == sum(row.cause == "drop" for row in own)
    assert ways["up"]["frames"] == 1 + 200  # CONFIG, and a SAMPLE each tick


def test_the_summary_counts_what_the_model_corrupts_apart_from_what_the_real_link_does(recorded, tmp_path):
    """A user who asks for bit errors and reads `crc errors 0` alone would think that there were none."""
    own = [row for row in open_run(recorded[0]).packets if row.fate == "corrupted" and not row.copy]
    assert {row.direction for row in own} == {"up", "down"}
    for link in (recorded[1]["link"], fly(tmp_path / "run", "link.url=pty")["link"]):
        assert link["corrupted"] == len(own)
        assert (link["crc_errors"], link["discarded_bytes"]) == (0, 0)


def test_the_live_view_counts_them_too(tmp_path):
    class Onlooker(Watch):
        def plugged(self, scenario, rig):
            self.reader = Reader(scenario, rig, "reference")

    onlooker = Onlooker()
    scenario = load_scenario("appc-rs232", [*FAULTS, "duration_s=100", "board=inproc", "link.url=inproc"])
    summary = run_scenario(scenario, tmp_path / "run", onlooker)
    assert onlooker.reader.counters()["corrupted"] == summary["link"]["corrupted"] > 0


def test_altered_bytes_stand_in_the_log_and_nowhere_else(recorded):
    packets = open_run(recorded[0]).packets
    altered = [row for row in packets if row.encoded]
    assert {row.fate for row in altered} >= {"corrupted"}
    assert all("bit errors" in row.cause or "byte loss" in row.cause or row.fate == "late" for row in altered)
    for row in altered:
        if row.cause == "bit errors":
            whole = encode(row.packet)
            differ = int.from_bytes(whole, "little") ^ int.from_bytes(row.encoded, "little")
            bits = tuple(bit for bit in range(len(whole) * 8) if differ >> bit & 1)
            assert 1 <= len(bits) < 20
            assert Damage(bits, ()).of(whole) == row.encoded


def test_the_recorded_fates_are_those_of_the_channel(recorded):
    """Asked again, in another order, for another process."""
    scenario = load_scenario("appc-rs232", [*FAULTS, "duration_s=100"])
    channel = channel_of(scenario)
    for row in reversed([row for row in open_run(recorded[0]).packets if row.type == Type.SAMPLE]):
        fates = channel.fates("to_board", row.tick, row.type, 0, len(row.packet) + 3, row.tick * scenario.period_ns)
        fate = fates[row.copy]
        assert fate.arrival_ns == row.arrival_ns
        assert fate.delivered == (row.fate != "dropped")


def test_replay_is_identical(recorded):
    report = replay(open_run(recorded[0]))
    assert report.first is None
    assert (report.ticks, report.lost, report.config) == (200, 0, [])


@pytest.mark.parametrize("law", ["mrac-rs232", "pd-root-locus"])
def test_replay_of_other_laws_with_more_stale_samples_than_an_answer_can_tell(tmp_path, law):
    wild = [
        "link.faults.drop=0.1",
        "link.faults.jitter={max_s: 12}",
        "link.faults.duplicate=0.5",
        "sample_timeout_s=0.49",
    ]
    sets = ["board=inproc", "link.url=udp", "link.faults.reorder=0.2", "require=[]", "metrics.diverged_deg=null"]
    fly(tmp_path / "run", *sets, "board=inproc", law=law, faults=wild)
    run = open_run(tmp_path / "run")
    stale = Counter(event.tick for event in run.events if event.code == events.STALE_SAMPLE)
    assert max(stale.values()) > 12
    assert replay(run).first is None


def test_frames_in_flight_at_the_end(tmp_path):
    sets = ["link.faults.down.delay_s=0.3", "link.faults.up.jitter={max_s: 20}", "duration_s=30"]
    summary = fly(tmp_path / "run", "board=inproc", "link.url=udp", *sets, faults=["require=[]", "expect_missed=true"])
    run = open_run(tmp_path / "run")
    end_ns = run.period_ns * len(run)
    for row in run.packets:
        if row.fate in ("delivered", "late", "in_flight") and row.arrival_ns >= 0:
            assert (row.fate == "in_flight") == (row.arrival_ns >= end_ns)
    assert summary["fates"]["up"]["in_flight"] > 3
    assert replay(run).first is None


def test_info_and_screen_say_what_the_link_did(recorded, capsys):
    from sil.screen.summary import show

    shown = text(info(open_run(recorded[0])))
    assert "up SAMPLE dropped (disconnect)" in shown
    assert "down COMMAND delivered" not in shown
    show(recorded[1])
    told = " ".join(capsys.readouterr().out.split())
    assert "link up: 201 frames" in told
    assert "disconnect" in told


def test_a_run_without_faults_has_no_word_of_them(tmp_path):
    run_scenario(load_scenario("appc-rs232", ["duration_s=20", "board=inproc", "require=[]"]), tmp_path / "run")
    run = open_run(tmp_path / "run")
    assert "link" not in run.scenario
    assert {(row.fate, row.cause, row.encoded) for row in run.packets} == {("delivered", "", b"")}


def test_faults_are_part_of_what_is_run_and_baud_is_not(recorded):
    assert open_run(recorded[0]).scenario["link"]["faults"]["drop"] == 0.08
    assert set(open_run(recorded[0]).scenario["link"]) == {"faults"}


# -- sweeps ------------------------------------------------------------------------------------------------------------


def test_one_worker_or_two_the_same_losses(cli):
    axes = ("--vary", "link.faults.drop=0,0.05,0.2", "--vary", "seed=1,2", "--set", "board=inproc")
    for jobs in ("1", "2"):
        cli("sweep", "appc-rs232", *axes, "--set", "duration_s=50", "--set", "require=[]", "-j", jobs, "--out", jobs)
    one, two = ((cli.folder / jobs / "results.csv").read_bytes() for jobs in ("1", "2"))
    assert one == two
    assert len(one.splitlines()) == 7
