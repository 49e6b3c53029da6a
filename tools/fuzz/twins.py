"""Target `twins`: the C board and the Python board hear the same: the same verdicts, counters, answers, and waits."""

from __future__ import annotations

from dataclasses import asdict
from random import Random

from protocol import frames
from protocol.codec import StreamDecoder, encode
from protocol.law_tables import COMMON, FORM_FLOAT
from tools.fuzz import build_folder, expect, with_board_tests
from tools.fuzz.mutation import mutated
from tools.fuzz.session import PACKET, RAW, Record, from_steps, heard_steps, joined, records

FORM = [word.name for word in COMMON].index("form")
DATAGRAM = 1  # the other options are of the C side alone


class Twins:
    """Input: as session.py has it."""

    about = "C and Python: the same packets, counters and answers"

    def __init__(self) -> None:
        with_board_tests()
        import c_board
        import hostile

        self._twin = c_board
        self._hostile = hostile
        self._c = c_board.CBoard(build_folder())

    def seeds(self) -> list[bytes]:
        return [from_steps(self._hostile.Laboratory(Random(seed)).steps(40), seed % 4) for seed in range(24)]

    def mutate(self, data: bytes, random: Random) -> bytes:
        """Records lost, doubled, exchanged, or with other content; a session of its own now and then."""
        made = list(records(data or b"\0"))
        options = data[0] if data and random.random() < 0.95 else random.randrange(4)
        for _ in range(1 + random.randrange(4)):
            at = random.randrange(len(made) + 1)
            kind = random.randrange(6)
            if kind == 0:
                del made[at : at + 1 + random.randrange(3)]
            elif kind == 1:
                made[at:at] = made[at : at + 1 + random.randrange(6)]
            elif kind == 2:
                made.insert(at, Record(PACKET, self._hostile.any_packet(random)[:-4]))
            elif kind == 3 and random.random() < 0.1:
                made[at:at] = records(from_steps(self._hostile.Laboratory(random).steps(12)))
            elif at < len(made):
                made[at] = Record(made[at].kind, _other(made[at], random))
        return joined(options, made[:400])

    def check(self, data: bytes) -> None:
        if not data:
            return
        twin = self._twin
        options, steps = heard_steps(data, twin.Step)
        options &= DATAGRAM
        steps = [step if step.time_ns is not None else twin.Step(_fixed_form(step.data, options)) for step in steps]
        twin.assert_same(self._c.serve(steps, options), twin.python_board(steps, options))
        self._same_decoders(b"".join(step.data for step in steps), data[0])

    def _same_decoders(self, stream: bytes, cut: int) -> None:
        python = StreamDecoder()
        packets = [(_verdict(packet), packet) for packet in python.feed(stream)]
        counters = asdict(python.counters) | {"pending": python.buffered}
        in_c = self._c.decode(stream, cut or 1)
        expect(in_c == (packets, counters), f"C {in_c}, Python {packets, counters}")


def _other(record: Record, random: Random) -> bytes:
    payload = mutated(record.payload, random)
    return payload[:2].ljust(2, b"\0") if record.kind not in (PACKET, RAW) else payload[:246]


def _verdict(packet: bytes) -> int:
    reasons = {"version": 4, "type": 5, "length": 6, "value": 7}  # packet_verdict of firmware/core/frames.h
    try:
        frames.unpack_checked(packet)
    except frames.BadPacket as bad:
        return reasons[bad.reason]
    return 0


def _fixed_form(data: bytes, options: int) -> bytes:
    """CONFIG without the float form, which a C board does not have."""
    packets = [data] if options & 1 else StreamDecoder().feed(data)
    for packet in packets:
        try:
            frame = frames.unpack(packet).frame
        except frames.BadPacket:
            continue
        if isinstance(frame, frames.Config) and frame.offset <= FORM < frame.offset + len(frame.words):
            words = list(frame.words)
            if words[FORM - frame.offset] == FORM_FLOAT:
                words[FORM - frame.offset] = 0
            fixed = frames.pack(frame._replace(words=tuple(words)), frames.unpack(packet).sequence)
            data = fixed if options & DATAGRAM else data.replace(encode(packet), encode(fixed))
    return data
