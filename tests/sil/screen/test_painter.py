"""The process that draws, in this process: what comes over the socket, and what goes to the terminal."""

from __future__ import annotations

import io
import socket
import time

import made
import pytest
from rich.console import Console

from sil.screen import messages, painter


def test_a_storm_of_lines_is_printed_at_once_and_the_view_is_the_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Protects: with -v and an event every tick the view does not lag behind the run."""
    monkeypatch.setattr(painter.os, "get_terminal_size", lambda fd: painter.os.terminal_size((80, 24)))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=80, height=24)
    with ours, theirs:
        told = [made.plan(), made.state(1), *(messages.Line(f"line {k}") for k in range(100)), made.state(900)]
        for message in (*told, messages.End()):
            ours.send(messages.pack(message))
        began = time.monotonic()
        painter.Painter(theirs, console).work()
        assert time.monotonic() - began < 30, "it ended by itself"
    text = file.getvalue()
    assert text.index("line 0\n") < text.index("line 99") < text.index("450.5 of 600 s")
    assert "1.0 of 600 s" not in text, "a view that was out of date before it could be drawn"


def test_a_laboratory_that_is_gone_ends_it() -> None:
    """Protects: no orphan, whatever ended the laboratory, even before it said what is run."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.close()
    with theirs:
        painter.Painter(theirs, Console(file=io.StringIO())).work()
