"""sil doctor: is this machine fit, and does the board on that link answer."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from typing import TYPE_CHECKING, Annotated

import typer

from sil.trouble import EXIT_INTERRUPTED, EXIT_LINK, EXIT_OK, UsageError
from sil.verbs.options import JsonOption, print_json

if TYPE_CHECKING:
    from sil.doctor.findings import Finding
    from sil.doctor.show import Progress


def doctor(
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            metavar="URL",
            help="Examine this link and its board: serial:///dev/X[?baud=N], /dev/X, udp://HOST:PORT; "
            "pty or udp: a board process started for it, to compare with.",
        ),
    ] = None,
    round_trips: Annotated[
        int,
        typer.Option("--round-trips", metavar="N", min=1, max=1_000_000, help="With --link: how many to measure."),
    ] = 1000,
    try_bauds: Annotated[
        bool, typer.Option("--try-bauds", help="With --link: where nothing answers, try the usual baud rates.")
    ] = False,
    as_json: JsonOption = False,
) -> int:
    """Find out what is wrong with this machine, or with a link and its board, and what to do about it.

    Without --link: Python, packages, compiled code, processors, kernel, permissions, pty, UDP, compilers, disk.
    With it: the device, who else has it open, its USB latency timer; then HELLO, a thousand round trips with
    percentiles, and line errors. Ends the session of a board that is in one; leaves the board without a session.

    Exit codes: 0 no problem (notes are none), 2 no such link, 3 a problem, 130 interrupted.

    Examples: sil doctor | sil doctor --link /dev/ttyUSB0 --try-bauds | sil doctor --link udp://192.168.7.2:5005
    """
    from sil.doctor.findings import PROBLEM
    from sil.doctor.show import Page, Progress
    from sil.stopping import terminated_like_interrupted

    if link is None and try_bauds:
        raise UsageError("--try-bauds: expected a link to try them on, got none; known: --link serial:///dev/X")
    progress, page = Progress(), None if as_json else Page()
    findings: list[Finding] = []
    try:
        with terminated_like_interrupted(), closing(_findings(link, round_trips, try_bauds, progress)) as coming:
            for finding in coming:
                progress.clear()
                findings.append(finding)
                if page is not None:
                    page.show(finding)
    except KeyboardInterrupt:
        progress.clear()
        typer.echo("interrupted", err=True)
        return EXIT_INTERRUPTED
    finally:
        progress.clear()
    code = EXIT_LINK if any(finding.status == PROBLEM for finding in findings) else EXIT_OK
    if page is None:
        print_json({"healthy": code == EXIT_OK, "link": link, "findings": [finding.as_dict() for finding in findings]})
    else:
        page.summary(findings, link or "this machine")
    return code


def _findings(link: str | None, round_trips: int, try_bauds: bool, progress: Progress) -> Generator[Finding]:
    from sil.doctor import Surroundings, examine

    if link is None:
        yield from examine(Surroundings(), tell=progress.tell)
        return
    from protocol.links import LinkError
    from sil.doctor.link import Examination, examine_link

    try:
        yield from examine_link(Examination(link, round_trips, try_bauds), progress.tell)
    except LinkError as error:  # what is wrong with a link that can be opened is a finding; this is no link at all
        raise UsageError(f"--{error}") from None
