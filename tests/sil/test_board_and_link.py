"""Which board and which link a scenario means."""

from __future__ import annotations

import pytest

from sil.rig import board_and_link
from sil.scenario import load_scenario
from sil.trouble import UsageError

SERIAL, UDP = "serial:///dev/ttyUSB0?baud=115200", "udp://127.0.0.1:5005"


@pytest.mark.parametrize(
    ("board", "link", "meant"),
    [
        ("process", "pty", ("process", "pty")),
        ("process", "udp", ("process", "udp")),
        ("process", "inproc", ("inproc", "inproc")),
        ("inproc", "pty", ("inproc", "inproc")),
        ("inproc", UDP, ("inproc", "inproc")),
        ("process", SERIAL, ("wired", SERIAL)),
        (SERIAL, "pty", ("wired", SERIAL)),
        (UDP, "inproc", ("wired", UDP)),
        ("none", "pty", ("none", "")),
    ],
)
def test_board_and_link(board: str, link: str, meant: tuple[str, str]) -> None:
    assert board_and_link(load_scenario("appc-rs232", [f"board={board}", f"link.url={link}"])) == meant


@pytest.mark.parametrize("link", ["pty", UDP, SERIAL])
def test_a_board_that_is_started_by_hand(link: str) -> None:
    assert board_and_link(load_scenario("appc-rs232", [f"link.url={link}"]), wired=True) == ("wired", link)


@pytest.mark.parametrize("link", ["inproc", "udp"])
def test_a_link_that_nobody_outside_can_find(link: str) -> None:
    with pytest.raises(UsageError, match=f"expected pty, udp://HOST:PORT or serial://PATH .* got '{link}'"):
        board_and_link(load_scenario("appc-rs232", [f"link.url={link}"]), wired=True)
