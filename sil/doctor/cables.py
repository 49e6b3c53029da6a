"""Checks of the cables in this machine: frames over a pty and over UDP on loopback, there and back."""

from __future__ import annotations

import time
from statistics import median

from protocol import frames
from protocol.links import Link, open_link
from protocol.port import Port
from sil.doctor.findings import OK, PROBLEM, Finding, Surroundings

ROUND_TRIPS = 50
ANSWER_S = 1.0


def pty(around: Surroundings) -> Finding:
    """A pseudo-terminal, as every `sil run` with link pty needs one."""
    with open_link("pty", listen=False) as lab, open_link(lab.url, listen=True) as board:
        return _both_ways(lab, board, ("ls -l /dev/ptmx /dev/pts", "mount | grep devpts"))


def udp(around: Surroundings) -> Finding:
    """UDP on loopback, as every `sil run` with link udp needs it."""
    with open_link("udp://127.0.0.1:0", listen=True) as board, open_link(board.url, listen=False) as lab:
        return _both_ways(lab, board, ("ip address show lo", "sudo nft list ruleset"))


def _both_ways(lab_end: Link, board_end: Link, commands: tuple[str, ...]) -> Finding:
    """HELLO, then frames there and answers back; every one has to come as it was sent."""
    lab, board = Port(lab_end), Port(board_end)
    sent = [frames.Hello(frames.PROTOCOL_VERSION, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, 1, 0, "sil doctor")]
    sent += [frames.Tick(tick) for tick in range(ROUND_TRIPS)]  # type: ignore[misc]
    times_us = []
    for number, frame in enumerate(sent):
        began = time.perf_counter_ns()
        answer = frames.Command(number, (number, -number, 1 << 30), 0, 0, frames.USED)
        for sender, receiver, message in ((lab, board, frame), (board, lab, answer)):
            sender.send(message)
            packet = receiver.receive(ANSWER_S)
            if packet is None or packet.frame != message:
                got = "nothing" if packet is None else repr(packet.frame)
                found = f"{type(message).__name__} {number} of {len(sent)} sent, {got} received"
                return Finding(PROBLEM, found, "the link of a run would not work; look at", commands)
        times_us.append((time.perf_counter_ns() - began) / 1000)
    typical = median(times_us)
    data = {"round_trips": len(sent), "median_us": typical, "max_us": max(times_us)}
    return Finding(OK, f"{len(sent)} frames there and back, median {typical:.0f} us in one process", data=data)
