"""The same frames to the board and to the reference beside it: deterministic answers have to be the same bytes."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any

from protocol import frames
from protocol.frames import Command, Event, Frame, Packet, Telemetry, Type
from protocol.law_tables import LAWS, TELEMETRY_COMMON, LawTable
from sil.board_test.examinee import Examinee
from sil.board_test.made import words_of
from sil.board_test.outcome import Failed, called
from sil.report.diff import fields_of

COMPARED = (Type.COMMAND, Type.TELEMETRY, Type.EVENT)
MOST_FIELDS = 3


class Twin:
    """A session with both. The first answer that is another is kept until `agree`, so that a check may first say in
    its own words what is wrong.
    """

    def __init__(self, examinee: Examinee, table: LawTable, **values: Any) -> None:
        self.board, self.reference = examinee.bench, examinee.reference
        self.table = table
        self._words = words_of(table, **values)
        self._difference = ""
        for bench in (self.board, self.reference):
            ready = bench.open(self._words)
            if ready.status != frames.READY_OK:
                whose = "the board" if bench is self.board else "the reference"
                raise Failed(f"CONFIG of {table.name}: expected READY status 0 of {whose}, got {ready.status}")

    def send(self, *out: Frame | bytes) -> list[Any]:
        """To both; the frames that the board answered."""
        got, expected = self.board.answers(*out), self.reference.answers(*out)
        self.compare(expected, got)
        return [packet.frame for packet in got]

    def compare(self, expected: list[Packet], got: list[Packet]) -> None:
        """Keep the first difference."""
        self._difference = self._difference or difference(expected, got)

    def only(self, *out: Frame | bytes) -> list[Packet]:
        """To the board alone, what should not count."""
        return self.board.answers(*out)

    def agree(self) -> None:
        """Raises Failed where an answer was another."""
        if self._difference:
            raise Failed(self._difference)


def difference(expected: list[Packet], got: list[Packet]) -> str:
    """The first deterministic frame that is another, in one line; "" where all are the same bytes.

    A board may leave out TELEMETRY's words of the law itself (SPEC, before section 1).
    """
    for x, y in zip_longest(*(_compared(packets) for packets in (expected, got))):
        if x is None or y is None:
            one, what = (y, "nothing") if x is None else (x, called(x))
            return f"tick {one.tick}: expected {what}, got {'nothing' if y is None else called(y)}"
        if x.raw != y.raw and not _fewer_words(x, y):
            return _told(x, y)
    return ""


def _compared(packets: list[Packet]) -> list[Packet]:
    return [packet for packet in packets if packet.type in COMPARED]


def _fewer_words(x: Packet, y: Packet) -> bool:
    common = len(TELEMETRY_COMMON)
    if x.type != Type.TELEMETRY or y.type != Type.TELEMETRY or len(y.frame.words) != common:
        return False
    same = (x.frame.law_id, x.frame.law_version, x.sequence) == (y.frame.law_id, y.frame.law_version, y.sequence)
    return same and tuple(x.frame.words[:common]) == tuple(y.frame.words)


def _told(x: Packet, y: Packet) -> str:
    if x.type != y.type or x.tick != y.tick:
        return f"tick {x.tick}: expected {called(x)}, got {called(y)}"
    law = LAWS.get((x.frame.law_id, x.frame.law_version)) if isinstance(x.frame, Telemetry) else None
    a, b = fields_of(x.raw, law), fields_of(y.raw, law)
    names = [name for name in dict.fromkeys([*a, *b]) if a.get(name) != b.get(name)]
    more = f" (and {len(names) - MOST_FIELDS} more)" if len(names) > MOST_FIELDS else ""
    pairs = ", ".join(f"{name} {a.get(name, 'absent')}, got {b.get(name, 'absent')}" for name in names[:MOST_FIELDS])
    return f"{called(x)}: expected {pairs or x.raw.hex()}{more}"


def commands(answers: list[Any]) -> list[Command]:
    """The COMMANDs among them."""
    return [frame for frame in answers if isinstance(frame, Command)]


def the_command(answers: list[Any]) -> Command:
    """The one COMMAND among them. Raises Failed."""
    found = commands(answers)
    if len(found) != 1:
        raise Failed(f"answer: expected one COMMAND, got {len(found)}")
    return found[0]


def word(answers: list[Any], index: int) -> int:
    """A word of the last TELEMETRY among them. Raises Failed."""
    found = telemetry(answers)
    if not found or len(found[-1].words) <= index:
        got = f"{len(found[-1].words)} words" if found else "none"
        raise Failed(f"answer: expected TELEMETRY of {len(TELEMETRY_COMMON)} words or more, got {got}")
    return found[-1].words[index]


def events_of(answers: list[Any]) -> list[Event]:
    """The EVENTs among them."""
    return [frame for frame in answers if isinstance(frame, Event)]


def telemetry(answers: list[Any]) -> list[Telemetry]:
    """The TELEMETRYs among them."""
    return [frame for frame in answers if isinstance(frame, Telemetry)]
