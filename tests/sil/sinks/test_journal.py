"""The journal: what was committed survives anything that can happen to a file, and damage is told, never raised."""

from __future__ import annotations

import errno
import os
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sil.sinks import journal as jn
from sil.sinks.journal import Journal, JournalError, Kind, read_journal


def written(path: Path, ticks: int = 5) -> bytes:
    target = Journal(path)
    for k in range(ticks):
        target.add(Kind.TIMING, k, jn.timing_payload(k, 2 * k, 3, 4, 5, 1))
        target.add(Kind.LAB_EVENT, k, jn.event_payload(k, -1, 1))
        target.commit(k)
    target.close()
    return path.read_bytes()


def read(path: Path) -> tuple[list[jn.Record], str]:
    reader = read_journal(path)
    return list(reader), reader.damage


def test_records_come_back_in_order(tmp_path: Path) -> None:
    written(tmp_path / "j", 3)
    records, damage = read(tmp_path / "j")
    assert damage == ""
    assert [(r.kind, r.tick) for r in records] == [
        (kind, k) for k in range(3) for kind in (Kind.TIMING, Kind.LAB_EVENT, Kind.COMMIT)
    ]
    assert jn.read_timing(records[3].payload) == (1, 2, 3, 4, 5, 1)
    assert jn.read_event(records[4].payload) == (1, -1, 1)


def test_payloads_round_trip() -> None:
    truth = jn.Truth(
        (1.0, 0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0), (0.1, 0.2, 0.3), (1, -2, 3), 2
    )
    assert jn.read_truth(jn.truth_payload(*truth)) == truth
    packet = jn.PacketRecord(1, 3, b"packet", b"\0encoded\0")
    assert jn.read_packet(jn.packet_payload(*packet)) == packet
    assert jn.read_housekeeping(jn.housekeeping_payload(1, -5, b"xyz")) == (1, -5, b"xyz")
    assert jn.json_payload({"b": 1, "a": "ä"}) == '{"a":"ä","b":1}'.encode()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 90), min_size=1, max_size=12))
def test_who_follows_a_journal_that_grows_by_any_pieces_reads_the_same(tmp_path_factory, pieces: list[int]) -> None:
    folder = tmp_path_factory.mktemp("grows")
    whole = written(folder / "whole")
    (folder / "j").write_bytes(whole[:12])
    following = read_journal(folder / "j").follow()
    seen = []
    for piece in (*pieces, len(whole)):
        (folder / "j").write_bytes(whole[: (folder / "j").stat().st_size + piece])
        seen += iter(following.__next__, None)
    assert seen == list(read_journal(folder / "whole"))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_cut_keeps_whole_records(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("cut")
    whole = written(folder / "j")
    everything, _ = read(folder / "j")
    cut = data.draw(st.integers(12, len(whole)))
    (folder / "cut").write_bytes(whole[:cut])
    records, damage = read(folder / "cut")
    assert records == everything[: len(records)]
    ends = [r.offset + 9 + len(r.payload) + 4 for r in everything]
    assert len(records) == sum(end <= cut for end in ends)
    assert bool(damage) == (cut not in (12, *ends))
    if damage:
        assert f"at byte {12 if not records else ends[len(records) - 1]} is cut off" in damage


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_flipped_bit_stops_reading(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.mktemp("flip")
    whole = bytearray(written(folder / "j"))
    everything, _ = read(folder / "j")
    bit = data.draw(st.integers(12 * 8, len(whole) * 8 - 1))
    whole[bit // 8] ^= 1 << bit % 8
    (folder / "flip").write_bytes(whole)
    records, damage = read(folder / "flip")
    hit = next(i for i, r in enumerate(everything) if r.offset + 9 + len(r.payload) + 4 > bit // 8)
    assert records == everything[:hit]
    assert f"at byte {everything[hit].offset}" in damage


def test_reading_across_block_borders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "j", 50)
    expected, _ = read(tmp_path / "j")
    monkeypatch.setattr(jn, "READ_BLOCK", 7)
    assert read(tmp_path / "j") == (expected, "")


def test_partial_writes_are_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = written(tmp_path / "whole")
    write = os.write
    monkeypatch.setattr(jn.os, "write", lambda fd, data: write(fd, bytes(data[:3])))
    assert written(tmp_path / "partial") == whole


def test_full_disk_is_one_line_and_keeps_what_was_committed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = Journal(tmp_path / "j")
    target.add(Kind.TIMING, 0, jn.timing_payload(0))
    target.commit(0)
    write = os.write

    def full(fd: int, data: bytes) -> int:
        if len(data) < 10:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(fd, data[: len(data) - 5])

    monkeypatch.setattr(jn.os, "write", full)
    target.add(Kind.TIMING, 1, jn.timing_payload(1))
    with pytest.raises(JournalError, match="at tick 1: no space left on the disk; everything before it is kept"):
        target.commit(1)
    monkeypatch.undo()
    with pytest.raises(JournalError, match="no space left"):
        target.commit(2)
    target.close()
    records, damage = read(tmp_path / "j")
    assert damage == ""
    assert [(r.kind, r.tick) for r in records] == [(Kind.TIMING, 0), (Kind.COMMIT, 0)]


def test_uncommitted_records_are_not_written(tmp_path: Path) -> None:
    target = Journal(tmp_path / "j")
    target.add(Kind.TIMING, 0, jn.timing_payload(0))
    target.close()
    target.close()
    assert read(tmp_path / "j") == ([], "")


def test_an_existing_journal_is_never_overwritten(tmp_path: Path) -> None:
    written(tmp_path / "j")
    with pytest.raises(JournalError, match="cannot create the journal: File exists"):
        Journal(tmp_path / "j")


def test_a_journal_of_version_1_is_still_read(tmp_path: Path) -> None:
    """A run that was killed before an upgrade can be recovered after it."""
    content = written(tmp_path / "j")
    (tmp_path / "old").write_bytes(content[:8] + b"\1\0\0\0" + content[12:])
    assert len(read(tmp_path / "old")[0]) == len(read(tmp_path / "j")[0])
    assert jn.read_timing(struct.pack("<qqI", 987, 654, 7)) == (987, 654, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a journal, got 0 bytes"),
        (b"\x89MCAP0\r\nxxxx", "it starts with"),
        (b"SILJRNL\n\x09\0\0\0", "expected journal version 1 to 3, got 9"),
    ],
)
def test_foreign_files_are_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "j").write_bytes(content)
    with pytest.raises(JournalError, match=message):
        read_journal(tmp_path / "j")


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot read the journal: No such file"):
        read_journal(tmp_path / "j")


def test_a_huge_length_is_damage_not_memory(tmp_path: Path) -> None:
    whole = written(tmp_path / "j", 1)
    head = (0xFFFFFFF0).to_bytes(4, "little") + bytes(5)
    (tmp_path / "k").write_bytes(whole + head + zlib.crc32(head).to_bytes(4, "little"))
    records, damage = read(tmp_path / "k")
    assert len(records) == 3
    assert "claims 4294967280 bytes" in damage
