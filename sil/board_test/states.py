"""SPEC 6.2, the table of states: every event in every state, and which state the board is in behind it.

A cell is one conversation: into the state, the event, then a TICK, whose answer tells the states apart, then a HELLO
with a new nonce, whose echo ends it. What came before the echo has to be what the table says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from protocol import frames
from protocol.frames import Packet, Stop, Tick, Type
from protocol.law_tables import LawTable
from sil.board_test.bench import Bench, fresh_nonce
from sil.board_test.examinee import Examinee
from sil.board_test.made import not_for_a_board, part_of, refused, sample, unknown_law, whole, words_of
from sil.board_test.outcome import called, expect, judged, listed
from sil.doctor.findings import Finding

TOLD = (Type.HELLO, Type.READY, Type.COMMAND)  # what the table speaks of; TELEMETRY and EVENT have checks of their own
NO_SESSION, NO_ECHO, ECHO = "HELLO (nonce 0)", "HELLO (no echo)", "HELLO (echo)"
READY, REFUSED = "READY (status 0)", "READY (status 2, index 0)"
FLOWN = 3  # ticks of the state `running`


class State(NamedTuple):
    """A row of the table: how to get there, and how TICK of the next tick is answered there."""

    enter: Callable[[Bench, LawTable], None]
    next_tick: int
    probe: str


class After(NamedTuple):
    """What an event brings: the answers to it, the state behind it, the next tick there (None: as the state has it)."""

    answers: tuple[str, ...]
    state: str
    next_tick: int | None = None


# -- states ------------------------------------------------------------------------------------------------------------


def _unconfigured(bench: Bench, table: LawTable) -> None:
    bench.greet()
    bench.send(Stop(frames.STOP_DONE))


def _greeted(bench: Bench, table: LawTable) -> None:
    bench.greet()


def _one_part(bench: Bench, table: LawTable) -> None:
    bench.greet()
    bench.send(part_of(table)[0])


def _refused(bench: Bench, table: LawTable) -> None:
    expect("CONFIG of an unknown law: READY status", frames.READY_UNKNOWN_LAW, bench.open(unknown_law(table)).status)


def _ready(bench: Bench, table: LawTable) -> None:
    expect("CONFIG: READY status", frames.READY_OK, bench.open(words_of(table, telemetry_every=0)).status)


def _running(bench: Bench, table: LawTable) -> None:
    _ready(bench, table)
    for tick in range(FLOWN):
        bench.answers(sample(tick))


STATES = {
    "unconfigured": State(_unconfigured, 0, NO_SESSION),
    "configuring": State(_greeted, 0, NO_ECHO),
    "half configured": State(_one_part, 0, NO_ECHO),
    "refused": State(_refused, 0, NO_ECHO),
    "ready": State(_ready, 0, "COMMAND(0)"),
    "running": State(_running, FLOWN, f"COMMAND({FLOWN})"),
}

# -- events ------------------------------------------------------------------------------------------------------------

Sent = Iterable[Any]


def _events(bench: Bench, table: LawTable, state: str) -> dict[str, Sent]:
    """What is sent for each event, in order."""
    tick = STATES[state].next_tick
    first, second = part_of(table)
    taken = tick + 1  # of frames without an effect: were one taken, the probe behind it would show it
    rest = (second,) if state == "half configured" else whole(table, telemetry_every=0)
    other = {
        "a frame of a board": not_for_a_board(taken),
        "a refused packet": [packet for _, packet in refused(taken, fresh_nonce(), table)][:4],
    }
    same = {} if state == "unconfigured" else {"HELLO, same nonce": [bench.hello()]}
    return {
        "HELLO, new nonce": [bench.hello(fresh_nonce())],
        **same,
        "HELLO of a board": [bench.hello(fresh_nonce(), role=frames.ROLE_BOARD)],
        "a part of CONFIG": [first],
        "all of CONFIG": rest,
        "SAMPLE": [sample(tick)],
        "TICK": [Tick(tick)],
        "STOP": [Stop(frames.STOP_DONE)],
        **other,
    }


def _table(state: str, config_frames: int) -> dict[str, After]:
    """The row of SPEC's table; config_frames: in how many packets all of CONFIG goes here."""
    nothing = After((), state)
    rows: dict[str, dict[str, After]] = {
        "unconfigured": dict.fromkeys(("a part of CONFIG", "SAMPLE", "TICK", "STOP"), After((NO_SESSION,), state))
        | {"all of CONFIG": After((NO_SESSION,) * config_frames, state)},
        "configuring": {
            "a part of CONFIG": After((), "half configured"),
            "all of CONFIG": After((READY,), "ready"),
            "SAMPLE": After((NO_ECHO,), state),
            "TICK": After((NO_ECHO,), state),
        },
        "refused": {
            "a part of CONFIG": After((REFUSED,), state),
            "all of CONFIG": After((REFUSED,) * config_frames, state),
            "SAMPLE": After((NO_ECHO,), state),
            "TICK": After((NO_ECHO,), state),
        },
        "ready": {
            "a part of CONFIG": After((READY,), state),
            "all of CONFIG": After((READY,) * config_frames, state),
            "SAMPLE": After(("COMMAND(0)",), "running", 1),
            "TICK": After(("COMMAND(0)",), "running", 1),
        },
        "running": {
            "a part of CONFIG": After((READY,), state),
            "all of CONFIG": After((READY,) * config_frames, state),
            "SAMPLE": After((f"COMMAND({FLOWN})",), state, FLOWN + 1),
            "TICK": After((f"COMMAND({FLOWN})",), state, FLOWN + 1),
        },
    }
    rows["half configured"] = rows["configuring"]
    always = {
        "HELLO, new nonce": After((ECHO,), "configuring"),
        "HELLO, same nonce": After((ECHO,), state),
        "HELLO of a board": nothing,
        "STOP": After((), "unconfigured"),
        "a frame of a board": nothing,
        "a refused packet": nothing,
    }
    return always | rows[state]


# -- checks ------------------------------------------------------------------------------------------------------------


def _check(at: Examinee, state: str) -> Finding:
    wrong = []
    config_frames = 1 if state == "half configured" else len(whole(at.law))
    row = _table(state, config_frames)
    names = list(_sent_in(at, state))
    for number, name in enumerate(names):
        at.tell(f"{state}: {name} ({number + 1} of {len(names)})")
        if said := _cell(at.bench, at.law, state, name, row[name]):
            wrong.append(said)
    return judged(wrong, f"{len(names)} events, the answer and the state behind each", events=len(names))


def _sent_in(at: Examinee, state: str) -> dict[str, Sent]:
    at.bench.greet()
    return _events(at.bench, at.law, state)


def _cell(bench: Bench, table: LawTable, state: str, name: str, after: After) -> str:
    """What is wrong with one cell of the table, "" where nothing is."""
    STATES[state].enter(bench, table)
    event = tuple(_events(bench, table, state)[name])
    there = STATES[after.state]
    tick = there.next_tick if after.next_tick is None else after.next_tick
    probed = there.probe if there.probe in (NO_SESSION, NO_ECHO) else f"COMMAND({tick})"
    got = _told(bench.last_answers(*event, Tick(tick)))
    expected = [*after.answers, probed]
    if got == expected:
        return ""
    behind = f"{name}, then TICK({tick})" if name != "TICK" else f"TICK twice, the second TICK({tick})"
    return f"{behind}: expected {listed(expected)}; got {listed(got)}"


def _told(packets: Iterable[Packet]) -> list[str]:
    return [called(packet) for packet in packets if packet.type in TOLD]


def unconfigured(at: Examinee) -> Finding:
    return _check(at, "unconfigured")


def configuring(at: Examinee) -> Finding:
    return _check(at, "configuring")


def half_configured(at: Examinee) -> Finding:
    return _check(at, "half configured")


def refused_config(at: Examinee) -> Finding:
    return _check(at, "refused")


def ready(at: Examinee) -> Finding:
    return _check(at, "ready")


def running(at: Examinee) -> Finding:
    return _check(at, "running")
