"""SPEC 6.1 and 6.2: what a board does at boot. One HELLO with nonce 0 and nothing else, whatever it was in before."""

from __future__ import annotations

from contextlib import suppress

from protocol import frames
from protocol.frames import Packet, Stop, Tick, Type
from protocol.link import LinkError
from sil.board_test.bench import Bench
from sil.board_test.examinee import Examinee, deadline
from sil.board_test.made import sample, whole, words_of
from sil.board_test.outcome import Failed, Silent, Skipped, called, expect, listed, passed
from sil.doctor.findings import Finding

BOOT = "HELLO (nonce 0)"
ASK_EVERY_S = 0.5
FLOWN = 3


def reset(at: Examinee) -> Finding:
    """Reset in the middle of a flight: by its button, or, of a board that we started, by starting it again."""
    ready = at.bench.open(words_of(at.law))
    expect("CONFIG: READY status", frames.READY_OK, ready.status)
    for tick in range(FLOWN):
        at.bench.answers(sample(tick))
    at.bench.settle()
    at.bench.port.reset(forget=False)  # a board that has booted numbers from 0 again
    if at.press():
        how, asked, within_s = "its button pressed", False, at.order.patience.boot_s
    elif at.order.launched:
        at.tell("starting the board again")
        at.replug()
        how, asked, within_s = "started again", False, at.order.patience.boot_s
    elif at.order.reset or at.order.reset_offered:
        at.ask(f"press the board's reset button, within {at.order.reset_within_s:g} s")
        how, asked, within_s = "reset", True, at.order.reset_within_s
    else:
        raise Skipped("nobody here to press reset (--reset asks for it)")
    _boots(at, asked, within_s)
    _knows_nothing(at)
    return passed(f"{how} in flight: one HELLO with nonce 0, and that for CONFIG, SAMPLE, TICK and STOP")


def _boots(at: Examinee, asked: bool, within_s: float) -> None:
    """Wait for the HELLO of a boot; nothing else may come with it.

    A board on UDP has nobody to say it to: it is asked with TICK(0), which a board in flight does not answer.
    """
    bench, left_s = at.bench, deadline(within_s)
    got: list[str] = []
    while left_s() > 0.0 and BOOT not in got:
        if asked:
            at.tell(f"waiting for the reset: {left_s():.0f} s left")
        packet = _next(bench, min(ASK_EVERY_S, left_s()))
        if packet is not None:
            got.append(called(packet))
    if BOOT not in got and asked and not at.order.reset:
        raise Skipped(
            f"no {BOOT} within {within_s:g} s: reset was not pressed, or it says nothing at boot (see --reset)"
        )
    if BOOT not in got:
        raise Failed(f"{'reset' if asked else 'boot'}: expected {BOOT} within {within_s:g} s, got {listed(got)}")
    got += [called(packet) for packet in bench.settle()]
    expect("what the board says at boot", [BOOT], list(dict.fromkeys(got)) if bench.port.link.datagram else got)


def _next(bench: Bench, within_s: float) -> Packet | None:
    """What comes; over UDP, where the board may be away for a while, in answer to a TICK of the past."""
    if not bench.port.link.datagram:
        return bench.receive(within_s)
    with suppress(LinkError):
        bench.send(Tick(0))
        return bench.receive(within_s)
    return None


def _knows_nothing(at: Examinee) -> None:
    """Without a session it answers everything with that HELLO."""
    bench = at.bench
    for name, out in (
        ("CONFIG", whole(at.law)[:1]),
        ("SAMPLE", (sample(FLOWN),)),
        ("TICK", (Tick(FLOWN),)),
        ("STOP", (Stop(frames.STOP_DONE),)),
    ):
        bench.send(*out)
        try:
            got = bench.until(lambda packet: packet.type == Type.HELLO, bench.patience.answer_s, name)
        except Silent as silent:
            raise Failed(f"after boot, {silent}") from None
        expect(f"after boot, {name}", [BOOT], [called(packet) for packet in got])
    bench.greet()
