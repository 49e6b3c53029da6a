"""The cable itself: the device as the doctor sees it, the first HELLO, baud rates, errors while we talked, the end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, suppress

from protocol.link import LinkError
from protocol.links import open_link
from protocol.links.serial import parse_url
from sil.board_test.examinee import Examinee
from sil.board_test.outcome import FAIL, PASS, Failed, Skipped, listed, passed
from sil.doctor import device as devices
from sil.doctor import verdicts
from sil.doctor.findings import NOTE, OK, PROBLEM, Finding
from sil.doctor.link import LISTEN_S, TRY_BAUD_S, USUAL_BAUDS, examine_device, line_errors
from sil.doctor.talk import Talk

STATUS = {OK: PASS, NOTE: PASS, PROBLEM: FAIL}
BAUDS = tuple(baud for baud in sorted(USUAL_BAUDS) if baud <= 921600)


def judged(finding: Finding) -> Finding:
    """A finding of the doctor's as a check of the board."""
    return finding._replace(status=STATUS[finding.status])


def device(at: Examinee) -> Iterator[Finding]:
    """What can be known of a serial port without opening it; ends at the first problem."""
    if at.order.launched or not at.order.url.startswith("serial:"):
        return
    order = at.order.examination()
    path, _ = parse_url(order.url)
    at.device = devices.find(order.around, path, order.status)
    for finding in examine_device(order, path, at.device):
        yield judged(finding)


def first_hello(at: Examinee) -> Iterator[Finding]:
    """Somebody answers HELLO, and who; where nobody does, what came instead."""
    talk = at.bench.talk
    before = line_errors(talk.heard.inner)
    at.tell("listening")
    talk.listen(LISTEN_S)
    unasked = dict(talk.types)
    hello = talk.greet(at.order.patience.hello_s, at.tell)
    if hello is None:
        url = at.order.target
        yield from map(
            judged, verdicts.no_answer(talk, url, verdicts.line_lines(before, line_errors(talk.heard.inner)))
        )
        return
    at.first = hello
    yield from map(judged, verdicts.who(talk, hello, unasked))


# -- baud rates --------------------------------------------------------------------------------------------------------


def bauds(at: Examinee) -> Finding:
    """At which of the usual baud rates the board answers; the one that was given is set again."""
    if at.order.launched or not at.order.url.startswith("serial:"):
        raise Skipped("this link has no baud rate")
    if at.baud is None:
        raise Skipped("a pseudo-terminal has no baud rate")
    path, given = parse_url(at.order.url)
    at.unplug()
    try:
        answered = [baud for baud in BAUDS if _answers(at, path, baud)]
    finally:
        at.plug()
    at.bench.greet()  # at the rate that was given, whatever it heard at the others
    if given not in answered:
        raise Failed(f"baud rates: expected an answer at {given}, got one at {listed(map(str, answered))}")
    others = [str(baud) for baud in answered if baud != given]
    said = (
        f"it answers at {given} baud and at no other" if not others else f"it answers at {given}, {', '.join(others)}"
    )
    return passed(f"{said} of {len(BAUDS)} from {BAUDS[0]} to {BAUDS[-1]}", answered=answered, tried=list(BAUDS))


def _answers(at: Examinee, path: str, baud: int) -> bool:
    at.tell(f"trying {baud} baud")
    with suppress(LinkError), closing(Talk(open_link(f"serial://{path}?baud={baud}", listen=False), baud)) as talk:
        return talk.greet(TRY_BAUD_S, at.tell) is not None
    return False


# -- the end -----------------------------------------------------------------------------------------------------------


def clean(at: Examinee) -> Finding:
    """Nothing came that was no frame, or that nobody had asked for."""
    counters = at.bench.port.counters
    faults = {name: at.faults[name] + getattr(counters, name) for name in verdicts.FAULTS}
    strays, received = [*at.strays, *at.bench.strays], at.received + counters.received
    if any(faults.values()):
        said = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in faults.items() if count)
        raise Failed(f"from the board: expected frames only, got {said}", data=faults)
    if strays:
        raise Failed(f"expected answers only, got {listed(strays)}, which nobody had asked for")
    return passed(f"{received} frames from the board, nothing else", received=received)


def left(at: Examinee) -> Finding:
    """STOP at the end: the board is left without a session."""
    if not at.bench.leave():
        raise Failed("STOP, then TICK: expected HELLO (nonce 0), got another answer or none")
    return passed("STOP; the board is left without a session")
