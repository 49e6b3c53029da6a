"""SPEC 7, the board's half of the timing contract, in lockstep: each clause in words, each byte as the reference."""

from __future__ import annotations

import random
from typing import Any

from protocol import events, frames
from protocol.frames import Command, Tick
from protocol.law_tables import TELEMETRY_COMMON, LawTable
from sil.board_test.examinee import Examinee
from sil.board_test.made import sample, whole
from sil.board_test.outcome import USED, Failed, expect, passed
from sil.board_test.twin import Twin, commands, events_of, telemetry, the_command, word
from sil.doctor.findings import Finding

LOST, OVERRUNS, DROPPED = (
    [word.name for word in TELEMETRY_COMMON].index(name) for name in ("samples_lost", "overruns", "dropped")
)
LINK_LIMIT = 5
MOST_EVENTS = 16
TRANSIT_US = 6857
ORDER = ("Command", "Telemetry", "Event")
RANDOM_STEPS = 300
LIMIT_NM = 0.02  # so that some torques are at it
BUSY_US = 420_000  # a TICK, or a SAMPLE that took long, makes the next one an overrun
SEED = 4
IDENTIFY = ("mrac", "appc")  # laws that learn from their readings


def _each(at: Examinee, check: Any, **values: Any) -> None:
    """The same with every law of the board: law by law it is told which one fails."""
    for table in at.laws:
        twin = Twin(at, table, **values)
        at.tell(f"{table.name}")
        try:
            check(twin)
            twin.agree()
        except Failed as failed:
            raise Failed(f"{table.name}: {failed}", failed.lines) from None


def _used(answers: list[Any]) -> list[str]:
    return [f"{command.tick} {USED.get(command.used, command.used)}" for command in commands(answers)]


def _codes(answers: list[Any]) -> list[str]:
    return [events.name_of(event.code) for event in events_of(answers)]


def _without(twin: Twin) -> str:
    """How the law steps without a reading."""
    return "propagated" if twin.table.has_model else "repeated"


def _start(twin: Twin, count: int) -> list[Any]:
    """SAMPLEs 0 .. count-1; the answer to the last."""
    answers: list[Any] = []
    for tick in range(count):
        answers = twin.send(sample(tick))
        expect(f"SAMPLE({tick})", [f"{tick} used"], _used(answers))
    return answers


# -- one clause each ---------------------------------------------------------------------------------------------------


def answer(at: Examinee) -> Finding:
    """B1, B15: COMMAND, TELEMETRY if due, EVENTs, and COMMAND says how many follow."""

    def check(twin: Twin) -> None:
        for tick in range(7):
            got = twin.send(sample(tick, valid=0 if tick == 5 else 7))
            kinds = [type(frame).__name__ for frame in got]
            expect(f"tick {tick}: other frames", [], [kind for kind in kinds if kind not in ORDER])
            expect(f"tick {tick}: order of the answer", sorted(kinds, key=ORDER.index), kinds)
            expect(f"tick {tick}: one COMMAND", ["Command"], [kind for kind in kinds if kind == "Command"])
            expect(f"tick {tick}: follows", len(got) - 1, got[0].follows)
            expect(f"tick {tick}: TELEMETRY every third tick", tick % 3 == 0, bool(telemetry(got)))

    _each(at, check, telemetry_every=3)
    _each(at, lambda twin: expect("no TELEMETRY", 0, len(telemetry(_start(twin, 2)))), telemetry_every=0)
    return passed("COMMAND, TELEMETRY every n-th tick, EVENTs; `follows` counts them")


def tick_frame(at: Examinee) -> Finding:
    """B2, B5: TICK steps without a SAMPLE; a law without a model repeats its last command."""

    def check(twin: Twin) -> None:
        last = commands(_start(twin, 6))[-1]
        got = twin.send(Tick(6))
        expect("TICK(6)", [f"6 {_without(twin)}"], _used(got))
        expect("events of TICK(6)", ["SAMPLE_LOST"], _codes(got))
        if not twin.table.has_model:
            expect("torque that is repeated", last.torque, the_command(got).torque)
        expect("TICK(8)", [f"{k} {_without(twin)}" for k in (7, 8)], _used(twin.send(Tick(8))))
        expect("TICK(8) again", [], twin.send(Tick(8)))
        expect("SAMPLE(9)", ["9 used"], _used(twin.send(sample(9))))

    _each(at, check)
    return passed("TICK steps once, up to its tick, without a reading")


def stale(at: Examinee) -> Finding:
    """B7: a SAMPLE of a tick already stepped is dropped, counted, and reported with the next answer."""

    def check(twin: Twin) -> None:
        _start(twin, 4)
        expect("SAMPLE(3) again", [], twin.send(sample(3)))
        expect("SAMPLE(0) again", [], twin.send(sample(0)))
        got = twin.send(sample(4))
        expect("SAMPLE(4)", ["4 used"], _used(got))
        expect("its events", ["STALE_SAMPLE"] * 2, _codes(got))
        expect("ticks in STALE_SAMPLE", [3, 0], [event.a for event in events_of(got)])
        expect("dropped in TELEMETRY", 2, word(got, DROPPED))

    _each(at, check)
    return passed("not answered, counted, told with the next answer")


def ahead(at: Examinee) -> Finding:
    """B8: up to four ticks ahead the board steps those between, too."""

    def check(twin: Twin) -> None:
        _start(twin, 3)
        tick = 3
        for gap in (1, 2, 3, 4):
            expected = [f"{tick + i} {_without(twin)}" for i in range(gap)] + [f"{tick + gap} used"]
            expect(f"SAMPLE ahead by {gap}", expected, _used(twin.send(sample(tick + gap))))
            tick += gap + 1
        expected = [f"{tick + i} {_without(twin)}" for i in range(5)]
        expect("TICK ahead by 4", expected, _used(twin.send(Tick(tick + 4))))

    _each(at, check)

    def first(twin: Twin) -> None:
        expected = [f"{k} {_without(twin)}" for k in range(4)] + ["4 used"]
        expect("SAMPLE(4) as the first", expected, _used(twin.send(sample(4))))

    _each(at, first)
    return passed("1, 2, 3 and 4 ticks: those between are stepped and answered")


def restart(at: Examinee) -> Finding:
    """B8: five ahead is a bumpless re-start; counters stay, law, reference and watchdog begin anew."""

    def check(twin: Twin) -> None:
        _start(twin, 8)
        twin.send(Tick(8))
        twin.send(sample(2))
        got = twin.send(sample(14))
        expect("SAMPLE ahead by 5", ["14 restarted"], _used(got))
        expect("its first event", "RESTARTED", (_codes(got) or ["none"])[0])
        expect("RESTARTED", (9, 14), (events_of(got)[0].a, events_of(got)[0].b))
        expect("samples lost and dropped", (1, 1), (word(got, LOST), word(got, DROPPED)))
        expect("SAMPLE(15)", ["15 used"], _used(twin.send(sample(15))))
        expect("TICK ahead by 5", ["21 restarted"], _used(twin.send(Tick(21))))

    _each(at, check)
    return passed("from five ticks on, one answer: restarted")


def watchdog(at: Examinee) -> Finding:
    """B14: from step number link_limit without a SAMPLE on, torque zero and a flag, until one comes."""

    def check(twin: Twin) -> None:
        _start(twin, 10)
        silent: list[Command] = []
        for tick in range(10, 18):
            got = twin.send(Tick(tick))
            silent += commands(got)
            expect(f"event in step {tick - 9} of silence", tick == 9 + LINK_LIMIT, "WATCHDOG_ON" in _codes(got))
        flags = [bool(command.flags & frames.FLAG_WATCHDOG) for command in silent]
        expect("steps with the flag", [False] * (LINK_LIMIT - 1) + [True] * (9 - LINK_LIMIT), flags)
        loud = [c.tick for c, flag in zip(silent, flags, strict=True) if flag and c.torque != (0, 0, 0)]
        expect("ticks with the flag and a torque", [], loud)
        invalid = twin.send(sample(18, valid=0))
        expect("a SAMPLE, usable or not, ends it", ["WATCHDOG_OFF"], [c for c in _codes(invalid) if "WATCH" in c])
        expect("flag then", 0, the_command(invalid).flags & frames.FLAG_WATCHDOG)
        twin.send(sample(19))

    _each(at, check, link_limit=LINK_LIMIT)
    return passed(f"step {LINK_LIMIT} of silence: zero, flag, event; a SAMPLE ends it")


def overrun(at: Examinee) -> Finding:
    """B11: a SAMPLE that comes while the board is busy, by the model, is stepped without it."""

    def check(twin: Twin) -> None:
        found = []
        for tick in range(12):
            got = twin.send(sample(tick, transit_us=TRANSIT_US))
            found.append(bool(the_command(got).flags & frames.FLAG_OVERRUN))
            expect(f"tick {tick}: event OVERRUN with its flag", found[-1], "OVERRUN" in _codes(got))
        expect("overruns of twelve SAMPLEs", _overruns(300_000, 345_000, len(found)), found)

    _each(at, check, period_us=300_000, answer_delay_us=345_000)

    def in_time(twin: Twin) -> None:
        for tick in range(4):
            expect(f"tick {tick}", [f"{tick} used"], _used(twin.send(sample(tick, transit_us=TRANSIT_US))))

    _each(at, in_time, period_us=400_000, answer_delay_us=345_000)
    return passed("0.345 s of work: every SAMPLE but the first at T_s 0.3 s, none at 0.4 s")


def _overruns(period_us: int, delay_us: int, ticks: int) -> list[bool]:
    """B11, once more."""
    free_at, found = 0, []
    for tick in range(ticks):
        arrival = tick * period_us + TRANSIT_US
        found.append(arrival < free_at)
        free_at = max(arrival, free_at) + delay_us
    return found


def invalid(at: Examinee) -> Finding:
    """B4: a SAMPLE without a valid reading that the law needs counts as lost; others do not matter."""

    def check(twin: Twin) -> None:
        _start(twin, 6)
        needs = twin.table.needs
        got = twin.send(sample(6, valid=7 & ~needs))
        expect("SAMPLE without the reading it needs", [f"6 {_without(twin)}"], _used(got))
        expect("its events", ["READING_INVALID", "SAMPLE_LOST"], _codes(got))
        expect("a and b of READING_INVALID", (needs, 7 & ~needs), (events_of(got)[0].a, events_of(got)[0].b))
        expect("SAMPLE with just that reading", ["7 used"], _used(twin.send(sample(7, valid=needs))))
        absent = (None, *sample(8).readings[1:])
        kept = [reading if needs >> bit & 1 else None for bit, reading in enumerate(sample(9).readings)]
        expect(
            "SAMPLE without Euler angles",
            [f"8 {_without(twin)}"],
            _used(twin.send(sample(8, valid=6, readings=absent))),
        )
        alone = sample(9, valid=needs, readings=tuple(kept))
        expect("SAMPLE with nothing else", ["9 used"], _used(twin.send(alone)))

    _each(at, check)
    return passed("counts as lost, with its event; a reading it does not need does not matter")


def identification(at: Examinee) -> Finding:
    """B6: identification pauses with a lost sample and resumes with the third good one in a row."""

    def check(twin: Twin) -> None:
        _start(twin, 30)
        twin.send(Tick(30))
        flags = []
        for tick in range(31, 36):
            flags.append(bool(the_command(twin.send(sample(tick))).flags & frames.FLAG_IDENTIFICATION_PAUSED))
        if twin.table.name in IDENTIFY:
            expect("paused in the five ticks behind a lost sample", [True, True, False, False, False], flags)

    _each(at, check)
    return passed("paused for two good samples, on with the third")


def reuse(at: Examinee) -> Finding:
    """B5, B6: where CONFIG says so, the last reading passes for a fresh one; counters and COMMAND tell the truth."""

    def check(twin: Twin) -> None:
        expect("TICK(0), before any reading", [f"0 {_without(twin)}"], _used(twin.send(Tick(0))))
        for tick in range(1, 30):
            twin.send(sample(tick))
        for tick, out in ((30, Tick(30)), (31, sample(31, valid=0))):
            got = twin.send(out)
            expect(f"tick {tick}", [f"{tick} reused"], _used(got))
            expect(f"tick {tick}: its last event", "SAMPLE_LOST", (_codes(got) or ["none"])[-1])
            expect(f"tick {tick}: samples lost", tick - 28, word(got, LOST))
            paused = bool(the_command(got).flags & frames.FLAG_IDENTIFICATION_PAUSED)
            expect(f"tick {tick}: identification paused", False, paused)
        expect("TICK ahead by 9", ["40 restarted"], _used(twin.send(Tick(40))))
        expect("TICK behind a re-start", [f"41 {_without(twin)}"], _used(twin.send(Tick(41))))

    _each(at, check, stale="reuse")
    return passed("`stale: reuse`: the last reading as if it were fresh, none where there is none")


def setpoints(at: Examinee) -> Finding:
    """B9: of the last guidance row whose tick is not after k; or of SAMPLE, kept while none comes."""
    first = [word.name for word in TELEMETRY_COMMON].index("setpoint_x")

    def seen(got: list[Any]) -> tuple[int, ...]:
        return tuple(word(got, first + axis) for axis in range(3))

    def by_sample(twin: Twin) -> None:
        expect("set-point of SAMPLE(0)", (1, -2, 3), seen(twin.send(sample(0, setpoint=(1, -2, 3)))))
        expect("kept over TICK(1)", (1, -2, 3), seen(twin.send(Tick(1))))
        expect("of a SAMPLE without readings, too", (7, 8, 9), seen(twin.send(sample(2, valid=0, setpoint=(7, 8, 9)))))

    def by_table(twin: Twin) -> None:
        for tick in (0, 1, 2, 5, 6):
            want = (0, 0, 0) if tick < 2 else (5, 6, 7) if tick < 6 else (2**31 - 1, -(2**31), 0)
            expect(f"set-point of tick {tick}", want, seen(twin.send(sample(tick, setpoint=(9, 9, 9)))))

    _each(at, by_sample, setpoint_source=1, rows=())
    _each(at, by_table, rows=((2, 5, 6, 7), (6, 2**31 - 1, -(2**31), 0)))
    return passed("of the table's row, or of SAMPLE, kept while none comes")


def many_events(at: Examinee) -> Finding:
    """B1: at most 16 EVENTs in an answer; further ones are only counted."""

    def check(twin: Twin) -> None:
        _start(twin, 2)
        for _ in range(MOST_EVENTS + 4):
            expect("a stale SAMPLE", [], twin.send(sample(0)))
        got = twin.send(Tick(2))
        expect("EVENTs", MOST_EVENTS, len(events_of(got)))
        expect("follows", len(got) - 1, the_command(got).follows)
        expect("dropped in TELEMETRY", MOST_EVENTS + 4, word(got, DROPPED))
        later = [code for code in _codes(twin.send(sample(3))) if code == "STALE_SAMPLE"]
        expect("STALE_SAMPLEs in the next answer", [], later)

    _each(at, check)
    return passed(f"{MOST_EVENTS} of {MOST_EVENTS + 5} are sent, all are counted")


def late_ticks(at: Examinee) -> Finding:
    """Tick numbers are unsigned, 32 bits: a session may begin far from 0."""

    def check(twin: Twin) -> None:
        for tick in (2**31 - 2, 2**31 - 1, 2**31, 2**31 + 1):
            got = twin.send(sample(tick))
            want = "restarted" if tick == 2**31 - 2 else "used"
            expect(f"SAMPLE({tick})", [f"{tick} {want}"], _used(got))
        expect("TICK beyond 2^31", [f"{2**31 + 2} {_without(twin)}"], _used(twin.send(Tick(2**31 + 2))))
        expect("a SAMPLE from before 2^31", [], twin.send(sample(2**31 - 1)))
        last = frames.NO_TICK - 1
        expect("SAMPLE of the last tick there is", [f"{last} restarted"], _used(twin.send(sample(last))))
        expect("TICK of the last tick, again", [], twin.send(Tick(last)))

    _each(at, check)
    return passed("beyond 2^31, up to the last tick there is")


def at_random(at: Examinee) -> Finding:
    """Everything at once, in any order, byte for byte as the reference."""
    steps = RANDOM_STEPS if at.baud is None else RANDOM_STEPS // 3
    for table in at.laws:
        twin = Twin(at, table, link_limit=4, answer_delay_us=BUSY_US, telemetry_every=2, torque_limit=LIMIT_NM)
        rng, tick = random.Random(SEED), 0
        for number in range(steps):
            at.tell(f"{table.name}: step {number + 1} of {steps}")
            tick = _random_step(twin, table, rng, tick)
            try:
                twin.agree()
            except Failed as failed:
                raise Failed(f"{table.name}, step {number + 1}: {failed}") from None
    return passed(f"{steps} steps with each law: losses, gaps, stale and invalid SAMPLEs, CONFIG and HELLO in flight")


def _random_step(twin: Twin, table: LawTable, rng: random.Random, tick: int) -> int:
    """Send something; the next tick."""
    choice = rng.random()
    if choice < 0.55:
        twin.send(_random_sample(tick, rng))
        return tick + 1
    if choice < 0.70:
        twin.send(Tick(tick))
        return tick + 1
    if choice < 0.80:
        ahead = rng.randrange(1, 8)
        twin.send(_random_sample(tick + ahead, rng))
        return tick + ahead + 1
    if choice < 0.88:
        twin.send(sample(max(0, tick - rng.randrange(1, 6))))
    elif choice < 0.94:
        twin.send(*whole(table))
    else:
        twin.send(sample(tick), Tick(tick + 1), sample(tick + 2))
        return tick + 3
    return tick


def _random_sample(tick: int, rng: random.Random) -> Any:
    made = sample(tick)
    euler = made.readings[0]
    assert euler is not None
    small = 2**32 // 360 * 20
    values, torque, momentum = (_three(rng, most) for most in (small, 2**27, 2**26))
    valid = 7 if rng.random() < 0.85 else rng.randrange(8)
    readings = (euler._replace(values=values), *made.readings[1:])
    transit_us = rng.choice((0, 6857, 250_000))
    return made._replace(readings=readings, applied=torque, momentum=momentum, valid=valid, transit_us=transit_us)


def _three(rng: random.Random, most: int) -> tuple[int, int, int]:
    return rng.randrange(-most, most), rng.randrange(-most, most), rng.randrange(-most, most)
