"""Mistakes in numbers, speed and at boot; and boards that fail altogether."""

from __future__ import annotations

import random
import time

from wrong_boards import WRONG, Mistaken, Saying, Wrong, wrong

from firmware_sim.board import Board
from firmware_sim.flight import Flight
from protocol import frames
from protocol.frames import NO_TICK, Command, Event, Packet, Ready, Telemetry, Type


class OffByALsb(Flight):
    """One torque of one tick is a count off."""

    tick = 37

    def step(self, tick, sample):
        answer = super().step(tick, sample)
        if tick == self.tick:
            x, y, z = answer[0].torque
            answer[0] = answer[0]._replace(torque=(x, y + 1, z))
        return answer


WRONG += [
    Wrong(
        "a torque is off by one count in one tick", ("numbers: pd", "numbers: mrac", "numbers: appc"), flight=OffByALsb
    )
]


@wrong("a word of TELEMETRY is off by one count in one tick", "numbers: mrac")
class OffInTelemetry(Saying):
    def say(self, frame):
        if isinstance(frame, Telemetry) and frame.tick == 23:
            return (frame._replace(words=(*frame.words[:-1], frame.words[-1] + 1)),)
        return (frame,)


@wrong("an EVENT has another number", "numbers: appc")
class OtherEvent(Saying):
    def say(self, frame):
        return (frame._replace(b=frame.b + 1) if isinstance(frame, Event) else frame,)


@wrong("an answer comes after its tick", "latency")
class Slow(Flight):
    def step(self, tick, sample):
        if tick == 3 and sample is not None and sample.transit_us == 0:
            time.sleep(0.55)
        return super().step(tick, sample)


@wrong("at boot it does not say HELLO", "reset", boot=lambda board: None)
class SilentAtBoot(Mistaken):
    pass


def _boots_with_ready(board: Board) -> None:
    board.announce()
    board._port.send(Ready(0, frames.NO_INDEX, 0))


@wrong("at boot it says more than HELLO", "reset", boot=_boots_with_ready)
class ChattersAtBoot(Mistaken):
    pass


@wrong("it says HELLO now and then", "end: clean")
class Restless(Mistaken):
    count = 0

    def handle(self, packet: Packet) -> None:
        super().handle(packet)
        self.count += 1
        if packet.type == Type.HELLO and self.count % 3 == 0:
            self._port.send(self._hello(echo=False))


class Dies(Mistaken):
    """It is gone after so many frames."""

    left = 60

    def handle(self, packet: Packet) -> None:
        self.left -= 1
        if self.left > 0:
            super().handle(packet)


class Babbles(Mistaken):
    """It answers with anything that is a frame."""

    def handle(self, packet: Packet) -> None:
        super().handle(packet)
        tick = packet.tick if packet.tick != NO_TICK else 0
        choices = [
            Command(tick, (1, 2, 3), 0xFFFF, 200, frames.USED), Telemetry(tick, 1, 1, ()), Event(tick, 0xFFFF, -1, 1),
            Ready(9, 9, 9), Command(tick + 7, (0, 0, 0), 0, 0, frames.RESTARTED), Telemetry(tick, 7, 7, (1,) * 58),
            frames.Timing(tick, 1, 2, 3, 4), frames.Stop(3),
        ]  # fmt: skip
        if self._nonce is not None:
            self._port.send(*self.rng.sample(choices, self.rng.randrange(3)))

    rng = random.Random(5)
