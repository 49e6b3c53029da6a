"""Bench `codec`: frames per second through pack, encode, decode and unpack, beside zlib's CRC and COBS alone.

The frames are those of tick 10 of a real run (law appc, fixed). The bare thing does what no implementation can leave
out: CRC and COBS there, COBS and CRC back, on the same bytes.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable

from cobs import cobs

from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.frames import Packet, Type, pack, unpack
from sil.bench import flights
from sil.bench.book import Book, Plan
from sil.bench.tape import Tape

BESIDE = "crc32 and COBS alone"
TICK = 10


class Codec:
    """The bench `codec`."""

    about = "frames packed, encoded, decoded and unpacked, beside crc32 and COBS of the same bytes alone"

    def expected_s(self, plan: Plan) -> float:
        return 2.0 + plan.repeats * 4 * self._budget_s(plan) * 2

    def measure(self, plan: Plan, book: Book) -> None:
        real = frames_of_a_tick()
        everything = list(real.values())
        cases = {"one tick, all frames": everything, **{name: [packet] for name, packet in real.items()}}
        book.details["packet_bytes"] = {name: len(packet.raw) for name, packet in real.items()}
        for _ in plan.rounds("codec"):
            for case, packets in cases.items():
                line = book.line(case, "frames/s", BESIDE, more=True)
                budget = self._budget_s(plan)
                line.add(*(rate(step, len(packets), budget) for step in (ours(packets), bare(packets))))

    @staticmethod
    def _budget_s(plan: Plan) -> float:
        return 0.05 if plan.quick else 0.2


def frames_of_a_tick() -> dict[str, Packet]:
    """SAMPLE, COMMAND and TELEMETRY of one tick of a run."""
    tape = Tape()
    flights.unrecorded(flights.scenario("appc", *flights.IN_PROCESS, "duration_s=10"), tape)
    packets = [unpack(raw) for raw in tape.packets]
    wanted = (Type.SAMPLE, Type.COMMAND, Type.TELEMETRY)
    return {Type(p.type).name: p for p in packets if p.type in wanted and p.tick == TICK}


def ours(packets: list[Packet]) -> Callable[[], None]:
    """There and back through the product's code."""
    decoder = StreamDecoder()

    def step() -> None:
        for packet in packets:
            for raw in decoder.feed(encode(pack(packet.frame, packet.sequence))):
                unpack(raw)

    return step


def bare(packets: list[Packet]) -> Callable[[], None]:
    """What stays when everything is taken away that Python does around it."""
    bodies = [packet.raw[:-4] for packet in packets]

    def step() -> None:
        for body in bodies:
            crc = zlib.crc32(body, frames.LAYOUT_HASH).to_bytes(4, "little")
            decoded = cobs.decode(cobs.encode(body + crc))
            zlib.crc32(decoded, frames.LAYOUT_HASH)

    return step


def rate(step: Callable[[], None], items: int, budget_s: float) -> float:
    """Items per second: the best of several short rounds that last budget_s together, so that a pause costs one."""
    step()
    began = time.perf_counter()
    step()
    once = max(time.perf_counter() - began, 1e-7)
    rounds, calls = 5, max(1, int(budget_s / 5 / once))
    best = float("inf")
    for _ in range(rounds):
        began = time.perf_counter()
        for _ in range(calls):
            step()
        best = min(best, time.perf_counter() - began)
    return items * calls / best
