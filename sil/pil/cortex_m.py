"""The emulated Cortex-M board: python -m sil.pil.cortex_m --link URL [--once] [--parent PID] [--image FILE].

The firmware's mps2-an386 image, as it would be flashed, on an emulated processor; its UART is the link. On a pty or a
serial port the UART's bytes are the link's bytes. On UDP the image still speaks COBS, so this process makes datagrams
of its frames and the other way round.

Standard error says what happens to the firmware: faults, resets, a watchdog that bit. SIGUSR1 is the reset button, and
SIGTERM pulls the plug.
"""

from __future__ import annotations

import argparse
import os
import select
import signal
import sys
from pathlib import Path

from protocol.codec import StreamDecoder, decoder_for, encode
from protocol.frames import MAX_PACKET, Type
from protocol.links import Link, LinkClosed, LinkError, open_link
from sil.pil.engine import EngineError
from sil.pil.hosting import (
    EXIT_BOARD,
    EXIT_LINK,
    EXIT_USAGE,
    die_with,
    fail,
    say_listening,
    settle_timers,
    take_stdout,
    wake_pipe,
)
from sil.pil.image import ImageError, load_image
from sil.pil.machine import Machine, ResetStorm
from sil.pil.supervisor import Supervisor

NAME = "cortex-m"
TYPE_AT = 1  # of a packet


def main(argv: list[str] | None = None) -> int:
    """Exit codes: 0 told to end, or the session is over with --once; 2 bad arguments, no unicorn or no image; 3 link
    failure; 4 the firmware resets again and again."""
    options = _parser().parse_args(argv)
    if options.parent:
        die_with(options.parent)
    stdout = take_stdout()
    settle_timers()
    try:
        machine = Machine(load_image(options.image), _tell)
    except (EngineError, ImageError) as error:
        return fail(f"{NAME}: {error}", EXIT_USAGE)
    try:
        link = open_link(options.link, listen=True)
    except LinkError as error:
        return fail(str(error), EXIT_LINK)
    wake = wake_pipe(signal.SIGUSR1, signal.SIGTERM, signal.SIGINT)
    say_listening(stdout, link.url)
    board = PluggedIn(machine, link, wake, options.once)
    try:
        with link, Supervisor(machine, wake):
            board.serve()
    except LinkClosed as error:
        return 0 if options.once or board.session_over else fail(str(error), EXIT_LINK)
    except LinkError as error:
        return fail(str(error), EXIT_LINK)
    except ResetStorm as error:
        return fail(f"{NAME}: {error}", EXIT_BOARD)
    return 0


class PluggedIn:
    """A machine on a link: bytes from one into the other until the link ends, a signal says so, or the session is over.

    session_over: the laboratory has said STOP, and nothing since.
    """

    def __init__(self, machine: Machine, link: Link, wake_fd: int, once: bool) -> None:
        self._machine, self._link, self._wake_fd, self._once = machine, link, wake_fd, once
        self._from_uart = StreamDecoder()  # towards datagrams
        self._seen = decoder_for(link.datagram)  # to recognise STOP
        self.session_over = False

    def serve(self) -> None:
        """Raises LinkClosed, LinkError, ResetStorm."""
        self._send(self._machine.power_on())
        poller = select.poll()
        poller.register(self._link.fileno(), select.POLLIN)
        poller.register(self._wake_fd, select.POLLIN)
        while not (self._once and self.session_over):
            ready = poller.poll()
            if any(fd == self._wake_fd for fd, _ in ready) and self._plug_pulled():
                return
            self._send(self._machine.reset_if_asked())
            if any(fd != self._wake_fd for fd, _ in ready):
                self._exchange(self._link.receive(0.0))

    def _exchange(self, data: bytes) -> None:
        """What has come, into the UART; what the firmware answered, in one piece, out again."""
        packets = self._seen.feed(data)
        if self._link.datagram:
            data = encode(data) if 0 < len(data) <= MAX_PACKET else b""  # the firmware's to refuse, or its wire cannot
        self._send(self._machine.exchange(data))
        if packets:
            self.session_over = packets[-1][TYPE_AT] == Type.STOP

    def _send(self, data: bytes) -> None:
        if not data:
            return
        if not self._link.datagram:
            self._link.send(data)
            return
        for packet in self._from_uart.feed(data):
            self._link.send(packet)

    def _plug_pulled(self) -> bool:
        """Which signals have come: SIGUSR1 presses the reset button, any other ends this process."""
        numbers = os.read(self._wake_fd, 64)
        if signal.SIGUSR1 in numbers:
            self._machine.ask("the button was pressed (SIGUSR1)")
        return any(number != signal.SIGUSR1 for number in numbers)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sil.pil.cortex_m",
        description="The firmware's mps2-an386 image on an emulated Cortex-M4; its UART is the link. For lockstep: "
        "it has no timer of its own.",
        epilog="examples: --link serial:///dev/pts/7   --link udp://127.0.0.1:5005 --image build/zig/mps2-an386.elf",
    )
    parser.add_argument(
        "--link", required=True, metavar="URL", help="serial://PATH[?baud=N] or udp://HOST:PORT to listen on"
    )
    parser.add_argument("--image", type=Path, metavar="FILE", help="an image of your own; default: the one that ships")
    parser.add_argument(
        "--once", action="store_true", help="exit after the first session (default: serve until stopped)"
    )
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    return parser


def _tell(line: str) -> None:
    print(f"{NAME}: {line}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
