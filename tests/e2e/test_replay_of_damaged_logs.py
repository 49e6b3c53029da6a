"""Replay of logs that lack answers, carry damaged packets, or were flown with the board's own timer first."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_sim.board import Board
from firmware_sim.hal import HostHal
from protocol import config, events, frames
from protocol.frames import Reading, Sample, Tick, Type
from protocol.links import inproc
from protocol.port import Port
from sil import open_run
from sil.replay import decoded, recorded_scenario, replay
from sil.rig import law_orders
from sil.runner import run_scenario
from sil.runs import Run
from sil.scenario import load_scenario
from sil.sinks.journal import Direction, Fate, Journal, Kind, json_payload, packet_payload, read_journal, read_packet
from sil.sinks.seal import seal
from sil.trouble import UsageError

TICKS = 60
ANSWERS = (Type.COMMAND, Type.TELEMETRY, Type.EVENT)
Change = Callable[[int, bytes], bytes | None]  # (tick, packet) to what stands in its place, None: nothing


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("replay") / "run"
    sets = ["duration_s=30", "require=[]", "board=inproc", "link.url=inproc"]
    run_scenario(load_scenario("appc-rs232", sets), folder)
    return folder


def altered(recorded: Path, folder: Path, change: Change, reason: str = "finished") -> Run:
    """The run with its packets changed and its end's reason, sealed anew."""
    folder.mkdir()
    journal = Journal(folder / "run.journal")
    for record in read_journal(recorded / "run.journal"):
        payload: bytes | None = record.payload
        if record.kind == Kind.PACKET:
            direction, fate, packet, *_ = read_packet(record.payload)
            changed = change(record.tick, packet)
            payload = None if changed is None else packet_payload(direction, fate, changed)
        if record.kind == Kind.END:
            payload = json_payload({**json.loads(record.payload), "reason": reason})
        if record.kind == Kind.COMMIT:
            journal.commit(record.tick)
        elif payload is not None:
            journal.add(record.kind, record.tick, payload)
    journal.close()
    seal(folder)
    return open_run(folder)


def without_answers(from_tick: int, to_tick: int) -> Change:
    return lambda tick, packet: None if packet[1] in ANSWERS and from_tick <= tick <= to_tick else packet


def damaged(type_: Type, at: int) -> Change:
    """The last byte of the CRC is flipped in every packet of this type at this tick."""
    return lambda tick, packet: packet[:-1] + bytes([packet[-1] ^ 1]) if (packet[1], tick) == (type_, at) else packet


def test_a_log_without_any_command_cannot_be_replayed(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no COMMAND in this log"):
        replay(altered(recorded, tmp_path / "run", without_answers(0, TICKS)))


@pytest.mark.parametrize("reason", ["finished", "interrupted"])
def test_a_missing_answer_in_the_middle_is_a_difference(recorded: Path, tmp_path: Path, reason: str) -> None:
    report = replay(altered(recorded, tmp_path / "run", without_answers(20, 20), reason))
    assert report.ticks == 20
    assert report.first is not None
    assert (report.first.tick, report.first.recorded) == (20, None)
    assert "COMMAND tick=20" in decoded(report.first.replayed)


def test_the_last_answers_may_be_missing_where_the_run_did_not_finish(recorded: Path, tmp_path: Path) -> None:
    without = without_answers(TICKS - 3, TICKS)
    finished = replay(altered(recorded, tmp_path / "finished", without))
    assert finished.first is not None
    assert (finished.first.tick, finished.first.recorded) == (TICKS - 3, None)
    interrupted = replay(altered(recorded, tmp_path / "interrupted", without, "interrupted"))
    assert interrupted.identical
    assert interrupted.ticks == TICKS - 3


@pytest.mark.parametrize("type_", [Type.COMMAND, Type.TELEMETRY, Type.EVENT])
def test_a_damaged_answer_is_a_difference_that_says_so(recorded: Path, tmp_path: Path, type_: Type) -> None:
    report = replay(altered(recorded, tmp_path / "run", damaged(type_, 0)))
    assert report.first is not None
    assert report.first.tick == 0
    assert "CRC" in decoded(report.first.recorded)


def test_a_damaged_config_is_said_in_one_line(recorded: Path, tmp_path: Path) -> None:
    report = replay(altered(recorded, tmp_path / "run", damaged(Type.CONFIG, 0)))
    ((name, then, now),) = report.config
    assert (name, now) == ("CONFIG", "whole")
    assert "CRC" in then


def test_a_damaged_sample_is_said_in_one_line(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"^tick 7: its SAMPLE is damaged in the log: .*CRC"):
        replay(altered(recorded, tmp_path / "run", damaged(Type.SAMPLE, 7)))


# -- logs of another board's making ------------------------------------------------------------------------------------


def sample(tick: int, valid: int = 1) -> Sample:
    zero = (0, 0, 0)
    reading = Reading(0, (2**24 + tick * 2**16, 0, 0))
    return Sample(tick, zero, zero, zero, tick - 1 if tick else frames.NO_TICK, 0, 1, valid, (reading, None, None))


def flown(recorded: Path, folder: Path, tick_5: tuple[Sample | Tick, ...], fate: Fate, valid: int = 1) -> Run:
    """Ten ticks of `recorded`, the board driven here: at tick 5 it gets `tick_5`; SAMPLE(5) is logged with `fate`."""
    lab_end, board_end = inproc.pair()
    lab, port = Port(lab_end), Port(board_end)
    board = Board(port, HostHal(port))

    def say(*out: frames.Frame) -> tuple[tuple[bytes, ...], list[bytes]]:
        sent, answers = lab.send(*out), []
        while (packet := port.receive(0.0)) is not None:
            board.handle(packet)
        while (packet := lab.receive(0.0)) is not None:
            answers.append(packet.raw)
        return sent, answers

    say(frames.Hello(1, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, 7, 0, "test"))
    lab.reset()
    parts, _ = say(*config.split(law_orders(recorded_scenario(open_run(recorded))).words))
    rows = [(0, Direction.UP, Fate.DELIVERED, packet) for packet in parts]
    for tick in range(10):
        packet = lab.pack(sample(tick, valid if tick == 5 else 1))
        rows.append((tick, Direction.UP, fate if tick == 5 else Fate.DELIVERED, packet))
        answers = []
        for frame in tick_5 if tick == 5 else (sample(tick),):
            if isinstance(frame, Tick):
                answers += say(frame)[1]
            else:
                lab.write(packet)
                answers += say()[1]
        rows += [(tick, Direction.DOWN, Fate.DELIVERED, answer) for answer in answers]
    folder.mkdir()
    journal = Journal(folder / "run.journal")
    for record in read_journal(recorded / "run.journal"):
        if record.kind in (Kind.META, Kind.SESSION) or (record.kind == Kind.TRUTH and record.tick < 10):
            journal.add(record.kind, record.tick, record.payload)
    for tick, direction, row_fate, packet in rows:
        journal.add(Kind.PACKET, tick, packet_payload(direction, row_fate, packet))
    journal.add(Kind.END, 10, json_payload({"reason": "finished", "ticks": 10}))
    journal.commit(10)
    journal.close()
    seal(folder)
    return open_run(folder)


def codes(run: Run) -> list[int]:
    return [event.code for event in run.events]


def test_a_sample_that_came_after_its_tick_was_stepped_is_written_then(recorded: Path, tmp_path: Path) -> None:
    """The board's timer steps tick 5, SAMPLE(5) comes too late: the next answer reports it, in the replay as well."""
    run = flown(recorded, tmp_path / "run", (Tick(5), sample(5)), Fate.DELIVERED)
    assert events.STALE_SAMPLE in codes(run)
    report = replay(run)
    assert (report.first, report.ticks) == (None, 10)


def test_a_sample_that_never_came_is_not_written(recorded: Path, tmp_path: Path) -> None:
    run = flown(recorded, tmp_path / "run", (Tick(5),), Fate.DROPPED)
    assert events.SAMPLE_LOST in codes(run)
    report = replay(run)
    assert (report.first, report.ticks) == (None, 10)


def test_a_damaged_event_of_a_propagated_tick_is_a_difference(recorded: Path, tmp_path: Path) -> None:
    run = flown(recorded, tmp_path / "run", (sample(5),), Fate.DELIVERED, valid=0)
    assert events.READING_INVALID in codes(run)
    assert replay(run).identical
    first = replay(altered(tmp_path / "run", tmp_path / "damaged", damaged(Type.EVENT, 5))).first
    assert first is not None
    assert first.tick == 5
