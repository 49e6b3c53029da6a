"""What one flight costs the firmware: python -m sil.pil.budget [--image FILE] [--parent PID] < flight > figures.

In: `law` (name), `config` (packets), `ticks` (pairs of what goes in at a tick, and the answer that has to come out);
packets in hexadecimal. Out: instructions of every call of the law's step and of the whole step of the board, and of
every answer; the stack's high water; bytes of the image.

The image has to give the recorded answers, or its figures are not those of this flight.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any, TextIO

from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.frames import Hello, Type
from sil.pil.counting import Counter
from sil.pil.engine import EngineError
from sil.pil.hosting import EXIT_BOARD, EXIT_USAGE, die_with, fail
from sil.pil.image import Image, ImageError, load_image
from sil.pil.machine import Machine, ResetStorm

BOARD_STEP = "flight_step"
BYTEWISE_EVERY = 20  # ticks: one answer in so many is fed byte by byte, which takes ten times as long to count
TYPE_AT = 1  # of a packet
NONCE = 1
SAID = "cortex-m"


class Differs(Exception):
    """The image answers otherwise than the flight that was recorded; one line."""


def main(argv: list[str] | None = None, into: TextIO = sys.stdin, out: TextIO = sys.stdout) -> int:
    """Exit codes: 0 counted, 2 no unicorn, no image or no flight, 4 the image answers otherwise, or not at all."""
    parser = argparse.ArgumentParser(prog="sil.pil.budget", description="Instructions of one flight, counted.")
    parser.add_argument("--image", type=Path, metavar="FILE", help="an image of your own; default: the one that ships")
    parser.add_argument("--parent", type=int, metavar="PID", help="exit at once when this process is gone")
    options = parser.parse_args(argv)
    if options.parent:
        die_with(options.parent)
    try:
        order = json.load(into)
        figures = count(load_image(options.image), order)
    except (EngineError, ImageError) as error:
        return fail(f"{SAID}: {error}", EXIT_USAGE)
    except (ValueError, LookupError, TypeError) as error:
        return fail(f"{SAID}: expected a flight as JSON, got {type(error).__name__}: {error}", EXIT_USAGE)
    except (Differs, ResetStorm) as error:
        return fail(f"{SAID}: {error}", EXIT_BOARD)
    json.dump(figures, out)
    return 0


def count(image: Image, order: dict[str, Any]) -> dict[str, Any]:
    """Fly it. Raises Differs, ResetStorm, ValueError, LookupError."""
    meter = _Meter(image, f"{order['law']}_step")
    meter.configure([bytes.fromhex(packet) for packet in order["config"]])
    for number, (sent, answer) in enumerate(order["ticks"]):
        meter.tick(bytes.fromhex(sent), [bytes.fromhex(packet) for packet in answer], number)
    return {
        "build": meter.build,
        "law_step": meter.law_step,
        "board_step": meter.board_step,
        "answer": meter.in_one_go,
        "answer_bytewise": meter.bytewise,
        "stack_bytes": stack_high_water(meter.machine),
        "image_bytes": image_bytes(image),
    }


class _Meter:
    """A machine with a counter on it; the lists hold instructions, call by call."""

    def __init__(self, image: Image, law_step: str) -> None:
        self.machine = Machine(image, _refuse, on_sent=self._byte_out)
        self._counter = Counter(self.machine)
        self._out = StreamDecoder()
        self._at_last_byte = 0
        self.law_step, self.board_step = self._watch(law_step), self._watch(BOARD_STEP)
        self.in_one_go: list[int] = []
        self.bytewise: list[int] = []
        self.build = ""
        self.machine.power_on()

    def _watch(self, function: str) -> list[int]:
        if function not in self.machine.image.symbols:
            raise ImageError(f"{self.machine.image.path}: expected a function {function}, found none: is it stripped?")
        return self._counter.watch(function)

    def configure(self, parts: list[bytes]) -> None:
        hello = Hello(frames.PROTOCOL_VERSION, frames.ROLE_LAB, 0, frames.LAYOUT_HASH, NONCE, 0, "budget")
        echoes = self._out.feed(self.machine.exchange(encode(frames.pack(hello, 0))))
        self.build = next((frames.unpack(each).frame.build for each in echoes if each[TYPE_AT] == Type.HELLO), "")
        said = self._out.feed(self.machine.exchange(b"".join(map(encode, parts))))
        if not any(packet[TYPE_AT] == Type.READY for packet in said):
            raise Differs("expected READY after CONFIG, got nothing of the kind: image and laboratory do not agree")

    def tick(self, sent: bytes, expected: list[bytes], number: int) -> None:
        data, began = encode(sent), self._counter.total
        if number % BYTEWISE_EVERY == BYTEWISE_EVERY - 1:
            answer = b"".join(self.machine.exchange(data[at : at + 1]) for at in range(len(data)))
            self.bytewise.append(self._at_last_byte - began)
        else:
            answer = self.machine.exchange(data)
            self.in_one_go.append(self._at_last_byte - began)
        got = [packet for packet in self._out.feed(answer) if not frames.is_housekeeping(packet[TYPE_AT])]
        if got != expected:
            raise Differs(f"the image answers otherwise than the recorded board at tick {number}")

    def _byte_out(self) -> None:
        self._at_last_byte = self._counter.total


def stack_high_water(machine: Machine) -> int:
    """Deepest stack since the start, in bytes: what start-up painted there is still whole below it."""
    symbols = machine.image.symbols
    bottom, top = symbols["stack_bottom"][0], symbols["stack_top"][0]
    stack = machine.engine.read(bottom, top - bottom)
    paint = stack[:4]
    words = (at for at in range(0, len(stack), 4) if stack[at : at + 4] != paint)
    return len(stack) - next(words, len(stack))


def image_bytes(image: Image) -> dict[str, int]:
    """code: instructions and constants; data: initialised, in flash and in RAM; ram: all of it, the stack included."""
    sections = dict(image.sections)
    code, data = sections.pop(".text"), sections.pop(".data", 0)
    return {"code": code, "data": data, "ram": data + sum(sections.values()), "stack_reserved": sections[".stack"]}


def _refuse(line: str) -> None:
    raise Differs(line)


if __name__ == "__main__":
    sys.exit(main())
