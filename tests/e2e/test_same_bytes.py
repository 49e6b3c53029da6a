"""One scenario, the same bytes: over any link, twice, in lockstep and on a clock. And replay, which proves it again."""

from __future__ import annotations

import json
import random

import numpy as np
import pytest

from protocol import frames
from protocol.frames import Type
from sil import open_run
from sil.replay import decoded, replay
from sil.runner import run_scenario
from sil.scenario import load_scenario
from sil.sinks.journal import Journal, Kind, packet_payload, read_journal, read_packet
from sil.sinks.seal import seal

NOISY = ["sensors.attitude.noise_deg=0.02", "require=[]"]


def fly(folder, name, *sets):
    return run_scenario(load_scenario(name, [*NOISY, *sets]), folder)


@pytest.mark.parametrize("law", ["appc-rs232", "mrac-rs232"])
def test_lockstep_over_pty_udp_and_in_process_and_twice(tmp_path, law):
    hashes = {
        name: fly(tmp_path / name, law, *sets)["sha256"]
        for name, sets in {
            "pty": ["link.url=pty"],
            "again": ["link.url=pty"],
            "udp": ["link.url=udp"],
            "inproc": ["link.url=inproc", "board=inproc"],
        }.items()
    }
    assert len(set(hashes.values())) == 1, hashes


def test_another_seed_gives_other_bytes(tmp_path):
    """The comparison above can fail."""
    assert fly(tmp_path / "a", "appc-rs232")["sha256"] != fly(tmp_path / "b", "appc-rs232", "seed=1")["sha256"]


@pytest.mark.parametrize(("clock", "duration_s"), [("scaled:20", 100), ("realtime", 10)], ids=["scaled", "realtime"])
def test_a_paced_run_without_a_real_miss_gives_the_lockstep_bytes(tmp_path, clock, duration_s, record_property):
    """A real miss makes the comparison inconclusive: repeated at most three times, then reported as not shown."""
    expected = fly(tmp_path / "lockstep", "appc-rs232", f"duration_s={duration_s}", "clock=lockstep")["sha256"]
    for attempt in range(3):
        summary = fly(tmp_path / str(attempt), "appc-rs232", f"duration_s={duration_s}", f"clock={clock}")
        if summary["reproducible"]:
            assert summary["sha256"] == expected
            return
    record_property("inconclusive", f"real misses in three runs on {clock}: not shown")
    pytest.skip(f"not shown: real misses in three runs on {clock} (this machine is too busy)")


SAMPLED = [
    "duration_s=30",
    "period_s=0.1",
    "law.name=pd",
    "sensors.sampling={period_s: 0.13, delay_s: 0.05, jitter_s: 0.02}",
    "sensors.rate={enabled: true, noise_degps: 0.01, sampling: {delay: unit}}",
    "actuators={kind: thrusters, thrusters: {misalignment_percent: 5, faults: [{kind: 'off', at_s: 20, axis: y}]}}",
    "plant.step_s=0.001",
]


def test_sensors_at_their_own_pace_and_thrusters_give_the_same_bytes_everywhere(tmp_path, record_property):
    """Instants between ticks, jitter and noise are of seed and sample; a restart of the board moves none of them."""
    wheres = {"pty": ["link.url=pty"], "udp": ["link.url=udp"], "inproc": ["board=inproc"]}
    wheres["clock"] = ["clock=scaled:15"]
    found = {where: fly(tmp_path / where, "pd-root-locus", *SAMPLED, *sets) for where, sets in wheres.items()}
    if not found["clock"].pop("reproducible"):
        record_property("inconclusive", "real misses on scaled:15: not shown")
        del found["clock"]
    assert len({summary["sha256"] for summary in found.values()}) == 1
    run = open_run(tmp_path / "pty")
    assert len(np.unique(run.samples["age_us"][:, 0])) > 100, "instants between the ticks"
    assert not run.momentum_Nms.any()
    assert replay(run).identical
    restarted = fly(tmp_path / "restart", "pd-root-locus", *SAMPLED, "events=[{at_s: 5, do: board.restart, for_s: 1}]")
    assert restarted["sha256"] != found["pty"]["sha256"]
    samples = open_run(tmp_path / "restart").samples
    assert len(samples) == len(run.samples) - 10
    assert (samples["age_us"] == run.samples["age_us"][np.isin(run.samples["tick"], samples["tick"])]).all()


# -- replay ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("replay") / "run"
    run_scenario(load_scenario("mrac-rs232", [*NOISY, "board=inproc", "link.url=inproc"]), folder)
    return folder


def tampered(recorded, folder, type_, tick, change):
    """The run with one frame altered, its CRC made valid again, sealed anew."""
    folder.mkdir()
    journal = Journal(folder / "run.journal")
    for record in read_journal(recorded / "run.journal"):
        payload = record.payload
        if record.kind == Kind.PACKET and record.tick == tick:
            direction, fate, packet, *_ = read_packet(payload)
            if packet[1] == type_:
                opened = frames.unpack(packet)
                payload = packet_payload(direction, fate, frames.pack(change(opened.frame), opened.sequence))
                assert payload != record.payload
        if record.kind == Kind.COMMIT:
            journal.commit(record.tick)
        else:
            journal.add(record.kind, record.tick, payload)
    journal.close()
    seal(folder)
    return open_run(folder)


def nudge_reading(sample):
    euler = sample.readings[0]
    x, y, z = euler.values
    return sample._replace(readings=(euler._replace(values=(x + 2**16, y, z)), *sample.readings[1:]))


def nudge_torque(command):
    x, y, z = command.torque
    return command._replace(torque=(x, y + 1, z))


def test_replay_is_identical(recorded):
    report = replay(open_run(recorded))
    assert report.identical
    assert (report.ticks, report.config) == (1200, [])


@pytest.mark.parametrize("law", ["pd-root-locus", "appc-udp", "mrac-as-printed-no-delay"])
def test_replay_of_other_laws_is_identical(tmp_path, law):
    run_scenario(load_scenario(law, [*NOISY, "duration_s=100", "board=inproc", "link.url=inproc"]), tmp_path / "run")
    assert replay(open_run(tmp_path / "run")).identical


def test_a_changed_parameter_is_reported_and_differs(recorded):
    report = replay(open_run(recorded), ["law.params.c2_pole=0.7"])
    assert report.config == [("c2_pole", "0.8", "0.7")]
    assert report.first is not None
    assert report.first.tick == 0
    assert "COMMAND tick=0" in decoded(report.first.replayed)


@pytest.mark.parametrize("seed", range(4))
def test_one_altered_sample_shows_within_two_ticks(recorded, tmp_path, seed):
    tick = random.Random(seed).randrange(10, 1190)
    first = replay(tampered(recorded, tmp_path / "altered", Type.SAMPLE, tick, nudge_reading)).first
    assert first is not None
    assert tick <= first.tick <= tick + 2


@pytest.mark.parametrize("seed", range(4))
def test_one_altered_command_shows_at_its_tick(recorded, tmp_path, seed):
    tick = random.Random(100 + seed).randrange(0, 1200)
    first = replay(tampered(recorded, tmp_path / "altered", Type.COMMAND, tick, nudge_torque)).first
    assert first is not None
    assert first.tick == tick


def test_a_board_that_adds_one_lsb_at_tick_700_is_found_at_700(recorded, monkeypatch):
    from firmware_sim.flight import Flight

    honest = Flight._control

    def dishonest(self, tick, notices):
        torque, flags = honest(self, tick, notices)
        return ((torque[0] + 1, *torque[1:]) if tick == 700 else torque), flags

    monkeypatch.setattr(Flight, "_control", dishonest)
    first = replay(open_run(recorded)).first
    assert first is not None
    assert first.tick == 700


def test_a_users_law_that_was_edited_since_is_named(tmp_path):
    law = tmp_path / "law.py"
    text = "class L:\n    PARAMS = {}\n    def init(self, p): pass\n    def step(self, s): return (%s, 0.0, 0.0)\n"
    law.write_text(text % "1e-3")
    (tmp_path / "s.yaml").write_text("law: {name: ./law.py:L, form: float}\nduration_s: 10\nboard: inproc\n")
    run_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path / "run")
    same = replay(open_run(tmp_path / "run"))
    assert same.identical
    assert same.law_file == ""
    law.write_text(text % "2e-3")
    edited = replay(open_run(tmp_path / "run"))
    assert edited.first is not None
    assert "has changed" in edited.law_file


def test_not_a_number_anywhere_is_a_failure(tmp_path):
    (tmp_path / "law.py").write_text(
        "class L:\n    PARAMS = {}\n    def init(self, p): pass\n"
        "    def step(self, s): return (float('nan') if s.tick == 5 else 0.0, 0.0, 0.0)\n"
    )
    (tmp_path / "s.yaml").write_text("law: {name: ./law.py:L, form: float}\nduration_s: 10\nboard: inproc\n")
    summary = run_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path / "run")
    assert (summary["verdict"], summary["exit_code"], summary["not_a_number"]) == ("failed", 1, 1)


def test_diff_looks_through_another_number_of_config_parts(tmp_path):
    from sil.report.diff import diff

    short = ["duration_s=10", "board=inproc"]
    for name, extra in (("a", []), ("b", ["guidance.profile=hold"])):
        run_scenario(load_scenario("appc-rs232", ["require=[]", *short, *extra]), tmp_path / name)
    found = diff(open_run(tmp_path / "a"), open_run(tmp_path / "b"))
    assert found.packet is None or found.packet.tick > 0


def test_replay_of_a_run_without_a_board_says_so(tmp_path):
    from sil.trouble import UsageError

    run_scenario(load_scenario("rigid-open-loop", ["duration_s=10"]), tmp_path / "run")
    with pytest.raises(UsageError, match="nothing to replay"):
        replay(open_run(tmp_path / "run"))


def test_run_mcap_says_nothing_of_clock_link_board_or_host(recorded):
    run = open_run(recorded)
    assert not {"clock", "link", "board", "out"} & set(run.scenario)
    assert "hostname" not in json.dumps(run.meta)
