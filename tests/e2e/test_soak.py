"""Row 4 in small: the soak finds nothing wrong in ten simulated minutes, and does find what a broken log lacks."""

from __future__ import annotations

import pytest

from sil.answers import RECENT_ANSWERS
from sil.lateness import percentiles_us
from sil.runner import run_scenario
from sil.scenario import load_scenario
from sil.sinks.journal import Direction, Fate, Kind, read_journal, read_packet, read_timing
from tools import soak

RESTARTS = "events=[{at_s: 200, do: board.restart, for_s: 2}, {at_s: 400, do: board.restart, for_s: 2}]"
MINUTES = ("duration_s=600", RESTARTS)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """(run directory, scenario, report)."""
    folder = tmp_path_factory.mktemp("soak") / "run"
    scenario = load_scenario("appc-rs232", [*soak.overrides(24, 1, "inproc"), "link.url=inproc", *MINUTES])
    return folder, scenario, soak.soak(scenario, folder)


def test_nothing_is_wrong_and_every_frame_has_its_fate(flown):
    _, _, report = flown
    assert report["wrong"] == []
    assert (report["ticks"], report["sessions"], report["restarts_logged"]) == (1200, 3, 2)
    samples = {key: count for key, count in report["fates"].items() if key.startswith("up SAMPLE")}
    assert sum(samples.values()) == 1200 - 8
    assert samples["up SAMPLE dropped drop"] > 3


def kept(folder, tmp_path, keep):
    """The balance of a journal from which some records were left out."""
    whole = (folder / "run.journal").read_bytes()
    records = list(read_journal(folder / "run.journal"))
    ends = [record.offset for record in records[1:]] + [len(whole)]
    parts = [whole[record.offset : end] for record, end in zip(records, ends, strict=True) if keep(record)]
    (tmp_path / "run.journal").write_bytes(whole[: records[0].offset] + b"".join(parts))
    return soak.balanced(tmp_path / "run.journal")


def is_sample_of(record, tick):
    return record.tick == tick and record.kind == Kind.PACKET and read_packet(record.payload).direction == Direction.UP


def test_a_frame_without_a_fate_is_found(flown, tmp_path):
    balance = kept(flown[0], tmp_path, lambda record: not is_sample_of(record, 777))
    assert [line.partition(":")[0] for line in balance.wrong] == ["tick 777"]


def test_a_tick_and_a_fault_that_never_were_are_found(flown, tmp_path):
    """A soak whose link was clear by mistake shows nothing, and must not pass for one that held."""
    folder, scenario, _ = flown

    def clean(record):
        if record.kind != Kind.PACKET:
            return True
        return record.tick != 777 and read_packet(record.payload).fate in (Fate.DELIVERED, Fate.LATE)

    found = soak.missing(scenario, kept(folder, tmp_path, clean))
    assert "no frame was lost to drop" in found and "no frame was lost to bit errors" in found
    assert any(line.startswith("ticks with frames: ") for line in found)


def test_the_laboratory_keeps_no_number_for_every_tick(tmp_path):
    """Answer times of a whole run are in its log; what a process keeps of them is bounded, and the summary the same."""
    onlooker = soak.Onlooker()
    scenario = load_scenario("pd-root-locus", ["board=inproc", "link.url=inproc", "duration_s=600", "require=[]"])
    summary = run_scenario(scenario, tmp_path / "run", onlooker)
    answers = onlooker.rig.answers
    assert (answers.answered, len(answers.answer_ns)) == (1200, RECENT_ANSWERS)
    records = read_journal(tmp_path / "run" / "run.journal")
    times_ns = [read_timing(record.payload).answer_ns for record in records if record.kind == Kind.TIMING]
    assert len(times_ns) == 1200
    assert summary["timing"]["answer_us"] == percentiles_us(times_ns)


def test_a_leak_is_found():
    looks = [soak.Look(1000 * k, 250_000 + 17 * k, 250_000) for k in range(100)]
    slopes = {name: soak.slope_kB(looks, name) for name in ("lab_kB", "board_kB")}
    assert soak.too_steep(slopes) == ["lab_kB: 17.0 kB per 1000 ticks"]
