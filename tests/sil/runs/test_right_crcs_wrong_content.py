"""Logs whose every CRC is right and whose content makes no sense: one line that names the file, never a traceback.

Found by `python -m tools.fuzz log`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sil.replay import replay
from sil.report import info
from sil.runner import run_scenario
from sil.runs import RunError, open_run
from sil.scenario import load_scenario
from sil.sinks import layouts
from sil.sinks.journal import Journal, Kind, json_payload, read_journal
from sil.sinks.seal import SealError, recover

SHORT = ("duration_s=10", "require=[]", "board=inproc", "link.url=inproc")
Change = Callable[[bytes], bytes]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("runs") / "whole"
    run_scenario(load_scenario("appc-rs232", SHORT), folder)
    return folder


def altered(recorded: Path, folder: Path, kind: Kind, change: Change) -> Path:
    """The run's journal with every record of one kind changed, and a summary.json beside it."""
    folder.mkdir()
    (folder / "summary.json").write_bytes((recorded / "summary.json").read_bytes())
    journal = Journal(folder / "run.journal")
    for record in read_journal(recorded / "run.journal"):
        if record.kind == Kind.COMMIT:
            journal.commit(record.tick)
        else:
            journal.add(record.kind, record.tick, change(record.payload) if record.kind == kind else record.payload)
    journal.close()
    return folder


def with_values(**values: Any) -> Change:
    return lambda payload: json_payload({**json.loads(payload), **values})


def with_scenario(**values: Any) -> Change:
    def change(payload: bytes) -> bytes:
        meta = json.loads(payload)
        return json_payload({**meta, "scenario": {**meta["scenario"], **values}})

    return change


NOT_SEALED: dict[str, tuple[Kind, Change]] = {
    "truth cut short": (Kind.TRUTH, lambda payload: payload[:-1]),
    "packet without its head": (Kind.PACKET, lambda payload: payload[:2]),
    "event too long": (Kind.LAB_EVENT, lambda payload: payload + b"\0"),
    "timing of another size": (Kind.TIMING, lambda payload: payload[:7]),
    "META is no JSON": (Kind.META, lambda payload: payload[:-1]),
    "META is no text": (Kind.META, lambda payload: b"\xff" + payload),
    "META is a list": (Kind.META, lambda payload: b"[1]"),
    "META without a period": (Kind.META, lambda payload: b"{}"),
    "a period that no clock can count": (Kind.META, with_values(period_ns=2**80)),
    "HOST is a number": (Kind.HOST, lambda payload: b"7"),
    "END without ticks": (Kind.END, lambda payload: b'{"reason": "finished"}'),
    "END with fewer ticks than none": (Kind.END, with_values(ticks=-6)),  # fuzzing
    "END with ticks in words": (Kind.END, with_values(ticks="many")),
}


@pytest.mark.parametrize("name", NOT_SEALED)
def test_a_journal_that_makes_no_sense(recorded: Path, tmp_path: Path, name: str) -> None:
    kind, change = NOT_SEALED[name]
    source = recorded
    if kind == Kind.LAB_EVENT:  # a run of its own does not have one
        source = altered(recorded, tmp_path / "with-event", Kind.TIMING, lambda payload: payload)
        _add_event(source / "run.journal")
    folder = altered(source, tmp_path / "run", kind, change)
    with pytest.raises(SealError) as caught:
        recover(folder)
    assert str(caught.value).startswith(f"{folder / 'run.journal'}: ")
    assert len(str(caught.value).splitlines()) == 1
    assert [path.name for path in folder.iterdir() if path.suffix in (".mcap", ".partial")] == []


def _add_event(path: Path) -> None:
    records = list(read_journal(path))
    path.unlink()
    journal = Journal(path)
    for record in records:
        if record.kind == Kind.COMMIT:
            if record.tick == 3:
                journal.add(Kind.LAB_EVENT, 3, b"\0" * 10)
            journal.commit(record.tick)
        else:
            journal.add(record.kind, record.tick, record.payload)
    journal.close()


NOT_OPENED: dict[str, tuple[Kind, Change]] = {
    "scenario is a text": (Kind.META, with_values(scenario="appc")),
    "metrics are a list": (Kind.META, with_scenario(metrics=[1])),
    "guidance is a number": (Kind.META, with_scenario(guidance=3)),
    "law is a text": (Kind.META, with_scenario(law="appc")),
    "require is a mapping": (Kind.META, with_scenario(require={"metric": "missed"})),
}


@pytest.mark.parametrize("name", NOT_OPENED)
def test_a_log_whose_scenario_makes_no_sense(recorded: Path, tmp_path: Path, name: str) -> None:
    folder = altered(recorded, tmp_path / "run", *NOT_OPENED[name])
    recover(folder)
    with pytest.raises(RunError, match="written by another version, or damaged") as caught:
        open_run(folder)
    assert len(str(caught.value).splitlines()) == 1


def test_a_requirement_that_no_version_knows(recorded: Path, tmp_path: Path) -> None:
    folder = altered(recorded, tmp_path / "run", Kind.META, with_scenario(require=[{"metric": "beauty", "below": 1}]))
    recover(folder)
    with pytest.raises(RunError, match="metric: expected one of"):
        info.info(open_run(folder))


def test_a_fate_that_no_version_knows(recorded: Path, tmp_path: Path) -> None:
    folder = altered(recorded, tmp_path / "run", Kind.PACKET, lambda payload: payload[:1] + b"\xf8" + payload[2:])
    recover(folder)
    with pytest.raises(RunError, match="248 is not a valid Fate"):
        replay(open_run(folder))


@pytest.mark.parametrize("size", [0, 3, 20])
def test_a_packet_row_that_is_cut_off(recorded: Path, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = layouts.PACKET.unpack
    monkeypatch.setattr(layouts.PACKET, "unpack", lambda data: whole(data[:size]))
    with pytest.raises(RunError, match="damaged"):
        _ = open_run(recorded).packets


def test_a_summary_that_names_no_law_file(recorded: Path, tmp_path: Path) -> None:
    folder = altered(recorded, tmp_path / "run", Kind.TIMING, lambda payload: payload)
    recover(folder)
    (folder / "summary.json").write_text('{"law_file": 7}')
    with pytest.raises(RunError, match="damaged"):
        replay(open_run(folder))


def test_the_hash_of_a_law_file_in_a_run_without_one(recorded: Path, tmp_path: Path) -> None:
    folder = altered(recorded, tmp_path / "run", Kind.META, with_values(law_file_sha256="0" * 64))
    recover(folder)
    report = replay(open_run(folder))
    assert report.law_file == "law: not the law that flew: its file cannot be read: Is a directory"
    assert report.identical
