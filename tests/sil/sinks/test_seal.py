"""run.mcap is a pure function of the journal: deterministic, ordered, readable by others, whole rows only."""

from __future__ import annotations

import errno
import io
import itertools
import json
import random
import sys
from pathlib import Path

import mcap_ros2.decoder
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from synthetic import PERIOD_NS, synthetic_journal

from protocol import events, frames
from sil.answers import REMEMBERED_TICKS
from sil.runs import open_run
from sil.sinks import journal as jn
from sil.sinks import seal as sealing
from sil.sinks.journal import Direction, Fate, Journal, JournalError, Kind, read_journal
from sil.sinks.seal import SealError, recover, seal


def rewritten(source: Path, target: Path, order: object = None) -> Path:
    """A journal with the records of each commit in another order."""
    target.mkdir()
    copy = Journal(target / "run.journal")
    pending: list[jn.Record] = []
    for record in read_journal(source / "run.journal"):
        if record.kind != Kind.COMMIT:
            pending.append(record)
            continue
        if isinstance(order, random.Random):
            order.shuffle(pending)
        for item in pending:
            copy.add(item.kind, item.tick, item.payload)
        copy.commit(record.tick)
        pending.clear()
    copy.close()
    return target


def test_same_journal_same_bytes(tmp_path: Path) -> None:
    a, b = (seal(synthetic_journal(tmp_path / name)) for name in "ab")
    assert a.sha256 == b.sha256
    assert seal(tmp_path / "a").sha256 == a.sha256
    assert (a.ticks, a.reason, a.complete, a.damage, a.left_out, a.undecoded) == (200, "finished", True, "", "", 0)
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["run.journal", "run.mcap", "timing.mcap"]


def test_arrival_order_leaves_no_trace(tmp_path: Path) -> None:
    source = synthetic_journal(tmp_path / "a")
    shuffled = rewritten(source, tmp_path / "b", random.Random(7))
    assert (source / "run.journal").read_bytes() != (shuffled / "run.journal").read_bytes()
    assert seal(source).sha256 == seal(shuffled).sha256


def delayed(source: Path, target: Path, tick: int, ticks: int) -> Path:
    """A journal in which the answer to `tick` is written `ticks` ticks after it, as after a long stall."""
    target.mkdir()
    copy, late = Journal(target / "run.journal"), []
    for record in read_journal(source / "run.journal"):
        packet = jn.read_packet(record.payload) if record.kind == Kind.PACKET else None
        if packet is not None and packet.direction == Direction.DOWN and record.tick == tick:
            late.append(record)
        elif record.kind != Kind.COMMIT:
            copy.add(record.kind, record.tick, record.payload)
        else:
            if record.tick == tick + ticks:
                for item in late:
                    copy.add(item.kind, item.tick, item.payload)
            copy.commit(record.tick)
    copy.close()
    return target


def log_times(folder: Path) -> list[int]:
    with open(folder / "run.mcap", "rb") as file:
        return [m.log_time for _, _, m in make_reader(file).iter_messages(log_time_order=False)]


def test_an_answer_as_late_as_the_laboratory_remembers_stands_at_its_tick(tmp_path: Path) -> None:
    source = synthetic_journal(tmp_path / "a", 700)
    late = seal(delayed(source, tmp_path / "b", 50, REMEMBERED_TICKS))
    assert late.too_late == 0
    assert late.sha256 == seal(source).sha256


def test_what_comes_later_than_that_is_counted_and_the_log_does_not_go_back_in_time(tmp_path: Path) -> None:
    source = delayed(synthetic_journal(tmp_path / "a", 700), tmp_path / "b", 50, sealing.REORDER_TICKS + 50)
    report = seal(source)
    assert report.too_late == 2  # COMMAND and TELEMETRY
    assert report.complete
    assert log_times(source) == sorted(log_times(source))
    assert np.isnan(open_run(source).command_Nm[50]).all()


def test_host_records_do_not_reach_run_mcap(tmp_path: Path) -> None:
    source = synthetic_journal(tmp_path / "a")
    (tmp_path / "b").mkdir()
    other = Journal(tmp_path / "b" / "run.journal")
    for record in read_journal(source / "run.journal"):
        if record.kind == Kind.COMMIT:
            rebased = jn.event_payload(events.EPOCH_REBASED, record.tick, 9)
            other.add(Kind.HOUSEKEEPING, record.tick, jn.housekeeping_payload(0, record.tick, b"any"))
            other.add(Kind.LAB_EVENT, record.tick, rebased)
            other.commit(record.tick)
        elif record.kind == Kind.TIMING:
            other.add(Kind.TIMING, record.tick, jn.timing_payload(987654, 321, 7))
        elif record.kind == Kind.HOST:
            other.add(Kind.HOST, 0, jn.json_payload({"link": "udp://127.0.0.1:9", "clock": "realtime"}))
        else:
            other.add(record.kind, record.tick, record.payload)
    other.close()
    assert seal(source).sha256 == seal(tmp_path / "b").sha256
    assert (source / "timing.mcap").read_bytes() != (tmp_path / "b" / "timing.mcap").read_bytes()


def test_order_and_time_within_the_log(tmp_path: Path) -> None:
    seal(synthetic_journal(tmp_path / "a", late=(50,)))
    with open(tmp_path / "a" / "run.mcap", "rb") as file:
        rows = [(c.topic, m) for _, c, m in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)]
    assert all(m.log_time == m.publish_time and m.log_time % PERIOD_NS == 0 for _, m in rows)
    assert all(a[1].log_time <= b[1].log_time for a, b in itertools.pairwise(rows))
    tick_50 = [topic for topic, m in rows if m.log_time == 50 * PERIOD_NS]
    answer = ["/packet/down", "/command", "/packet/down", "/telemetry"]
    assert tick_50 == ["/packet/up", "/sample", *answer, "/truth", "/tf", "/joint_states", "/event", "/log"]


def test_every_channel_has_a_schema_and_others_decode_it(tmp_path: Path) -> None:
    """Rows as the independent Python decoders see them are the rows of numpy's structured dtype, bit for bit."""
    seal(synthetic_journal(tmp_path / "a", 30))
    run = open_run(tmp_path / "a")
    seen: dict[str, list[object]] = {}
    with open(tmp_path / "a" / "run.mcap", "rb") as file:
        factories = [mcap_ros2.decoder.DecoderFactory(), ProtobufDecoder()]
        reader = make_reader(file, validate_crcs=True, decoder_factories=factories)
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema is not None
            seen.setdefault(channel.topic, []).append(message)
    for topic, rows in (("/truth", run.truth), ("/command", run.commands), ("/sample", run.samples)):
        assert len(seen[topic]) == len(rows) == 30
        for message, row in zip(seen[topic], rows, strict=True):
            for name in rows.dtype.names:
                assert np.array_equal(np.asarray(getattr(message, name)), row[name], equal_nan=True), name
    down = [p for p in run.packets if p.direction == "down"]
    assert [bytes(m.packet) for m in seen["/packet/down"]] == [p.packet for p in down]  # type: ignore[attr-defined]
    assert len(seen["/scene"]) == 1
    assert "REFERENCE_RESTART" in seen["/log"][0].message  # type: ignore[attr-defined]


def test_identity_is_in_the_log(tmp_path: Path) -> None:
    seal(synthetic_journal(tmp_path / "a"))
    with open(tmp_path / "a" / "run.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
        assert reader.get_header().library == "attitude-sil"
    assert json.loads(attachments["scenario.json"])["law"] == {"name": "pd"}
    assert metadata["run"]["period_ns"] == str(PERIOD_NS)
    assert metadata["end"] == {"reason": "finished", "ticks": "200"}
    assert metadata["config"]["torque_bits"] == "30"


@pytest.mark.parametrize("kill_at", [1, 2, 77, 150])
def test_killed_run_equals_the_undisturbed_one_up_to_the_last_whole_tick(tmp_path: Path, kill_at: int) -> None:
    """COMMAND(k) is committed with tick k+1, so a kill in tick K leaves K-1 whole ticks: 0 .. K-2."""
    seal(synthetic_journal(tmp_path / "whole"))
    report = recover(synthetic_journal(tmp_path / "killed", kill_at=kill_at))
    assert (report.reason, report.complete, report.ticks) == ("truncated", False, kill_at - 1)
    assert report.left_out == f"tick {kill_at - 1} left out: the run ended before the answer was recorded"
    whole, killed = open_run(tmp_path / "whole"), open_run(tmp_path / "killed")
    count = report.ticks
    assert whole.truth[:count].tobytes() == killed.truth.tobytes()
    assert whole.commands[:count].tobytes() == killed.commands.tobytes()
    for name in killed.names:
        assert np.array_equal(whole[name][:count], killed[name], equal_nan=True), name
    assert killed.packets == whole.packets[: len(killed.packets)]


@pytest.mark.parametrize("cut", range(1, 400, 37))
def test_a_torn_last_commit_is_left_out(tmp_path: Path, cut: int) -> None:
    source = synthetic_journal(tmp_path / "a", 40, kill_at=30)
    data = (source / "run.journal").read_bytes()
    (source / "run.journal").write_bytes(data[:-cut])
    report = seal(source)
    expected = 29 - 1 if cut <= _last_commit(data) else 28 - 1
    assert report.ticks == expected
    assert not report.complete


def _last_commit(data: bytes) -> int:
    """Bytes of the last commit."""
    offsets = []
    at = 12
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "little")
        if data[at + 8] == Kind.COMMIT:
            offsets.append(at + 13)
        at += 9 + length + 4
    return offsets[-1] - offsets[-2]


def test_truth_without_board_is_whole(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    target = Journal(tmp_path / "a" / "run.journal")
    target.add(Kind.META, 0, jn.json_payload({"period_ns": PERIOD_NS}))
    for k in range(5):
        zero = (0.0,) * 3
        target.add(Kind.TRUTH, k, jn.truth_payload((1.0, 0.0, 0.0, 0.0), zero, zero, zero, zero, (0, 0, 0), 0))
        target.commit(k)
    target.close()
    report = seal(tmp_path / "a")
    assert (report.ticks, report.left_out) == (5, "")
    run = open_run(tmp_path / "a")
    assert np.isnan(run.command_Nm).all()
    assert np.isnan(run.reference_deg).all()


def test_packets_that_cannot_be_unpacked_are_kept_and_counted(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    target = Journal(tmp_path / "a" / "run.journal")
    target.add(Kind.META, 0, jn.json_payload({"period_ns": PERIOD_NS}))
    for packet in (b"", b"\x01", bytes(300), b"\x01\x63" + bytes(20)):
        target.add(Kind.PACKET, 0, jn.packet_payload(Direction.UP, Fate.CORRUPTED, packet, b"\0x\0"))
    zero = (0.0,) * 3
    target.add(Kind.TRUTH, 0, jn.truth_payload((1.0, 0.0, 0.0, 0.0), zero, zero, zero, zero, (0, 0, 0), 0))
    target.add(Kind.END, 0, jn.json_payload({"reason": "finished", "ticks": 1}))
    target.commit(0)
    target.close()
    assert seal(tmp_path / "a").undecoded == 4
    rows = open_run(tmp_path / "a").packets
    assert {row.packet for row in rows} == {b"", b"\x01", bytes(300), b"\x01\x63" + bytes(20)}
    assert {(row.fate, row.encoded) for row in rows} == {("corrupted", b"\0x\0")}


def test_nothing_half_made_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = synthetic_journal(tmp_path / "a")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sealing.RunRows, "end", fail)
    with pytest.raises(SealError, match="cannot write the log: No space left on device"):
        seal(source)
    assert [p.name for p in source.iterdir()] == ["run.journal"]


class FullDisk(io.RawIOBase):
    """A file on a full disk: opening works, no write does."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        path.touch()

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("buffer", [16, 2**24], ids=["while writing", "at the end"])
def test_a_full_disk_says_so_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, buffer: int) -> None:
    """Closing a file on a full disk raises, too; the partial files go all the same."""
    source = synthetic_journal(tmp_path / "a")

    def full(path: Path, mode: str) -> object:
        return io.BufferedWriter(FullDisk(path), buffer) if mode == "wb" else open(path, mode)

    monkeypatch.setattr(sealing, "open", full, raising=False)
    with pytest.raises(SealError, match="cannot write the log: No space left on device"):
        seal(source)
    assert [p.name for p in source.iterdir()] == ["run.journal"]


def test_no_journal_and_no_meta(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot read the journal"):
        seal(tmp_path)
    Journal(tmp_path / "run.journal").close()
    with pytest.raises(SealError, match="ends before its META record"):
        seal(tmp_path)


def test_memory_does_not_grow_with_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At no time more than REORDER_TICKS ticks wait to be written."""
    source = synthetic_journal(tmp_path / "a", 700)
    most = 0
    tick = sealing._Sealing._tick

    def spy(self: object, number: int, records: list[jn.Record]) -> None:
        nonlocal most
        waiting = sys._getframe(1).f_locals["waiting"]
        most = max(most, len(waiting))
        tick(self, number, records)  # type: ignore[arg-type]

    monkeypatch.setattr(sealing._Sealing, "_tick", spy)
    seal(source)
    assert 0 < most <= sealing.REORDER_TICKS + 2


def test_layout_hash_is_what_the_packets_carry() -> None:
    """The fixture's frames are real ones."""
    assert frames.unpack(frames.pack(frames.Tick(3), 0)).tick == 3
