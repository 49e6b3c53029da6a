"""`sil doctor --link URL`: the device, then the conversation, as findings in the order in which they are made."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, field

from protocol.link import Link, LinkError
from protocol.links import open_link
from protocol.links.serial import LineErrors, SerialLink, parse_url
from sil.boards import BoardHost, BoardOrder, plug_in
from sil.doctor import LIMIT_S, bounded, verdicts
from sil.doctor import device as devices
from sil.doctor.device import Access, Device, Status
from sil.doctor.findings import NOTE, OK, PROBLEM, Finding, Surroundings
from sil.doctor.overheard import guess
from sil.doctor.talk import Talk, Tell
from sil.trouble import SilError

LISTEN_S = 0.3
HELLO_WITHIN_S = 4.0
TRY_BAUD_S = 0.4
USUAL_BAUDS = (115200, 9600, 19200, 38400, 57600, 230400, 460800, 921600, 1000000)
OWN_BOARDS = ("pty", "udp")


@dataclass(frozen=True)
class Examination:
    """What to do on a link. `status`, `access`: how the device is looked at; a test hands in its own."""

    url: str
    round_trips: int = 1000
    try_bauds: bool = False
    around: Surroundings = field(default_factory=Surroundings)
    hello_within_s: float = HELLO_WITHIN_S
    status: Status = os.stat
    access: Access = os.access


def link_url(text: str) -> str:
    """What the user named as a URL: a path is a serial port. Raises LinkError for what is no link to a board."""
    url = f"serial://{text}" if text.startswith("/") else text
    if url not in OWN_BOARDS and not url.startswith(("serial:", "udp:")):
        raise LinkError(f"link: expected serial:///dev/X?baud=N, /dev/X, udp://HOST:PORT, pty or udp, got {text!r}")
    return url


def examine_link(order: Examination, tell: Tell) -> Generator[Finding]:
    """Findings about one link and its board. The link is closed, and the board told STOP, however this ends.

    Raises LinkError for a URL that is none.
    """
    url = link_url(order.url)
    if url in OWN_BOARDS:
        yield from _own_board(order, url, tell)
        return
    device, path = None, ""
    if url.startswith("serial:"):
        path, _ = parse_url(url)
        device = devices.find(order.around, path, order.status)
        for finding in examine_device(order, path, device):
            yield finding
            if finding.status == PROBLEM:
                return
    try:
        link = open_link(url, listen=False)
    except LinkError as error:
        if str(error).startswith("link:"):
            raise
        found = Finding(PROBLEM, str(error), check="open")
        if device is not None:
            found = found._replace(advice="who has it open, of all users:", commands=(f"sudo fuser -v {path}",))
        yield found
        return
    baud = link.baud if isinstance(link, SerialLink) and device is not None and not device.is_pty else None
    answered = False
    for finding in _conversation(order, url, link, baud, tell):
        answered = answered or finding.check == "board"
        yield finding
    if order.try_bauds and not answered:
        yield try_bauds(path, device, tell)


def examine_device(order: Examination, path: str, device: Device | None) -> Generator[Finding]:
    """What is known without opening it; the caller stops at the first problem."""
    around = order.around
    yield bounded("device", lambda: devices.presence(around, path, device), LIMIT_S)
    assert device is not None
    yield bounded("permission", lambda: devices.permission(around, device, order.access), LIMIT_S)
    yield bounded("openers", lambda: devices.openers(around, device, os.getpid()), LIMIT_S)
    yield bounded("driver", lambda: devices.driver(around, device), LIMIT_S)
    nothing = Finding(OK, "")
    timer = bounded("latency timer", lambda: devices.latency(around, device) or nothing, LIMIT_S)
    if timer.found:
        yield timer


def _own_board(order: Examination, url: str, tell: Tell) -> Generator[Finding]:
    """A board process of this installation on a fresh link: what to compare a real board with."""
    tell("starting a board process")
    try:
        host: BoardHost = plug_in("process", BoardOrder(link_url=url, law_file="", log=None, notify=tell))
    except (SilError, LinkError) as error:
        yield Finding(
            PROBLEM, str(error), "try it in a terminal", ("sil run appc-rs232 --clock lockstep",), check="open"
        )
        return
    with closing(host):
        yield Finding(OK, f"{host.link.url}, with a board process of this installation on it", check="device")
        yield from _conversation(order, url, host.link, None, tell)


def _conversation(order: Examination, url: str, link: Link, baud: int | None, tell: Tell) -> Generator[Finding]:
    """Listen, say HELLO, measure, count errors. Closes the link."""
    talk = Talk(link, baud)
    before = line_errors(link)
    try:
        try:
            tell("listening")
            talk.listen(LISTEN_S)
            unasked = dict(talk.types)
            board = talk.greet(order.hello_within_s, tell)
            if board is None:
                yield from verdicts.no_answer(talk, url, verdicts.line_lines(before, line_errors(link)))
                return
            yield from verdicts.who(talk, board, unasked)
            at_greeting = talk.port.counters
            trips = talk.round_trips(order.round_trips, tell)
            yield verdicts.round_trips(talk, trips, baud)
            yield verdicts.errors(talk, at_greeting, before, line_errors(link))
        finally:
            talk.close()
    except LinkError as error:
        yield Finding(PROBLEM, str(error), "unplugged, or the program on the other side ended", check="link")


def line_errors(link: Link) -> LineErrors | None:
    """The UART's own counters, where there are any."""
    return link.line_errors() if isinstance(link, SerialLink) else None


def try_bauds(path: str, device: Device | None, tell: Tell) -> Finding:
    """HELLO at each usual baud rate in turn, and what comes at each."""
    if device is None or device.is_pty:
        return Finding(NOTE, "not tried: this link has no baud rate", check="try bauds")
    came = []
    for baud in USUAL_BAUDS:
        tell(f"trying {baud} baud")
        try:
            with closing(Talk(open_link(f"serial://{path}?baud={baud}", listen=False), baud)) as talk:
                if talk.greet(TRY_BAUD_S, tell) is not None:
                    command = f"sil doctor --link 'serial://{path}?baud={baud}'"
                    return Finding(NOTE, f"a board answers at {baud} baud", "use that", (command,), check="try bauds")
                if talk.heard.count:
                    came.append(f"{baud}: {guess(talk.undecoded()).kind}")
        except LinkError as error:
            came.append(f"{baud}: {error}")
    heard = f"; what came: {', '.join(came)}" if came else "; nothing came at any of them"
    return Finding(NOTE, f"no board answers at {', '.join(map(str, USUAL_BAUDS))}{heard}", check="try bauds")
