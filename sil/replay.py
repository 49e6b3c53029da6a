"""Replay: the recorded packets of a run into a fresh board; are its answers the same bytes?

Per tick the board gets what it got then (the SAMPLE, or TICK where none reached it in time), and its COMMAND, TELEMETRY
and EVENT frames are held against the recorded ones. It stops at the first difference, since every later sample answers
a command that this board did not give. A changed parameter shows as a difference of CONFIG, which is reported apart.
A tick without a recorded answer is a difference, too, but for the last ones of a run that did not finish, or of a
session that ended because the board restarted: these expect none, and a last answer that was cut off expects no more.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from protocol import events, frames
from protocol.codec import StreamDecoder
from protocol.frames import Command, Config, Event, Tick, Type
from protocol.law_tables import COMMON, ROW_WORDS, dequantise
from protocol.links import LinkError
from protocol.port import Port
from sil.boards import BoardOrder, plug_in
from sil.checks import firmware_flies
from sil.configure import Orders
from sil.fates import Stale
from sil.rig import DEAD_AFTER_S, HELLO_WITHIN_S, law_orders, user_law_spec
from sil.runs import PacketRow, Run, readable
from sil.scenario import Scenario, load_values
from sil.session import Session
from sil.trouble import LinkFailure, UsageError

DELIVERED = "delivered"
ARRIVED = (DELIVERED, "late", "in_flight")
ANSWERS = (Type.COMMAND, Type.TELEMETRY, Type.EVENT)
LOOK_EVERY_S = 0.25
MOST_EVENTS = 16  # that one answer can carry
TYPE_AT = 1  # of a packet


class Difference(NamedTuple):
    """The first frame that is not the recorded one; either side may be None (a frame too few or too many)."""

    tick: int
    recorded: bytes | None
    replayed: bytes | None


@dataclass
class Report:
    """What a replay found. `config`: CONFIG words that differ, as (name, recorded, now), values in their
    units."""

    ticks: int = 0
    sessions: int = 0
    lost: int = 0  # ticks whose answer the board lost when it restarted; not compared
    config: list[tuple[str, str, str]] = field(default_factory=list)
    law_file: str = ""  # "" or what is to be said about a user's law whose file is not the recorded one
    first: Difference | None = None

    @property
    def identical(self) -> bool:
        """Every answer is the recorded one."""
        return self.first is None


def replay(
    run: Run, sets: Iterable[str] = (), board: str = "inproc", progress: Callable[[int, int], None] | None = None
) -> Report:
    """Replay `run` into a fresh board of kind `board`, a name in BOARDS, with overrides `a.b=value` of its scenario.

    Raises UsageError (nothing to replay, bad override, a law that is not on this board), RunError (the log makes no
    sense) and LinkFailure (the board fails or refuses).
    """
    with readable(run.path):
        scenario = recorded_scenario(run, sets, board)
        recorded = list(_sessions(run))
    for finding in firmware_flies(scenario):
        raise UsageError(str(finding))
    made = law_orders(scenario)
    report = Report(law_file=_changed_law(run, scenario))
    for session in recorded:
        report.sessions += 1
        try:
            _replay_session(session, scenario, made, board, report, progress or (lambda tick, ticks: None), len(run))
        except LinkError as error:
            raise LinkFailure(str(error)) from None
        if report.first is not None:
            break
    return report


def recorded_scenario(run: Run, sets: Iterable[str] = (), board: str = "process") -> Scenario:
    """The scenario that the log carries, with overrides, on this board; a user's own law is looked for where the run
    found it."""
    if run.scenario.get("board") == "none" or not any(row.type == Type.SAMPLE for row in run.packets):
        raise UsageError(f"{run.path}: no board took part in this run: there is nothing to replay")
    if not any(row.type == Type.COMMAND for row in run.packets):
        raise UsageError(f"{run.path}: no COMMAND in this log: the board never answered, there is nothing to replay")
    law_file = run.summary.get("law_file") or ""
    directory = Path(law_file).parent if law_file else Path()
    link = {**run.scenario.get("link", {}), "url": "udp"}  # the one that every fault fits; no link is opened by it
    plant = {**run.scenario.get("plant", {}), "kind": "rigid"}  # nobody flies it
    values = {**run.scenario, "plant": plant, "clock": "lockstep", "link": link, "board": board}
    return load_values(values, tuple(sets), where=str(run.path), directory=directory)


def _changed_law(run: Run, scenario: Scenario) -> str:
    then = str(run.meta.get("law_file_sha256") or "")
    file = user_law_spec(scenario).rpartition(":")[0]
    try:
        if not then or hashlib.sha256(Path(file).read_bytes()).hexdigest() == then:
            return ""
    except OSError as error:
        return f"{file or 'law'}: not the law that flew: its file cannot be read: {error.strerror}"
    return f"{file}: not the law that flew: its file has changed since the run"


class RecordedTick(NamedTuple):
    """One tick of the log: the SAMPLE as sent and the answer frames in order."""

    tick: int
    sample: bytes | None
    used: bool  # the board stepped on the SAMPLE
    stale: tuple[int, ...]  # ticks of SAMPLEs that came since the last step, too late for their own, or once more
    answer: tuple[bytes, ...]
    open_end: bool  # the run, or the board's memory, ended before the answer: none is expected
    cut_off: bool  # it ended within the answer: only what came is compared


class RecordedSession(NamedTuple):
    """One board session: its CONFIG packets and its ticks."""

    config: tuple[bytes, ...]
    ticks: tuple[RecordedTick, ...]


def _sessions(run: Run) -> Iterator[RecordedSession]:
    """Tick by tick; without the last ticks that were never answered, if the run or the session ended unasked."""
    starts = run.sessions or [0]
    unfinished = run.end.get("reason") != "finished"
    restarts = [event.tick for event in run.events if event.code == events.BOARD_RESTARTED]
    for number, start in enumerate(starts):
        last = number + 1 == len(starts)
        stop = None if last else starts[number + 1]
        rows = [row for row in run.packets if row.tick >= start and (stop is None or row.tick < stop)]
        config = tuple(row.packet for row in rows if row.type == Type.CONFIG)
        answered = max((row.tick for row in rows if _is_answer(row)), default=-1)
        open_end = not last or unfinished or any(tick >= max(start, answered) for tick in restarts)
        stale = Stale()
        ticks = tuple(
            _recorded(
                tick, list(group), (stale, run.period_ns), open_end and tick > answered, open_end and tick == answered
            )
            for tick, group in groupby(rows, key=lambda row: row.tick)
        )
        yield RecordedSession(config, tuple(tick for tick in ticks if tick.sample is not None))


def _is_answer(row: PacketRow) -> bool:
    return row.direction == "down" and row.type in ANSWERS


def _due(stale: Stale, tick: int, samples: list[PacketRow], period_ns: int) -> tuple[int, ...]:
    """The ticks of SAMPLEs that by the model came late, or once more, right before SAMPLE(tick) (SPEC, L17)."""
    whole = sorted((row.arrival_ns, row.copy) for row in samples if row.fate in ARRIVED)
    due: tuple[int, ...] = ()
    if any(row.fate == DELIVERED for row in samples):
        due = tuple(each.tick for each in stale.due(tick * period_ns, tick))
        del whole[0]  # the copy that came first was in time
    for arrival_ns, copy in whole:
        stale.add(arrival_ns, tick, copy, b"")
    return due


def _recorded(tick: int, rows: list[PacketRow], model: tuple[Stale, int], open_end: bool, last: bool) -> RecordedTick:
    samples = [row for row in rows if row.type == Type.SAMPLE]
    answer = tuple(row.packet for row in rows if _is_answer(row) and not row.copy)
    ordered = tuple(frames.in_sequence(answer))
    used = any(row.fate == DELIVERED for row in samples) and not _stepped_without(ordered)
    reported = [_frame(packet) for packet in ordered if packet[TYPE_AT] == Type.EVENT]
    stale, by_model = _stale(reported), _due(model[0], tick, samples, model[1])
    cut_off = last and _is_cut_off(ordered)
    if cut_off or len(reported) >= MOST_EVENTS:  # they may be more than the answer tells
        stale = (*by_model, *(each for each in stale if each not in by_model))
    return RecordedTick(tick, _sent(samples), used, stale, ordered, open_end, cut_off)


def _stale(reported: list[Any]) -> tuple[int, ...]:
    """What the board says of SAMPLEs that it dropped: in its order, by whatever they were late."""
    return tuple(event.a for event in reported if event is not None and event.code == events.STALE_SAMPLE)


def _sent(samples: list[PacketRow]) -> bytes | None:
    """SAMPLE as the board got it: where altered bytes passed the CRC, what they say."""
    if not samples:
        return None
    first = min((row for row in samples if row.fate == DELIVERED), key=lambda row: row.arrival_ns, default=samples[0])
    found = StreamDecoder().feed(b"\0" + first.encoded + b"\0") if first.encoded and first.fate == DELIVERED else []
    return found[0] if found else first.packet


def _is_cut_off(answer: tuple[bytes, ...]) -> bool:
    """The answer has fewer frames than its COMMAND announces."""
    command = _frame(answer[0]) if answer else None
    return isinstance(command, Command) and len(answer) < 1 + command.follows


def _stepped_without(answer: tuple[bytes, ...]) -> bool:
    """The board's own timer was first: no SAMPLE was used, though neither an overrun nor an invalid reading made it."""
    command = _frame(answer[0]) if answer else None
    if not isinstance(command, Command):
        return False
    own_timer = command.used in frames.WITHOUT_SAMPLE and not command.flags & frames.FLAG_OVERRUN
    return own_timer and not any(_is_invalid_reading(packet) for packet in answer)


def _is_invalid_reading(packet: bytes) -> bool:
    frame = _frame(packet)
    return isinstance(frame, Event) and frame.code == events.READING_INVALID


def _frame(packet: bytes) -> Any:
    """The frame of a recorded packet; None where it is damaged."""
    try:
        return frames.unpack(packet).frame
    except frames.BadPacket:
        return None


# -- into the board ------------------------------------------------------------------------------------------------


def _replay_session(
    session: RecordedSession,
    scenario: Scenario,
    made: Orders,
    board: str,
    report: Report,
    progress: Callable[[int, int], None],
    ticks: int,
) -> None:
    host = plug_in(board, BoardOrder("pty", user_law_spec(scenario), None, lambda line: None))
    try:
        port = Port(host.link)
        talk = Session(port, 0, host.check_alive)
        talk.open(made.words, made.configuration.hash, HELLO_WITHIN_S, lambda line: None)
        report.config = config_differences(session.config, made)
        samples = {recorded.tick: recorded.sample for recorded in session.ticks}
        for recorded in session.ticks:
            if recorded.open_end:
                report.lost += 1
                continue
            for tick in recorded.stale:
                port.write(*filter(None, [samples.get(tick)]))  # the board counts and drops it
            report.first = _replay_tick(port, recorded, session.ticks[0].tick, host.check_alive)
            if report.first is not None:
                return
            report.ticks += 1
            progress(recorded.tick, ticks)
        talk.close(frames.STOP_DONE)
    finally:
        host.close()


def _replay_tick(port: Port, recorded: RecordedTick, first: int, check_alive: Callable[[], None]) -> Difference | None:
    assert recorded.sample is not None
    if recorded.used:
        if _frame(recorded.sample) is None:
            raise UsageError(f"tick {recorded.tick}: its SAMPLE is damaged in the log: {decoded(recorded.sample)}")
        port.write(recorded.sample)
    else:
        port.send(Tick(recorded.tick))
    answer = _answer(port, recorded.tick, first, check_alive)
    if recorded.cut_off:
        answer = answer[: len(recorded.answer)]
    for expected, got in _side_by_side(recorded.answer, answer):
        if expected != got:
            return Difference(recorded.tick, expected, got)
    return None


def _side_by_side(recorded: tuple[bytes, ...], replayed: list[bytes]) -> Iterator[tuple[bytes | None, bytes | None]]:
    for place in range(max(len(recorded), len(replayed))):
        yield (
            recorded[place] if place < len(recorded) else None,
            replayed[place] if place < len(replayed) else None,
        )


def _answer(port: Port, tick: int, first: int, check_alive: Callable[[], None]) -> list[bytes]:
    """COMMAND(tick) and the frames it announces. What a fresh board says of ticks before its session's `first`, up to
    which it steps alone, is nobody's."""
    give_up = time.monotonic() + DEAD_AFTER_S
    answer: list[bytes] = []
    expected = 1
    while len(answer) < expected:
        packet = port.receive(LOOK_EVERY_S)
        if packet is None:
            check_alive()
            if time.monotonic() > give_up:
                raise LinkFailure(f"board: no answer to tick {tick} within {DEAD_AFTER_S:g} s")
            continue
        if packet.type == Type.COMMAND and packet.tick == tick:
            expected = 1 + packet.frame.follows
        if packet.type in ANSWERS and packet.tick >= first:
            answer.append(packet.raw)
    return answer


# -- reporting -----------------------------------------------------------------------------------------------------


def config_differences(recorded: Iterable[bytes], made: Orders) -> list[tuple[str, str, str]]:
    """CONFIG words that are not the recorded ones: (name, recorded, now); one line where a packet is damaged."""
    then: dict[int, int] = {}
    for packet in recorded:
        part = _frame(packet)
        if not isinstance(part, Config):
            return [("CONFIG", f"damaged: {decoded(packet)}", "whole")]
        then.update(enumerate(part.words, start=part.offset))
    table = (*COMMON, *made.table.params)
    named_then = {word.name: then.get(index, 0) for index, word in enumerate(table)}
    named_now = {word.name: made.words[index] for index, word in enumerate(table)}
    differences = []
    for word in table:
        if named_then[word.name] != named_now[word.name]:
            old = dequantise(word, named_then[word.name], named_then)
            new = dequantise(word, named_now[word.name], named_now)
            differences.append((word.name, f"{old:.9g} {word.unit}".rstrip(), f"{new:.9g} {word.unit}".rstrip()))
    rows_then = {index: value for index, value in then.items() if index >= len(table)}
    rows_now = dict(enumerate(made.words[len(table) :], start=len(table)))
    if rows_then != rows_now:
        rows = f"{len(rows_then) // ROW_WORDS} rows", f"{len(rows_now) // ROW_WORDS} rows"
        differences.append(("guidance rows", *rows) if rows[0] != rows[1] else ("guidance rows", rows[0], "other rows"))
    return differences


def decoded(packet: bytes | None) -> str:
    """A frame in words, for the report; "nothing" where there is none."""
    if packet is None:
        return "nothing"
    try:
        frame: Any = frames.unpack(packet).frame
    except frames.BadPacket as error:
        return f"{packet.hex(' ')} ({error})"
    return f"{type(frame).__name__.upper()} {', '.join(f'{k}={v}' for k, v in frame._asdict().items())}"
