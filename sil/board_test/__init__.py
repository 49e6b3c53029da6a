"""The acceptance test of a board on a link: does it do what protocol/SPEC.md says, and how fast.

A check is a function from the Examinee to a Finding, which raises Failed or Skipped (outcome.py); one line here. They
run in this order, each on a session of its own, so that none depends on how the one before it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from functools import partial
from typing import NamedTuple

from protocol.link import LinkError
from sil.board_test import cable, flights
from sil.board_test.examinee import Examinee, Order, Tell
from sil.board_test.outcome import FAIL, PASS, SKIPPED, Failed, Silent, Skipped
from sil.doctor.findings import Finding
from sil.plugins import load
from sil.scenario_errors import one_of
from sil.trouble import EXIT_USAGE, SilError, UsageError

__all__ = ["CHECKS", "FAIL", "GROUPS", "PASS", "SKIPPED", "Checked", "Order", "examine"]

CHECKS = {
    "handshake: echo": "sil.board_test.handshake:echo",
    "handshake: once": "sil.board_test.handshake:once",
    "handshake: nonce": "sil.board_test.handshake:nonce",
    "handshake: laws": "sil.board_test.handshake:laws",
    "handshake: configured": "sil.board_test.handshake:configured",
    "handshake: sequence": "sil.board_test.handshake:sequence",
    "handshake: framing": "sil.board_test.handshake:framing",
    "states: unconfigured": "sil.board_test.states:unconfigured",
    "states: configuring": "sil.board_test.states:configuring",
    "states: half configured": "sil.board_test.states:half_configured",
    "states: refused": "sil.board_test.states:refused_config",
    "states: ready": "sil.board_test.states:ready",
    "states: running": "sil.board_test.states:running",
    "config: statuses": "sil.board_test.configs:statuses",
    "config: bad words": "sil.board_test.configs:bad_words",
    "config: limits": "sil.board_test.configs:limits",
    "config: rows": "sil.board_test.configs:rows",
    "config: parts": "sil.board_test.configs:parts",
    "config: other cut": "sil.board_test.configs:other_cut",
    "config: many words": "sil.board_test.configs:many_words",
    "receiver: refused": "sil.board_test.refusing:packets",
    "receiver: garbage": "sil.board_test.refusing:garbage",
    "receiver: cuts": "sil.board_test.refusing:cuts",
    "ticks: answer": "sil.board_test.ticks:answer",
    "ticks: TICK": "sil.board_test.ticks:tick_frame",
    "ticks: stale": "sil.board_test.ticks:stale",
    "ticks: ahead": "sil.board_test.ticks:ahead",
    "ticks: re-start": "sil.board_test.ticks:restart",
    "ticks: watchdog": "sil.board_test.ticks:watchdog",
    "ticks: overrun": "sil.board_test.ticks:overrun",
    "ticks: invalid": "sil.board_test.ticks:invalid",
    "ticks: pause": "sil.board_test.ticks:identification",
    "ticks: reuse": "sil.board_test.ticks:reuse",
    "ticks: set-point": "sil.board_test.ticks:setpoints",
    "ticks: events": "sil.board_test.ticks:many_events",
    "ticks: far": "sil.board_test.ticks:late_ticks",
    "ticks: random": "sil.board_test.ticks:at_random",
    "numbers": "sil.board_test.flights:numbers",
    "latency": "sil.board_test.flights:latency",
    "timer: steps": "sil.board_test.timer:steps",
    "timer: drift": "sil.board_test.timer:drift",
    "baud": "sil.board_test.cable:bauds",
    "reset": "sil.board_test.reset:reset",
    "end: clean": "sil.board_test.cable:clean",
    "end: left": "sil.board_test.cable:left",
}
GROUPS = tuple(dict.fromkeys(name.partition(":")[0] for name in CHECKS))
ALWAYS = ("handshake: echo", "handshake: laws", "end: left")  # others build on them
GONE = "the board does not answer HELLO any more"


class Checked(NamedTuple):
    """One check that was made."""

    group: str
    finding: Finding


def wanted(order: Order) -> list[str]:
    """The checks to make. Raises UsageError for a group, or a check, that is none."""
    for option, names in (("--only", order.only), ("--skip", order.skip)):
        for name in names:
            if name not in GROUPS and name not in CHECKS:
                group = name.partition(":")[0]
                known = [check for check in CHECKS if check.startswith(f"{group}:")] or GROUPS
                raise UsageError(f"{option}: expected {one_of(known, name)}, got {name!r}")

    def is_wanted(name: str) -> bool:
        names = {name, name.partition(":")[0]}
        return name in ALWAYS or ((not order.only or bool(names & set(order.only))) and not names & set(order.skip))

    return [name for name in CHECKS if is_wanted(name)]


def examine(order: Order, tell: Tell, ask: Tell | None = None) -> Generator[Checked]:
    """Make the checks, one finding after the other; whatever happens, the board is told STOP and nothing stays behind.

    A board that is not there, or of another layout, ends it with the finding that says so. tell(text) is called while
    something takes, ask(text) when a person has to do something. Raises UsageError before anything is sent.
    """
    names = wanted(order)
    for name in order.flights:
        flights.scenario_of(name, order.ticks)
    if not order.launched:
        order.url  # noqa: B018  (raises UsageError)
    at = Examinee(order, tell, ask or tell)
    try:
        for finding in _reached(at):
            yield Checked("link", finding)
            if finding.status == FAIL:
                return
        yield from _checked(at, names)
    finally:
        at.close()


def _reached(at: Examinee) -> Iterator[Finding]:
    """The link and who is on it."""
    try:
        yield from cable.device(at)
        at.plug()
        yield from cable.first_hello(at)
    except (SilError, LinkError) as error:
        if str(error).startswith("link:"):  # what is wrong is its name
            raise UsageError(f"board-test: {error}") from None
        if at.order.launched and isinstance(error, SilError) and error.exit_code == EXIT_USAGE:
            raise  # there is no board yet: an extra, a compiler or an emulator is missing
        yield Finding(FAIL, " ".join(str(error).split()), check="open")


def _checked(at: Examinee, names: list[str]) -> Iterator[Checked]:
    gone = False
    for name in names:
        group, _, rest = name.partition(": ")
        for title, check in _variants(at, name, rest or group):
            if gone:
                yield Checked(group, Finding(SKIPPED, GONE, check=title))
                continue
            finding = _made(check, at)
            yield Checked(group, finding._replace(check=title))
            gone = finding.status == FAIL and not at.revive()


Check = Callable[[], Finding]


def _variants(at: Examinee, name: str, title: str) -> Iterator[tuple[str, Check]]:
    """A check as it is; `numbers` once for each flight."""
    check = load(CHECKS, "check", name)
    if name != "numbers":
        yield title, partial(check, at)
        return
    for flight in at.order.flights:
        yield flights.law_of(flight), partial(check, at, flight)


def _made(check: Check, at: Examinee) -> Finding:
    try:
        return check()
    except Skipped as skipped:
        return Finding(SKIPPED, str(skipped))
    except (Silent, LinkError) as error:
        why = at.why_gone()
        return Finding(FAIL, f"{error}{f'; {why}' if why else ''}")
    except Failed as failed:
        return Finding(FAIL, str(failed), lines=failed.lines, data=failed.data)
