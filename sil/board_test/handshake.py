"""Opening a session: who answers, once, with the nonce it was given; what starts anew with a session, and what not."""

from __future__ import annotations

from itertools import pairwise

from protocol import frames
from protocol.codec import encode
from protocol.frames import Hello, Packet, Tick, Type
from protocol.law_tables import LAWS
from sil.board_test.bench import Bench
from sil.board_test.examinee import Examinee
from sil.board_test.made import sample, unknown_law, words_of
from sil.board_test.outcome import Failed, Skipped, called, expect, listed, passed
from sil.doctor.findings import Finding

NONCES = (1, 0xFFFF_FFFF_FFFF_FFFF, 0x8000_0000_0000_0000, 0x0102_0304_0506_0708)
TICKS = 5


def echo(at: Examinee) -> Finding:
    """SPEC, 6.1: role 1, flag echo, the lab's nonce, clock rate 0, own version, L and build."""
    hello = at.bench.greet()
    expect("protocol version", frames.PROTOCOL_VERSION, hello.protocol_version)
    expect("layout hash", f"{frames.LAYOUT_HASH:08x}", f"{hello.layout_hash:08x}")
    expect("role", frames.ROLE_BOARD, hello.role)
    expect("clock_rate_q16", 0, hello.clock_rate_q16)
    if not hello.build:
        raise Failed("build: expected a name, got nothing")
    timer = bool(hello.flags & frames.HELLO_OWN_TIMER)
    return passed(
        f"{hello.build!r}, protocol {hello.protocol_version}, layout {hello.layout_hash:08x}, "
        f"{'own timer' if timer else 'no timer of its own: lockstep only'}",
        build=hello.build, protocol=hello.protocol_version, layout=f"{hello.layout_hash:08x}", own_timer=timer,
    )  # fmt: skip


def once(at: Examinee) -> Finding:
    """Every HELLO is answered, and once."""
    bench = at.bench
    bench.greet()
    counts = []
    for _ in range(2):
        bench.send(bench.hello(), bench.hello(), bench.hello())
        counts.append([called(packet) for packet in bench.settle() if packet.type != Type.TIMING])
    for got in counts:
        if got != ["HELLO (echo)"] * 3:
            raise Failed(f"three HELLOs: expected 3 echoes, got {listed(got)}")
    return passed("three HELLOs, three echoes")


def nonce(at: Examinee) -> Finding:
    """All 64 bits of a nonce come back; a new one takes over, the same is only answered."""
    bench = at.bench
    for number in NONCES:
        echoes = [packet.frame for packet in bench.last_answers(bench.hello(number)) if packet.type == Type.HELLO]
        expect("echo of a new nonce", [f"{number:016x}"], [f"{echo.nonce:016x}" for echo in echoes])
    return passed(f"{len(NONCES)} nonces of 64 bits come back as they were")


def configured(at: Examinee) -> Finding:
    """Flag configured: clear before READY and after STOP, set between."""
    bench = at.bench
    echoes = [bench.greet()]
    words = words_of(at.law)
    bench.configure(unknown_law(at.law))
    echoes.append(_asked(bench))
    bench.open(words)
    echoes.append(_asked(bench))
    bench.answers(sample(0))
    echoes.append(_asked(bench))
    echoes.append(bench.greet())
    flags = [bool(hello.flags & frames.HELLO_CONFIGURED) for hello in echoes]
    moments = ("before CONFIG", "after READY status 2", "after READY", "in flight", "with a new nonce")
    for moment, want, got in zip(moments, (False, False, True, True, False), flags, strict=True):
        expect(f"flag configured {moment}", want, got)
    return passed("set from READY on, clear with a new session")


def _asked(bench: Bench) -> Hello:
    """What HELLO says in the middle of a session."""
    bench.answers()
    assert bench.echo is not None
    return bench.echo


def laws(at: Examinee) -> Finding:
    """Which of the laws that are known here the board has. A board may leave laws out."""
    at.laws = []
    missing, refused = [], []
    for table in LAWS.values():
        at.tell(f"CONFIG of {table.name}")
        ready = at.bench.open(words_of(table))
        if ready.status == frames.READY_OK:
            at.laws.append(table)
        elif ready.status == frames.READY_UNKNOWN_LAW:
            missing.append(table.name)
        else:
            refused.append(f"{table.name}: READY status {ready.status}, index {ready.index}")
    named = [table.name for table in at.laws]
    if refused:
        raise Failed(f"CONFIG with the defaults of a law: expected READY status 0 or 2, got {listed(refused)}")
    if not named:
        raise Failed(f"laws: expected at least one of {', '.join(missing)}, got none")
    return passed(f"{', '.join(named)}{f'; without {listed(missing)}' if missing else ''}", laws=named)


def sequence(at: Examinee) -> Finding:
    """SPEC, 5: deterministic numbers begin at 0 in each session; those of HELLO and READY count on."""
    bench, words, house = at.bench, words_of(at.law), []
    for session in (1, 2):
        seen = _short_session(bench, words)
        counted = [packet.sequence for packet in seen if not frames.is_housekeeping(packet.type)]
        expect(f"numbers of the answers in session {session}", list(range(len(counted))), counted)
        house += [packet.sequence for packet in seen if frames.is_housekeeping(packet.type)]
    if any((after - before) & 0xFFFF != 1 for before, after in pairwise(house)):
        raise Failed(f"numbers of HELLO and READY: expected one after the other, got {listed(map(str, house))}")
    return passed("answers from 0 in each session; HELLO and READY count on")


def framing(at: Examinee) -> Finding:
    """SPEC, 4: 0x00, COBS(packet), 0x00 for every frame, and not one byte more."""
    bench = at.bench
    if bench.port.link.datagram:
        raise Skipped("a datagram is a packet as it stands")
    bench.settle()
    bench.talk.heard.kept.clear()
    seen = _short_session(bench, words_of(at.law))
    expected = b"".join(encode(packet.raw) for packet in seen)
    got = bytes(bench.talk.heard.kept)
    if got != expected:
        same = zip(got, expected, strict=False)
        place = next((at for at, (x, y) in enumerate(same) if x != y), min(len(got), len(expected)))
        context = got[max(0, place - 4) : place + 4].hex(" ")
        raise Failed(f"bytes on the line: expected a zero before and behind each frame, got {context} at byte {place}")
    return passed(f"{len(seen)} frames, {len(got)} bytes: a zero before and behind each")


def _short_session(bench: Bench, words: tuple[int, ...]) -> list[Packet]:
    """Every packet that a handshake and a few ticks bring."""
    seen: list[Packet] = []
    bench.tape = seen
    try:
        bench.open(words)
        for tick in range(TICKS):
            bench.answer(bench.port.pack(sample(tick) if tick % 2 == 0 else Tick(tick)), tick)
    finally:
        bench.tape = None
    return seen
