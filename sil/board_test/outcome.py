"""How a check of a board ends: passed, failed or skipped, each with one line, and how frames are called in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from protocol import frames
from protocol.frames import Packet, Type
from sil.doctor.findings import Finding

PASS, FAIL, SKIPPED = "pass", "fail", "skipped"
USED = {
    frames.USED: "used",
    frames.PROPAGATED: "propagated",
    frames.REPEATED: "repeated",
    frames.RESTARTED: "restarted",
    frames.REUSED: "reused",
}
MOST_SHOWN = 5  # of a list of frames
MOST_LINES = 4  # of what is wrong


class Failed(Exception):
    """The board does not do what it should: one line `what: expected X, got Y`. lines: more of the same."""

    def __init__(self, said: str, lines: Iterable[str] = (), data: dict[str, Any] | None = None) -> None:
        super().__init__(said)
        self.lines, self.data = tuple(lines), data or {}


class Silent(Failed):
    """An answer did not come within its time."""


class Skipped(Exception):
    """This check does not apply to this board, or cannot be made here: why, in one line."""


def passed(said: str, lines: Iterable[str] = (), **data: Any) -> Finding:
    """The finding of a check that found nothing wrong."""
    return Finding(PASS, said, lines=tuple(lines), data=data)


def called(packet: Packet) -> str:
    """A frame in a few words, as far as SPEC's table of states tells frames apart."""
    frame: Any = packet.frame
    if packet.type == Type.HELLO:
        echo = "echo" if frame.flags & frames.HELLO_ECHO else "no echo"
        return f"HELLO ({echo if frame.nonce or frame.flags & frames.HELLO_ECHO else 'nonce 0'})"
    if packet.type == Type.READY:
        index = "" if frame.index == frames.NO_INDEX else f", index {frame.index}"
        return f"READY (status {frame.status}{index})"
    if packet.type == Type.COMMAND:
        return f"COMMAND({packet.tick})"
    if packet.type in (Type.TELEMETRY, Type.TIMING):
        return f"{Type(packet.type).name}({packet.tick})"
    if packet.type == Type.EVENT:
        return f"EVENT({packet.tick}) {frame.code:#06x}"
    return Type(packet.type).name


def listed(names: Iterable[str]) -> str:
    """`a, b, c`; `nothing` where there is none; a long list is cut."""
    texts = list(names)
    more = f" and {len(texts) - MOST_SHOWN} more" if len(texts) > MOST_SHOWN else ""
    return ", ".join(texts[:MOST_SHOWN]) + more or "nothing"


def judged(wrong: Sequence[str], said: str, **data: Any) -> Finding:
    """The finding of a check of many cases, each of which is right or in `wrong`. Raises Failed; JSON has all of it."""
    if wrong:
        more = f"; and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        raise Failed(f"{wrong[0]}{more}", wrong[1:MOST_LINES], {"wrong": list(wrong), **data})
    return passed(said, **data)


def expect(what: str, expected: Any, got: Any) -> None:
    """Raises Failed where they are not equal."""
    if expected != got:
        raise Failed(f"{what}: expected {_text(expected)}, got {_text(got)}")


def _text(value: Any) -> str:
    return listed(map(str, value)) if isinstance(value, list) else str(value)
